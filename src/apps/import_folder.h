#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "perch/flight/nav_track.h"

namespace perch {

// A flight that is being imported: FLIGHT.part until it is whole, gone if it does not become so.
class ImportFolder {
 public:
  // Throws UsageError when there is a FLIGHT already, std::runtime_error when the folder cannot be made.
  explicit ImportFolder(const std::filesystem::path& flight);
  ~ImportFolder();
  ImportFolder(const ImportFolder&) = delete;
  ImportFolder& operator=(const ImportFolder&) = delete;

  const std::filesystem::path& path() const { return part_; }
  std::filesystem::path cam0() const { return part_ / "mav0" / "cam0"; }

  // Each throws std::runtime_error.
  void link_video(const std::filesystem::path& video, const std::vector<int64_t>& times_ns, bool copy) const;
  // Of another flight: its pictures and its camera.
  void link_pictures(const std::filesystem::path& flight, bool copy) const;
  void write_camera(const std::filesystem::path& model) const;
  // `add_ns` to each time brings it onto the camera's clock.
  void write_nav(const NavTrack& nav, int64_t add_ns) const;
  void finish();

 private:
  std::filesystem::path flight_, part_;
};

}  // namespace perch
