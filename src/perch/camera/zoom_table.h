#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"

namespace perch {

// Where the camera was calibrated.
struct ZoomEntry {
  double zoom = 0;  // as the camera tells it: a position, a magnification, in any unit
  CameraModel model;
};

// A zoom camera: its models at several zoom positions, and between them each parameter on a curve through
// those calibrated that rises and falls only where they do (Fritsch and Carlson 1980), the focal lengths'
// logarithms for focal lengths. All models are of one lens model and one size.
//
// Error: a focal length that is proportional to the zoom, calibrated at zooms a factor 2 apart, is off by up
// to 2 % between them, a factor 1.4 apart by 0.5 %. held_out_px() says what it is for a table.
class ZoomTable {
 public:
  // Throws std::invalid_argument: fewer than two entries, two at one zoom, other lens models or sizes.
  explicit ZoomTable(std::vector<ZoomEntry> entries);

  // Beyond the ends by up to a hundredth of the whole range, which is how an encoder rounds, the end's; empty
  // further away: nobody calibrated there.
  std::optional<CameraModel> at(double zoom) const;

  // How far off the table without an entry, not the first or last, puts what that entry's model sees: the
  // most over the picture, px, of each such entry in the order of their zooms. NaN where the lens shows
  // nothing.
  std::vector<double> held_out_px() const;

  const std::vector<ZoomEntry>& entries() const { return entries_; }

 private:
  std::vector<ZoomEntry> entries_;           // by zoom
  std::vector<std::vector<double>> values_;  // of each parameter at each entry
  std::vector<std::vector<double>> slopes_;  // of its curve there
};

// The file: {models: [{zoom: 1, model: zoom_1.cameramodel}, ...]}, paths relative to it. Throws ConfigError.
ZoomTable read_zoom_table(const std::filesystem::path& file);

// Adds a calibrated zoom to the file, or makes it; what is there at the same zoom is replaced. How many zooms
// it has then: one is no table yet. Throws ConfigError for a file that is no zoom table, std::runtime_error
// for one that cannot be written.
size_t add_to_zoom_table(const std::filesystem::path& file, double zoom, const std::filesystem::path& model);

}  // namespace perch
