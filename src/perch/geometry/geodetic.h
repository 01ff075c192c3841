#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace perch {

// A place by WGS84.
struct Geodetic {
  double latitude = 0;   // rad, north
  double longitude = 0;  // rad, east
  double height = 0;     // above the ellipsoid, m
};

// Axes with x north, y east, z down at an origin: a plane that touches the ellipsoid there. What is d away
// lies d^2 / (2 R) below it: 8 cm at 1 km.
class LocalFrame {
 public:
  explicit LocalFrame(const Geodetic& origin);

  // m. Exact: by way of earth-centred coordinates, which a place gives in closed form.
  Eigen::Vector3d ned(const Geodetic& place) const;

  const Geodetic& origin() const { return origin_; }

 private:
  Geodetic origin_;
  Eigen::Vector3d origin_in_earth_;
  Eigen::Matrix3d ned_from_earth_;
};

}  // namespace perch
