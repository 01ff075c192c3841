#pragma once

#include <cstdint>
#include <optional>

#include "perch/camera/zoom_table.h"
#include "perch/ptz/head_control.h"

namespace perch {

// Which zoom lets the target fill its part of the picture (zoom_to_fill), told seldom: while a lens moves
// nobody knows what it shows. A zoom holds until the target gets too large or may leave the picture, and then
// gives room to come; it narrows by steps, each of which a prediction bridges.
class ZoomControl {
 public:
  // `radius`: of the target, m. `fill`: what the target may take of the picture's smaller side. Zooms are the
  // table's, which narrow as they grow.
  ZoomControl(const ZoomTable& table, double radius, double fill);

  // Where to zoom, from `zoom` on: at each picture. Without a sight of the target to the widest.
  double update(int64_t now_ns, const std::optional<HeadControl::Sight>& sight, double zoom);

 private:
  double zoom_for(double distance, double aside, double fill) const;

  ZoomTable table_;
  double widest_, narrowest_;
  double radius_, fill_;
  double aside_ = 0;  // the most of late, rad
  int64_t then_ns_ = 0;
};

}  // namespace perch
