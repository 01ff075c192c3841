#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "perch/config/error.h"
#include "perch/geometry/rigid3.h"

namespace perch {

// Closed bounds of a number; the defaults exclude only NaN and infinity.
struct Range {
  double min = std::numeric_limits<double>::lowest();
  double max = std::numeric_limits<double>::max();
};
inline constexpr Range kPositive{std::numeric_limits<double>::min(), std::numeric_limits<double>::max()};
inline constexpr Range kNotNegative{0, std::numeric_limits<double>::max()};
inline constexpr Range kFraction{0, 1};

// One mapping of a YAML file that is being read. `read` keeps the variable's value, the default, where the
// file has no such key, and throws ConfigError where it has a wrong one. Each value, read or default, is
// noted in `resolved()`, which is what --print-config prints. Whoever has read all keys of a section calls
// `done()`, which refuses the keys nobody asked for.
//
//   Section run = Section::load("run.yaml", {"detection.method=paper"});
//   Section detection = run.section("detection");
//   detection.read("min_component_px", options.min_component_px, Range{1, 10000});
//   detection.done();
//   run.done();
class Section {
 public:
  // Reads a file. `overrides` are key.path=value as --set takes them: they win over the file; their relative
  // paths are relative to the working directory.
  static Section load(const std::filesystem::path& file, const std::vector<std::string>& overrides = {});
  // The same of a text; `name` stands for the file in messages, and relative paths are relative to its
  // folder.
  static Section parse(const std::string& text, const std::filesystem::path& name,
                       const std::vector<std::string>& overrides = {});

  void read(std::string_view key, bool& value);
  void read(std::string_view key, int& value, Range range = {});
  void read(std::string_view key, double& value, Range range = {});
  void read(std::string_view key, std::string& value);
  // A list of numbers; `size` 0 takes any length.
  void read(std::string_view key, std::vector<double>& value, size_t size = 0, Range range = {});
  // {position: [x, y, z], rotation: {ypr_deg: [y, p, r]} | {quaternion_wxyz: [w, x, y, z]}}, or `identity`.
  void read(std::string_view key, Rigid3& value);
  void read(std::string_view key, std::optional<Rigid3>& value);
  // A path; a relative one is relative to the file (or, from --set, to the working directory).
  void read(std::string_view key, std::filesystem::path& value);
  // "scheme:rest", as camera.source has it; with one of `file_schemes` the rest is a path, taken as above.
  void read_source(std::string_view key, std::string& value,
                   std::initializer_list<std::string_view> file_schemes);
  // One of the names.
  template <typename Enum>
  void read_choice(std::string_view key, Enum& value,
                   std::initializer_list<std::pair<std::string_view, Enum>> choices) {
    std::vector<std::string_view> names;
    size_t chosen = 0;
    for (const auto& [name, choice] : choices) {
      if (choice == value) chosen = names.size();
      names.push_back(name);
    }
    value = std::next(choices.begin(), static_cast<std::ptrdiff_t>(choose(key, names, chosen)))->second;
  }

  // The mapping below `key`; an empty one where there is none.
  Section section(std::string_view key);
  // The mappings of the list below `key`; none where there is none.
  std::vector<Section> list(std::string_view key);
  // The keys of this mapping in their order, for mappings whose keys are names (a target's squares).
  std::vector<std::string> keys() const;
  bool has(std::string_view key) const;
  // Whether `key` is a mapping that has `inner`: for values that come in two shapes.
  bool is_mapping_with(std::string_view key, std::string_view inner) const;

  // For what a single key's type cannot say: throws "file:line: key: expected ..., found ...".
  [[noreturn]] void fail(std::string_view key, const std::string& expected) const;
  // The same where what is wrong is not the value itself: a square that overlaps another.
  [[noreturn]] void fail(std::string_view key, const std::string& expected, const std::string& found) const;
  // For what is wrong with the whole section: "file:line: section: what".
  [[noreturn]] void fail(const std::string& what) const;

  // Takes a relative path as this key's file means it.
  std::filesystem::path resolve(std::string_view key, const std::filesystem::path& path) const;

  // Refuses every key that was not read.
  void done() const;

  // The whole document with every default filled in, as YAML.
  std::string resolved() const;
  const std::filesystem::path& file() const;

 private:
  struct Document;
  Section(std::shared_ptr<Document> document, const YAML::Node& node, const YAML::Node& resolved,
          std::string path, int line);

  // The node of a key, marked as known; undefined where there is none.
  YAML::Node find(std::string_view key);
  std::string full_key(std::string_view key) const;
  int line_of(const YAML::Node& node, const std::string& path) const;
  std::string place(const YAML::Node& node, const std::string& path) const;
  [[noreturn]] void fail_at(const YAML::Node& node, const std::string& path,
                            const std::string& expected) const;
  size_t choose(std::string_view key, const std::vector<std::string_view>& names, size_t chosen);
  std::vector<double> numbers(const YAML::Node& node, const std::string& path, size_t size,
                              Range range) const;
  double number(const YAML::Node& node, const std::string& path, Range range) const;
  Rigid3 pose(const YAML::Node& node, const std::string& path) const;

  std::shared_ptr<Document> document_;
  YAML::Node node_;      // what the file says
  YAML::Node resolved_;  // with every default filled in
  std::string path_;     // "detection.paper", empty at the root
  int line_;             // of the mapping's key, or where a missing one would be; from 0
  std::shared_ptr<std::set<std::string>> known_;
};

}  // namespace perch
