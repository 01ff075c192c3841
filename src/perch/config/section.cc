#include "perch/config/section.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <set>
#include <sstream>

#include "perch/geometry/euler.h"

namespace perch {

namespace fs = std::filesystem;

struct Section::Document {
  fs::path file;
  YAML::Node resolved;
  std::set<std::string> from_command_line;  // full keys that --set gave
};

namespace {

// What the file has there, short enough for one line.
std::string found(const YAML::Node& node) {
  if (!node.IsDefined()) return "nothing";
  if (node.IsNull()) return "nothing";
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  return '"' + node.Scalar() + '"';
}

std::string bounds(const Range& range) {
  const bool low = range.min > std::numeric_limits<double>::lowest();
  const bool high = range.max < std::numeric_limits<double>::max();
  std::ostringstream text;
  if (range.min == kPositive.min && !high) {
    text << " above 0";
  } else if (range.min == kPositive.min) {
    text << " above 0 and at most " << range.max;
  } else if (low && high) {
    text << " between " << range.min << " and " << range.max;
  } else if (low) {
    text << " of at least " << range.min;
  } else if (high) {
    text << " of at most " << range.max;
  }
  return text.str();
}

// The whole text as one number, whatever the locale; empty when it is none.
std::optional<double> parse_number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

YAML::Node list_node(std::initializer_list<double> values) {
  YAML::Node node;
  for (double v : values) node.push_back(v);
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

// yaml-cpp takes the last of two equal keys in silence: an edit that was meant to count would not.
void refuse_twice(const YAML::Node& node, const fs::path& file) {
  if (node.IsMap()) {
    std::set<std::string> seen;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) continue;
      if (!seen.insert(entry.first.Scalar()).second) {
        throw ConfigError(file.string() + ":" + std::to_string(entry.first.Mark().line + 1) + ": " +
                          entry.first.Scalar() + ": expected each key once, found it twice");
      }
    }
    for (const auto& entry : node) refuse_twice(entry.second, file);
  } else if (node.IsSequence()) {
    for (const auto& entry : node) refuse_twice(entry, file);
  }
}

void apply_override(YAML::Node root, const std::string& text, std::set<std::string>& keys) {
  const size_t equals = text.find('=');
  if (equals == std::string::npos || equals == 0) {
    throw ConfigError("--set " + text + ": expected key.path=value");
  }
  const std::string path = text.substr(0, equals);
  YAML::Node node = root;
  std::istringstream parts(path);
  for (std::string part; std::getline(parts, part, '.');) {
    if (part.empty()) throw ConfigError("--set " + text + ": expected key.path=value, found an empty key");
    if (node.IsDefined() && !node.IsNull() && !node.IsMap()) {
      throw ConfigError("--set " + text + ": " + part + ": expected a mapping above it, found " + found(node));
    }
    node.reset(node[part]);
  }
  try {
    node = YAML::Load(text.substr(equals + 1));
  } catch (const YAML::Exception& e) {
    throw ConfigError("--set " + text + ": expected a YAML value: " + e.msg);
  }
  keys.insert(path);
}

}  // namespace

Section::Section(std::shared_ptr<Document> document, YAML::Node node, YAML::Node resolved, std::string path)
    : document_(std::move(document)),
      node_(std::move(node)),
      resolved_(std::move(resolved)),
      path_(std::move(path)),
      known_(std::make_shared<std::vector<std::string>>()) {}

