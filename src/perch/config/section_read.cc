#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>

#include "perch/config/section.h"
#include "perch/config/strict_yaml.h"
#include "perch/geometry/euler.h"

// The typed reads of Section. A default is noted in resolved() only where it could be read again: one that
// stands for "not given" (no path, an empty list, a NaN, a number out of its own range) is left out.

namespace perch {

namespace fs = std::filesystem;

namespace {

std::string bounds(const Range& range) {
  const bool low = range.min > std::numeric_limits<double>::lowest();
  const bool high = range.max < std::numeric_limits<double>::max();
  std::ostringstream text;
  text.precision(10);  // the bounds of int in full
  if (range.min == kPositive.min) {
    text << " above 0";
    if (high) text << " and at most " << range.max;
  } else if (low && high) {
    text << " between " << range.min << " and " << range.max;
  } else if (low) {
    text << " of at least " << range.min;
  } else if (high) {
    text << " of at most " << range.max;
  }
  return text.str();
}

bool within(const Range& range, double value) { return value >= range.min && value <= range.max; }

// The whole text as one number, whatever the locale; empty when it is none.
std::optional<double> parse_number(std::string_view text) {
  if (text.starts_with('+') && !text.starts_with("+-")) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

// The shortest text that is read as the same number: 0.1 and not 0.10000000000000001.
std::string number_text(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value).ptr};
}

YAML::Node list_node(const std::vector<double>& values) {
  YAML::Node node(YAML::NodeType::Sequence);
  for (const double v : values) node.push_back(number_text(v));
  node.SetStyle(YAML::EmitterStyle::Flow);
  return node;
}

YAML::Node pose_node(const Rigid3& pose) {
  YAML::Node node;
  const auto& p = pose.translation;
  const auto q = positive_w(pose.rotation);
  node["position"] = list_node({p.x(), p.y(), p.z()});
  node["rotation"]["quaternion_wxyz"] = list_node({q.w(), q.x(), q.y(), q.z()});
  return node;
}

}  // namespace

double Section::number(const YAML::Node& node, const std::string& path, Range range) const {
  const auto value = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
  if (!value || !within(range, *value)) fail_at(node, path, "a number" + bounds(range));
  return *value;
}

std::vector<double> Section::numbers(const YAML::Node& node, const std::string& path, size_t size,
                                     Range range) const {
  if (!node.IsSequence() || (size > 0 && node.size() != size)) {
    fail_at(node, path, "a list of " + (size > 0 ? std::to_string(size) + " " : "") + "numbers");
  }
  std::vector<double> values;
  for (size_t i = 0; i < node.size(); ++i) {
    values.push_back(number(node[i], path + "[" + std::to_string(i) + "]", range));
  }
  return values;
}

void Section::read(std::string_view key, bool& value) {
  if (const auto node = find(key); node.IsDefined()) {
    if (!node.IsScalar() || (node.Scalar() != "true" && node.Scalar() != "false")) {
      fail_at(node, full_key(key), "true or false");
    }
    value = node.Scalar() == "true";
  }
  resolved_[std::string(key)] = value;
}

void Section::read(std::string_view key, int& value, Range range) {
  if (const auto node = find(key); node.IsDefined()) {
    const auto given = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    const bool whole = given && *given == std::floor(*given);
    if (!whole || !within(range, *given)) fail_at(node, full_key(key), "a whole number" + bounds(range));
    constexpr Range kInt{std::numeric_limits<int>::min(), std::numeric_limits<int>::max()};
    if (!within(kInt, *given)) fail_at(node, full_key(key), "a whole number" + bounds(kInt));
    value = static_cast<int>(*given);
  }
  if (within(range, value)) resolved_[std::string(key)] = value;
}

void Section::read(std::string_view key, double& value, Range range) {
  if (const auto node = find(key); node.IsDefined()) value = number(node, full_key(key), range);
  if (within(range, value)) resolved_[std::string(key)] = number_text(value);
}

void Section::read(std::string_view key, std::string& value) {
  if (const auto node = find(key); node.IsDefined()) {
    if (!node.IsScalar()) fail_at(node, full_key(key), "a text");
    value = node.Scalar();
  }
  resolved_[std::string(key)] = value;
}

