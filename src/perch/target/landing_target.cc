#include "perch/target/landing_target.h"

#include "perch/target/layouts.h"

namespace perch {

LandingTarget read_target(const std::filesystem::path& file) { return read_target(Section::load(file)); }

LandingTarget read_target(Section section) {
  LandingTarget target;
  target.name = section.file().stem().string();
  section.read("name", target.name);
  auto read_layout = &read_squares;
  section.read_choice("type", read_layout, {{"squares", &read_squares}, {"apriltag", &read_apriltag}});
  read_layout(section, target);
  section.done();
  return target;
}

Bounds printed_bounds(const LandingTarget& target) {
  Bounds bounds{target.patches.front().corners[0], target.patches.front().corners[0]};
  for (const Patch& patch : target.patches) {
    for (const Eigen::Vector2d& corner : patch.corners) {
      bounds.lower_left = bounds.lower_left.cwiseMin(corner);
      bounds.upper_right = bounds.upper_right.cwiseMax(corner);
    }
  }
  return bounds;
}

}  // namespace perch
