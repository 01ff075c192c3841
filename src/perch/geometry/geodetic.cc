#include "perch/geometry/geodetic.h"

#include <cmath>

namespace perch {
namespace {

constexpr double kSemiMajor = 6378137.0;           // m
constexpr double kFlattening = 1 / 298.257223563;  // of WGS84
constexpr double kEccentricity2 = kFlattening * (2 - kFlattening);

Eigen::Vector3d earth_from(const Geodetic& place) {
  const double s = std::sin(place.latitude), c = std::cos(place.latitude);
  const double normal = kSemiMajor / std::sqrt(1 - kEccentricity2 * s * s);  // length down to the axis, m
  return {(normal + place.height) * c * std::cos(place.longitude),
          (normal + place.height) * c * std::sin(place.longitude),
          (normal * (1 - kEccentricity2) + place.height) * s};
}

}  // namespace

LocalFrame::LocalFrame(const Geodetic& origin) : origin_(origin), origin_in_earth_(earth_from(origin)) {
  const double sp = std::sin(origin.latitude), cp = std::cos(origin.latitude);
  const double sl = std::sin(origin.longitude), cl = std::cos(origin.longitude);
  ned_from_earth_ << -sp * cl, -sp * sl, cp,  // north
      -sl, cl, 0,                             // east
      -cp * cl, -cp * sl, -sp;                // down
}

Eigen::Vector3d LocalFrame::ned(const Geodetic& place) const {
  return ned_from_earth_ * (earth_from(place) - origin_in_earth_);
}

}  // namespace perch
