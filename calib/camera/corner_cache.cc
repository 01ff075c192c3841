#include "calib/camera/corner_cache.h"

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "perch/config/atomic_file.h"

namespace perch {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

// Of how corners are found: raised where they come out otherwise.
constexpr int kVersion = 1;

// What tells that a file is the one it was.
json stamp_of(const fs::path& file) {
  std::error_code error;
  const auto bytes = fs::file_size(file, error);
  const auto time = fs::last_write_time(file, error).time_since_epoch().count();
  return error ? json() : json::array({bytes, time});
}

json to_json(const FoundBoard& found) {
  json corners = json::array();
  for (const BoardCorner& c : found.sighting.corners) {
    corners.push_back({c.column, c.row, c.pixel.x(), c.pixel.y(), c.sigma});
  }
  return {{"size", {found.width, found.height}},
          {"blur_px", found.sighting.blur_px},
          {"problem", found.sighting.problem},
          {"corners", corners}};
}

// Throws json::exception where it is not as to_json has it; what it says is checked no less than a picture.
FoundBoard from_json(const json& entry, const std::string& picture) {
  FoundBoard found;
  found.picture = picture;
  found.width = entry.at("size").at(0).get<int>();
  found.height = entry.at("size").at(1).get<int>();
  found.sighting.blur_px = entry.at("blur_px").get<double>();
  found.sighting.problem = entry.at("problem").get<std::string>();
  for (const json& c : entry.at("corners")) {
    found.sighting.corners.push_back({c.at(0).get<int>(),
                                      c.at(1).get<int>(),
                                      {c.at(2).get<double>(), c.at(3).get<double>()},
                                      c.at(4).get<double>()});
  }
  return found;
}

}  // namespace

struct CornerCache::Folder {
  fs::path file;
  json content = json::object();
  std::string problem;
  bool changed = false;

  json& entries(const std::string& board) { return content["boards"][board]; }
};

CornerCache::CornerCache(const std::string& board_text) : board_(board_text) {}
CornerCache::~CornerCache() = default;

CornerCache::Folder& CornerCache::folder_of(const fs::path& file) {
  const fs::path name = file.parent_path() / kFileName;
  auto& folder = folders_[name];
  if (folder) return *folder;
  folder = std::make_unique<Folder>();
  folder->file = name;
  std::ifstream stream(name);
  if (!stream) return *folder;
  json content = json::parse(stream, nullptr, false);
  const bool usable = content.is_object() && content.contains("version") && content.contains("boards") &&
                      content["boards"].is_object();
  if (!usable) {
    folder->problem = name.string() + ": no cache of corners, ignored; it is written anew";
  } else if (content["version"] == kVersion) {
    folder->content = std::move(content);
  }
  return *folder;
}

std::optional<FoundBoard> CornerCache::find(const fs::path& file, const std::string& name) {
  const std::lock_guard lock(mutex_);
  Folder& folder = folder_of(file);
  try {
    const json& boards = folder.content.at("boards");
    const json& entry = boards.at(board_).at(fs::path(name).filename().string());
    if (entry.at("stamp") != stamp_of(file)) return std::nullopt;
    return from_json(entry, name);
  } catch (const json::exception&) {
    return std::nullopt;  // not there, or edited by someone: found anew
  }
}

void CornerCache::keep(const fs::path& file, const std::string& name, const FoundBoard& found) {
  const std::lock_guard lock(mutex_);
  Folder& folder = folder_of(file);
  folder.content["version"] = kVersion;
  json& entries = folder.entries(board_);
  if (!entries.is_object()) entries = json::object();
  json entry = to_json(found);
  entry["stamp"] = stamp_of(file);
  entries[fs::path(name).filename().string()] = std::move(entry);
  folder.changed = true;
}

std::vector<std::string> CornerCache::save() {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> problems;
  for (auto& [name, folder] : folders_) {
    if (!folder->problem.empty()) problems.push_back(folder->problem);
    folder->problem.clear();
    if (!folder->changed) continue;
    folder->changed = false;
    try {
      write_whole_file(folder->file, folder->content.dump() + '\n');
    } catch (const std::exception& e) {
      problems.push_back(std::string(e.what()) + "; the corners are found again the next time");
    }
  }
  return problems;
}

}  // namespace perch
