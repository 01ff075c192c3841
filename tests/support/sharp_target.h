#pragma once

#include <string>

#include "perch/target/landing_target.h"

namespace perch {

// The paper's target with a side of 1 m, by hand: 20 modules of 5 cm, six white squares, 24 corners. Tests
// that use it do not depend on the code that reads targets.
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
  for (size_t i = 2; i < target.patches.size(); ++i) {
    const auto label = static_cast<char>('A' + static_cast<char>(i - 2));
    for (int k = 0; k < 4; ++k) {
      target.features.push_back(
          {target.patches[i].corners[static_cast<size_t>(k)], std::string(1, label) + std::to_string(k)});
    }
  }
  return target;
}

}  // namespace perch
