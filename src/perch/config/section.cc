#include "perch/config/section.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>

#include "perch/config/strict_yaml.h"

namespace perch {

namespace fs = std::filesystem;

struct Section::Document {
  fs::path file;
  YAML::Node resolved;
  std::set<std::string> overridden;          // full keys that --set gave
  std::map<std::string, fs::path> included;  // files that stand for keys of the root

  // The key of the --set that gave `path` or what it lies in; empty when the file did.
  std::string override_of(std::string path) const {
    while (!path.empty() && !overridden.contains(path)) {
      const size_t end = path.find_last_of(".[");
      path.resize(end == std::string::npos ? 0 : end);
    }
    return path;
  }
};

Section::Section(std::shared_ptr<Document> document, const YAML::Node& node, const YAML::Node& resolved,
                 std::string path, int line)
    : document_(std::move(document)),
      node_(node),
      resolved_(resolved),
      path_(std::move(path)),
      line_(line),
      known_(std::make_shared<std::set<std::string>>()) {}

namespace {

std::string text_of(const fs::path& file, const std::string& who) {
  std::ifstream stream(file, std::ios::binary);
  std::error_code ignored;
  if (!stream || fs::is_directory(file, ignored)) {
    throw ConfigError(who + file.string() + ": expected a YAML file, found none that can be read");
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// `frames: !include mount.yaml` puts what another file says in the place of a key of the root, so that what a
// calibration wrote need not be copied. Relative to this file; what is included includes nothing itself.
std::map<std::string, fs::path> include_files(YAML::Node& root, const fs::path& name) {
  std::map<std::string, fs::path> included;
  for (auto entry : root) {
    if (entry.second.Tag() != "!include") continue;
    const std::string place = name.string() + ":" + std::to_string(entry.first.Mark().line + 1) + ": " +
                              entry.first.Scalar() + ": ";
    if (!entry.second.IsScalar()) throw ConfigError(place + "!include: expected the name of a file");
    const fs::path file = (name.parent_path() / entry.second.Scalar()).lexically_normal();
    included[entry.first.Scalar()] = file;
    root[entry.first.Scalar()] = strict_yaml(text_of(file, place), file);
  }
  return included;
}

}  // namespace

Section Section::load(const fs::path& file, const std::vector<std::string>& overrides) {
  return parse(text_of(file, ""), file, overrides);
}

Section Section::parse(const std::string& text, const fs::path& name,
                       const std::vector<std::string>& overrides) {
  auto document = std::make_shared<Document>();
  document->file = name;
  YAML::Node root = strict_yaml(text, name);
  if (root.IsNull()) root.reset(YAML::Node(YAML::NodeType::Map));
  if (!root.IsMap()) {
    throw ConfigError(name.string() + ":" + std::to_string(root.Mark().line + 1) +
                      ": expected a mapping, found " + found(root));
  }
  document->included = include_files(root, name);
  for (const auto& entry : overrides) document->overridden.insert(override_yaml(root, entry));
  document->resolved = YAML::Node(YAML::NodeType::Map);
  return Section(document, root, document->resolved, "", 0);
}

std::string Section::full_key(std::string_view key) const {
  return path_.empty() ? std::string(key) : path_ + "." + std::string(key);
}

int Section::line_of(const YAML::Node& node, const std::string& path) const {
  // The key's line where there is one: the mark of an empty value is that of what follows it.
  for (const auto& entry : node_) {
    if (full_key(entry.first.Scalar()) == path && !entry.first.Mark().is_null()) {
      return entry.first.Mark().line;
    }
  }
  return node.IsDefined() && !node.Mark().is_null() ? node.Mark().line : line_;
}

std::string Section::place(const YAML::Node& node, const std::string& path) const {
  if (const auto key = document_->override_of(path); !key.empty()) return "--set " + key;
  const auto included = document_->included.find(path.substr(0, path.find_first_of(".[")));
  const bool is_included = included != document_->included.end() && included->first != path;
  return (is_included ? included->second : document_->file).string() + ":" +
         std::to_string(line_of(node, path) + 1);
}

void Section::fail_at(const YAML::Node& node, const std::string& path, const std::string& expected) const {
  throw ConfigError(place(node, path) + ": " + path + ": expected " + expected + ", found " + found(node));
}

void Section::fail(std::string_view key, const std::string& expected) const {
  const YAML::Node& map = node_;
  fail_at(map[std::string(key)], full_key(key), expected);
}

void Section::fail(std::string_view key, const std::string& expected, const std::string& found) const {
  const YAML::Node& map = node_;
  const YAML::Node node = map.IsMap() ? map[std::string(key)] : YAML::Node(YAML::NodeType::Undefined);
  const std::string path = full_key(key);
  throw ConfigError(place(node, path) + ": " + path + ": expected " + expected + ", found " + found);
}

void Section::fail(const std::string& what) const {
  const auto key = document_->override_of(path_);
  const std::string where =
      key.empty() ? document_->file.string() + ":" + std::to_string(line_ + 1) : "--set " + key;
  throw ConfigError(where + (path_.empty() ? "" : ": " + path_) + ": " + what);
}

YAML::Node Section::find(std::string_view key) {
  known_->emplace(key);
  const YAML::Node& map = node_;
  return map[std::string(key)];
}

bool Section::has(std::string_view key) const {
  const YAML::Node& map = node_;
  return map[std::string(key)].IsDefined();
}

bool Section::is_mapping_with(std::string_view key, std::string_view inner) const {
  if (!has(key)) return false;
  const YAML::Node& map = node_;
  const YAML::Node value = map[std::string(key)];
  return value.IsMap() && value[std::string(inner)].IsDefined();
}

std::vector<std::string> Section::keys() const {
  std::vector<std::string> names;
  for (const auto& entry : node_) names.push_back(entry.first.Scalar());
  return names;
}

Section Section::section(std::string_view key) {
  const YAML::Node node = find(key);
  const std::string path = full_key(key);
  const bool missing = !node.IsDefined() || node.IsNull();
  if (!missing && !node.IsMap()) fail_at(node, path, "a mapping");
  const std::string name(key);
  if (!resolved_[name].IsDefined()) resolved_[name] = YAML::Node(YAML::NodeType::Map);
  return Section(document_, missing ? YAML::Node(YAML::NodeType::Map) : node, resolved_[name], path,
                 line_of(node, path));
}

std::vector<Section> Section::list(std::string_view key) {
  const YAML::Node node = find(key);
  std::vector<Section> sections;
  if (!node.IsDefined() || node.IsNull()) return sections;
  if (!node.IsSequence()) fail_at(node, full_key(key), "a list of mappings");
  // In its place before anything is put into it: yaml-cpp frees what a node gets that was moved into a tree
  // twice (entry into list, list into document) together with the caller's handle of it.
  resolved_[std::string(key)] = YAML::Node(YAML::NodeType::Sequence);
  YAML::Node resolved = resolved_[std::string(key)];
  for (size_t i = 0; i < node.size(); ++i) {
    const std::string path = full_key(key) + "[" + std::to_string(i) + "]";
    if (!node[i].IsMap()) fail_at(node[i], path, "a mapping");
    resolved.push_back(YAML::Node(YAML::NodeType::Map));
    sections.push_back(Section(document_, node[i], resolved[i], path, line_of(node[i], path)));
  }
  return sections;
}

fs::path Section::resolve(std::string_view key, const fs::path& path) const {
  // Absolute, so that a resolved configuration means the same wherever it is kept.
  const bool from_file = document_->override_of(full_key(key)).empty();
  return fs::absolute(from_file ? document_->file.parent_path() / path : path).lexically_normal();
}

void Section::done() const {
  for (const auto& entry : node_) {
    const std::string& name = entry.first.Scalar();
    if (known_->contains(name)) continue;
    std::string expected;
    for (const auto& known : *known_) expected += (expected.empty() ? "one of " : ", ") + known;
    throw ConfigError(place(entry.first, full_key(name)) + ": " + full_key(name) + ": expected " +
                      (expected.empty() ? "no keys" : expected) + ", found an unknown key");
  }
}

std::string Section::resolved() const {
  YAML::Emitter emitter;
  emitter << document_->resolved;
  return std::string(emitter.c_str()) + "\n";
}

const fs::path& Section::file() const { return document_->file; }

}  // namespace perch