void Section::read(std::string_view key, std::vector<double>& value, size_t size, Range range) {
  if (const auto node = find(key); node.IsDefined()) value = numbers(node, full_key(key), size, range);
  const bool readable = std::all_of(value.begin(), value.end(), [&](double v) { return within(range, v); });
  if (readable && (size == 0 || value.size() == size)) resolved_[std::string(key)] = list_node(value);
}

Rigid3 Section::pose(const YAML::Node& node, const std::string& path) const {
  if (node.IsScalar() && node.Scalar() == "identity") return {};
  if (!node.IsMap()) {
    fail_at(node, path, "identity or {position: [x, y, z], rotation: {ypr_deg: [y, p, r]}}");
  }
  // What the two sections note is of no use: a pose is noted as a whole, in one form.
  Section given(document_, node, YAML::Node(YAML::NodeType::Map), path, line_of(node, path));
  std::vector<double> position{0, 0, 0}, ypr{0, 0, 0}, wxyz{1, 0, 0, 0};
  given.read("position", position, 3);
  Section rotation = given.section("rotation");
  given.done();
  rotation.read("ypr_deg", ypr, 3);
  rotation.read("quaternion_wxyz", wxyz, 4);
  rotation.done();
  if (rotation.has("ypr_deg") && rotation.has("quaternion_wxyz")) {
    rotation.fail("expected ypr_deg or quaternion_wxyz, found both");
  }
  Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  // Written with three digits a unit quaternion is off by up to 1e-3; more is a slip.
  if (!(std::abs(q.norm() - 1) <= 2e-3)) rotation.fail("quaternion_wxyz", "a quaternion of length 1");
  if (rotation.has("ypr_deg")) {
    q = rotation_from_ypr({ypr[0] * kRadFromDeg, ypr[1] * kRadFromDeg, ypr[2] * kRadFromDeg});
  }
  // One that is of length 1 to rounding stays as it is: what resolved() prints must come back bit for bit.
  if (std::abs(q.norm() - 1) > 8 * std::numeric_limits<double>::epsilon()) q.normalize();
  return {positive_w(q), {position[0], position[1], position[2]}};
}

void Section::read(std::string_view key, Rigid3& value) {
  if (const auto node = find(key); node.IsDefined()) value = pose(node, full_key(key));
  resolved_[std::string(key)] = pose_node(value);
}

void Section::read(std::string_view key, std::optional<Rigid3>& value) {
  if (const auto node = find(key); node.IsDefined()) value = pose(node, full_key(key));
  if (value) resolved_[std::string(key)] = pose_node(*value);
}

void Section::read(std::string_view key, fs::path& value) {
  if (const auto node = find(key); node.IsDefined()) {
    if (!node.IsScalar() || node.Scalar().empty()) fail_at(node, full_key(key), "a path");
    value = resolve(key, node.Scalar());
  }
  if (!value.empty()) resolved_[std::string(key)] = fs::absolute(value).lexically_normal().string();
}

void Section::read_source(std::string_view key, std::string& value,
                          std::initializer_list<std::string_view> file_schemes) {
  if (const auto node = find(key); node.IsDefined()) {
    const size_t colon = node.IsScalar() ? node.Scalar().find(':') : std::string::npos;
    if (colon == std::string::npos || colon == 0 || colon + 1 == node.Scalar().size()) {
      fail_at(node, full_key(key), "a source, KIND:WHAT");
    }
    value = node.Scalar();
    const std::string scheme = value.substr(0, colon);
    if (std::find(file_schemes.begin(), file_schemes.end(), scheme) != file_schemes.end()) {
      value = scheme + ":" + resolve(key, value.substr(colon + 1)).string();
    }
  }
  if (!value.empty()) resolved_[std::string(key)] = value;
}

size_t Section::choose(std::string_view key, const std::vector<std::string_view>& names, size_t chosen) {
  if (const auto node = find(key); node.IsDefined()) {
    const auto it = node.IsScalar() ? std::find(names.begin(), names.end(), node.Scalar()) : names.end();
    if (it == names.end()) {
      std::string expected = "one of";
      for (const auto& name : names) expected += (name == names.front() ? " " : ", ") + std::string(name);
      fail_at(node, full_key(key), expected);
    }
    chosen = static_cast<size_t>(it - names.begin());
  }
  resolved_[std::string(key)] = std::string(names[chosen]);
  return chosen;
}

}  // namespace perch
