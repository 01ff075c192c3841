#pragma once

#include <Eigen/Core>
#include <vector>

#include "perch/camera/camera_model.h"

namespace perch {

// The directions in which the corners of a camera's pixels look, camera frame, of about unit length; NaN
// where the lens has none. `margin` more pixels on each side of the picture are included.
//
//   corner (0, 0) is the upper left one of pixel (-margin, -margin), at (-margin - 0.5, -margin - 0.5)
class RayGrid {
 public:
  RayGrid(const CameraModel& camera, int margin);

  int width() const { return width_; }  // pixels, both margins included
  int height() const { return height_; }
  int margin() const { return margin_; }

  // The width() + 1 corners above a row of pixels; row height() is the lowest.
  const Eigen::Vector3d* corners(int row) const {
    return rays_.data() + static_cast<ptrdiff_t>(row) * (width_ + 1);
  }

 private:
  int width_, height_, margin_;
  std::vector<Eigen::Vector3d> rays_;
};

}  // namespace perch
