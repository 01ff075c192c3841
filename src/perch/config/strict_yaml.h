#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <set>
#include <string>

#include "perch/config/error.h"

namespace perch {

// Reads one YAML document and refuses, with file and line, what YAML allows but an edited file only has by
// mistake, or what would be dropped in silence: bytes that are not UTF-8 text, a second document, a key given
// twice or that is no plain name, anchors and aliases (which can make a small file endless), and mappings
// nested out of all measure. Throws ConfigError.
YAML::Node strict_yaml(const std::string& text, const std::filesystem::path& file);

// Puts the value of `key.path=value`, as --set gives it, in its place below `root`, which is
// a handle of the tree: const does not protect it. Returns the key path.
std::string override_yaml(const YAML::Node& root, const std::string& key_path_equals_value);

// What is there, short enough for one line: "a mapping", "a list of 3", "nothing", or the text in quotes.
std::string found(const YAML::Node& node);

}  // namespace perch
