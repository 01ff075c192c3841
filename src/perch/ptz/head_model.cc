#include "perch/ptz/head_model.h"

#include "perch/geometry/euler.h"

namespace perch {

HeadModel evi_d30() {
  constexpr double kDeg = kRadFromDeg;
  return {{-100 * kDeg, 100 * kDeg, 80 * kDeg, 80 * kDeg / 24, kDeg / 8.8},
          {-25 * kDeg, 25 * kDeg, 50 * kDeg, 50 * kDeg / 20, kDeg / 12}};
}

}  // namespace perch
