#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "calib/camera/board_finder.h"

namespace perch {

// What a picture showed of the board.
struct FoundBoard {
  std::string picture;
  int width = 0, height = 0;  // px; 0: unreadable
  BoardSighting sighting;
};

// Corners found before, in a file perch-corners.json beside the pictures: finding takes some hundred times as
// long as reading it. An entry holds for a file of the same length and time and for the same board. A cache
// that cannot be read or written is no loss but time, and is said. May be used from several threads.
class CornerCache {
 public:
  explicit CornerCache(const std::string& board_text);
  ~CornerCache();

  // `name`: of the picture, or "video.mkv#17" of a frame in `file`.
  std::optional<FoundBoard> find(const std::filesystem::path& file, const std::string& name);
  void keep(const std::filesystem::path& file, const std::string& name, const FoundBoard& found);
  // Writes what is new. Returns what was wrong with any file, at reading or now.
  std::vector<std::string> save();

  static constexpr const char* kFileName = "perch-corners.json";

 private:
  struct Folder;
  Folder& folder_of(const std::filesystem::path& file);

  std::string board_;
  std::mutex mutex_;
  std::map<std::filesystem::path, std::unique_ptr<Folder>> folders_;
};

}  // namespace perch