Section Section::load(const fs::path& file, const std::vector<std::string>& overrides) {
  std::ifstream stream(file, std::ios::binary);
  std::error_code ignored;
  if (!stream || fs::is_directory(file, ignored)) {
    throw ConfigError(file.string() + ": expected a YAML file, found none that can be read");
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return parse(text.str(), file, overrides);
}

Section Section::parse(const std::string& text, const fs::path& name,
                       const std::vector<std::string>& overrides) {
  auto document = std::make_shared<Document>();
  document->file = name;
  YAML::Node root;
  try {
    root = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw ConfigError(name.string() + ":" + std::to_string(e.mark.line + 1) + ": expected YAML: " + e.msg);
  }
  if (!root.IsDefined() || root.IsNull()) root = YAML::Node(YAML::NodeType::Map);
  if (!root.IsMap()) throw ConfigError(name.string() + ":1: expected a mapping, found " + found(root));
  refuse_twice(root, name);
  for (const auto& entry : overrides) apply_override(root, entry, document->from_command_line);
  document->resolved = YAML::Node(YAML::NodeType::Map);
  return Section(document, root, document->resolved, "");
}

std::string Section::full_key(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

std::string Section::place(const YAML::Node& node, const std::string& path) const {
  for (std::string key = path; !key.empty();) {
    if (document_->from_command_line.contains(key)) return "--set " + key;
    const size_t dot = key.find_last_of(".[");
    key = dot == std::string::npos ? "" : key.substr(0, dot);
  }
  const YAML::Node& where = node.IsDefined() && !node.Mark().is_null() ? node : node_;
  std::string text = document_->file.string();
  if (where.IsDefined() && !where.Mark().is_null()) text += ":" + std::to_string(where.Mark().line + 1);
  return text;
}

void Section::fail_at(const YAML::Node& node, const std::string& path, const std::string& expected) const {
  throw ConfigError(place(node, path) + ": " + path + ": expected " + expected + ", found " + found(node));
}

void Section::fail(std::string_view key, const std::string& expected) const {
  const std::string name(key);
  fail_at(node_.IsMap() && node_[name] ? node_[name] : YAML::Node(YAML::NodeType::Undefined), full_key(key),
          expected);
}

void Section::fail(std::string_view key, const std::string& expected, const std::string& found) const {
  const YAML::Node& map = node_;
  const YAML::Node node = map.IsMap() ? map[std::string(key)] : YAML::Node(YAML::NodeType::Undefined);
  const std::string path = full_key(key);
  throw ConfigError(place(node, path) + ": " + path + ": expected " + expected + ", found " + found);
}

void Section::fail(const std::string& what) const {
  throw ConfigError(place(node_, path_) + (path_.empty() ? "" : ": " + path_) + ": " + what);
}

YAML::Node Section::find(std::string_view key) {
  const std::string name(key);
  known_->push_back(name);
  if (!node_.IsMap()) return YAML::Node(YAML::NodeType::Undefined);
  const YAML::Node& map = node_;
  return map[name];
}

bool Section::has(std::string_view key) const {
  const YAML::Node& map = node_;
  return map.IsMap() && map[std::string(key)].IsDefined();
}

bool Section::is_mapping_with(std::string_view key, std::string_view inner) const {
  if (!has(key)) return false;
  const YAML::Node& map = node_;
  const YAML::Node value = map[std::string(key)];
  return value.IsMap() && value[std::string(inner)].IsDefined();
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> names;
  if (node_.IsMap()) {
    for (const auto& entry : node_) names.push_back(entry.first.Scalar());
  }
  return names;
}

double Section::number(const YAML::Node& node, const std::string& path, Range range) const {
  const std::string expected = "a number" + bounds(range);
  if (!node.IsScalar()) fail_at(node, path, expected);
  const auto value = parse_number(node.Scalar());
  if (!value || !(*value >= range.min && *value <= range.max)) fail_at(node, path, expected);
  return *value;
}

std::vector<double> Section::numbers(const YAML::Node& node, const std::string& path, size_t size,
                                     Range range) const {
  if (!node.IsSequence() || (size > 0 && node.size() != size)) {
    fail_at(node, path, (size > 0 ? "a list of " + std::to_string(size) : "a list of") + " numbers");
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
    // The bounds of int, so that the conversion below cannot overflow.
    range.min = std::max(range.min, static_cast<double>(std::numeric_limits<int>::min()));
    range.max = std::min(range.max, static_cast<double>(std::numeric_limits<int>::max()));
    const std::string expected = "a whole number" + bounds(range);
    const auto number = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (!number || !(*number >= range.min && *number <= range.max) || *number != std::floor(*number)) {
      fail_at(node, full_key(key), expected);
    }
    value = static_cast<int>(*number);
  }
  resolved_[std::string(key)] = value;
}

void Section::read(std::string_view key, double& value, Range range) {
  if (const auto node = find(key); node.IsDefined()) value = number(node, full_key(key), range);
  resolved_[std::string(key)] = value;
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
  YAML::Node list(YAML::NodeType::Sequence);
  for (double v : value) list.push_back(v);
  list.SetStyle(YAML::EmitterStyle::Flow);
  resolved_[std::string(key)] = list;
}

void Section::read(std::string_view key, std::optional<Rigid3>& value) {
  if (!has(key)) {
    find(key);
    if (value) resolved_[std::string(key)] = pose_node(*value);
    return;
  }
  Rigid3 pose;
  read(key, pose);
  value = pose;
}

void Section::read(std::string_view key, Rigid3& value) {
  const auto node = find(key);
  if (!node.IsDefined()) {
    resolved_[std::string(key)] = pose_node(value);
    return;
  }
  if (node.IsScalar() && node.Scalar() == "identity") {
    value = Rigid3{};
  } else if (node.IsMap()) {
    Section pose(document_, node, YAML::Node(YAML::NodeType::Map), full_key(key));
    std::vector<double> position{0, 0, 0};
    pose.read("position", position, 3);
    value.translation = Eigen::Map<const Eigen::Vector3d>(position.data());
    value.rotation.setIdentity();
    Section rotation = pose.section("rotation");
    std::vector<double> ypr{0, 0, 0};
    std::vector<double> wxyz{1, 0, 0, 0};
    if (rotation.has("ypr_deg") && rotation.has("quaternion_wxyz")) {
      rotation.fail("expected ypr_deg or quaternion_wxyz, found both");
    }
    rotation.read("ypr_deg", ypr, 3);
    rotation.read("quaternion_wxyz", wxyz, 4);
    rotation.done();
    pose.done();
    const Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
    // Written with three digits a unit quaternion is off by up to 1e-3; more is a slip.
    if (std::abs(q.norm() - 1) > 2e-3) rotation.fail("quaternion_wxyz", "a quaternion of length 1");
    value.rotation = rotation.has("ypr_deg")
                         ? rotation_from_ypr({ypr[0] * kRadFromDeg, ypr[1] * kRadFromDeg, ypr[2] * kRadFromDeg})
                         : q.normalized();
  } else {
    fail_at(node, full_key(key), "identity or {position: [x, y, z], rotation: {ypr_deg: [y, p, r]}}");
  }
  resolved_[std::string(key)] = pose_node(value);
}

void Section::read(std::string_view key, fs::path& value) {
  if (const auto node = find(key); node.IsDefined()) {
    if (!node.IsScalar() || node.Scalar().empty()) fail_at(node, full_key(key), "a path");
    value = resolve(key, node.Scalar());
  }
  resolved_[std::string(key)] = value.string();
}

fs::path Section::resolve(std::string_view key, const fs::path& path) const {
  if (path.is_absolute() || document_->from_command_line.contains(full_key(key))) return path;
  // Absolute, so that a resolved configuration means the same wherever it is kept.
  return fs::absolute(document_->file.parent_path() / path).lexically_normal();
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

Section Section::section(std::string_view key) {
  auto node = find(key);
  if (node.IsDefined() && !node.IsNull() && !node.IsMap()) fail_at(node, full_key(key), "a mapping");
  if (!node.IsDefined() || node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
  const std::string name(key);
  if (!resolved_[name].IsDefined()) resolved_[name] = YAML::Node(YAML::NodeType::Map);
  return Section(document_, node, resolved_[name], full_key(key));
}

std::vector<Section> Section::list(std::string_view key) {
  const auto node = find(key);
  std::vector<Section> sections;
  if (!node.IsDefined() || node.IsNull()) return sections;
  if (!node.IsSequence()) fail_at(node, full_key(key), "a list of mappings");
  YAML::Node resolved(YAML::NodeType::Sequence);
  for (size_t i = 0; i < node.size(); ++i) {
    const std::string path = full_key(key) + "[" + std::to_string(i) + "]";
    if (!node[i].IsMap()) fail_at(node[i], path, "a mapping");
    YAML::Node entry(YAML::NodeType::Map);
    resolved.push_back(entry);
    sections.push_back(Section(document_, node[i], entry, path));
  }
  resolved_[std::string(key)] = resolved;
  return sections;
}

void Section::done() const {
  if (!node_.IsMap()) return;
  for (const auto& entry : node_) {
    const std::string name = entry.first.Scalar();
    if (std::find(known_->begin(), known_->end(), name) != known_->end()) continue;
    const std::string path = full_key(name);
    std::vector<std::string> names = *known_;
    std::sort(names.begin(), names.end());
    std::string expected;
    for (const auto& known : names) expected += (expected.empty() ? "" : ", ") + known;
    throw ConfigError(place(entry.first, path) + ": " + path + ": expected one of " +
                      (expected.empty() ? "no keys" : expected) + ", found an unknown key");
  }
}

std::string Section::resolved() const {
  YAML::Emitter emitter;
  emitter.SetDoublePrecision(17);
  emitter << document_->resolved;
  return std::string(emitter.c_str()) + "\n";
}

const fs::path& Section::file() const { return document_->file; }

}  // namespace perch
