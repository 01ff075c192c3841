#pragma once

#include <string>

#include "perch/target/landing_target.h"

namespace perch {

// The paper's target with a side of 1 m, by hand: 20 modules of 5 cm, six white squares, 24 corners. Tests
// that use it do not depend on the code that reads targets.
inline LandingTarget sharp_target() {
  constexpr double kModule = 0.05;
  const auto at = [](double column, double row) {
    return Eigen::Vector2d((column - 10) * kModule, (row - 10) * kModule);
  };
  SquaresLayout layout;
  layout.border = 3 * kModule;
  layout.squares = {{"A", at(10, 10), 5 * kModule}, {"B", at(5, 13), 2 * kModule},
                    {"C", at(5, 9), 2 * kModule},   {"D", at(5, 5), 2 * kModule},
                    {"E", at(9, 5), 2 * kModule},   {"F", at(13, 5), 2 * kModule}};
  LandingTarget target;
  target.name = "sharp";
  target.size = 1;
  target.patches = {{square_corners(at(0, 0), 20 * kModule), true},
                    {square_corners(at(3, 3), 14 * kModule), false}};
  for (const auto& square : layout.squares) {
    const Quad corners = square_corners(square.lower_left, square.side);
    target.patches.push_back({corners, true});
    for (size_t k = 0; k < 4; ++k) target.features.push_back({corners[k], square.label + std::to_string(k)});
  }
  target.layout = layout;
  return target;
}

// The same with a second one inside square A, as configs/targets/nested.yaml has it: a hole of 3.2 modules
// and in it an inner target whose border is 2.6 modules wide.
inline LandingTarget nested_target() {
  LandingTarget target = sharp_target();
  target.name = "nested";
  constexpr double kModule = 0.05;
  const Eigen::Vector2d centre = Eigen::Vector2d::Constant(2.5 * kModule);  // of A: modules 12.5, 12.5
  const auto around = [&](double side) {
    return square_corners(centre - Eigen::Vector2d::Constant(side / 2), side);
  };
  const double scale = 2.6 * kModule;
  const LandingTarget inner = sharp_target();
  target.patches.push_back({around(3.2 * kModule), false});
  for (auto patch : inner.patches) {
    for (auto& corner : patch.corners) corner = centre + scale * corner;
    target.patches.push_back(patch);
  }
  for (const auto& feature : inner.features) {
    std::string name = feature.name;
    name[0] = static_cast<char>(name[0] - 'A' + 'a');
    target.features.push_back({centre + scale * feature.point, name});
  }
  std::get<SquaresLayout>(target.layout).nested = Nested{"A", centre, 3.2 * kModule, scale};
  return target;
}

}  // namespace perch
