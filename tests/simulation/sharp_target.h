#pragma once

#include <vector>

#include "perch/target/landing_target.h"

namespace perch {

// The shapes of configs/targets/sharp.yaml with a side of 1 m, by hand: what is rendered is then known
// without the code that reads targets.
inline LandingTarget sharp_target() {
  constexpr double kModule = 0.05;
  const auto square = [](double column, double row, double side) {
    return square_corners({(column - 10) * kModule, (row - 10) * kModule}, side * kModule);
  };
  LandingTarget target;
  target.name = "sharp";
  target.size = 1;
  target.patches = {{square(0, 0, 20), true}, {square(3, 3, 14), false}, {square(10, 10, 5), true},
                    {square(5, 13, 2), true}, {square(5, 9, 2), true},   {square(5, 5, 2), true},
                    {square(9, 5, 2), true},  {square(13, 5, 2), true}};
  return target;
}

// A flat ground, no shadow: what differs from it is the target.
inline constexpr double kPlainGround = 0.2;

}  // namespace perch
