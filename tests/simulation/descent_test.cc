#include "perch/simulation/descent.h"

#include <gmock/gmock.h>

#include <cmath>

#include "perch/geometry/euler.h"
#include "support/near_pose.h"

namespace perch {
namespace {

const Eigen::Vector3d kPad(12, -7, -0.4);

TEST(Descent, VelocityIsTheDerivativeOfPosition) {
  const Descent descent({}, kPad, 1);
  constexpr double h = 1e-4;
  for (double t = -0.4; t < 13.4; t += 0.0937) {
    const auto before = descent.at(t - h), at = descent.at(t), after = descent.at(t + h);
    const Eigen::Vector3d velocity =
        (after.world_from_body.translation - before.world_from_body.translation) / (2 * h);
    const Eigen::Vector3d acceleration =
        (after.body_velocity_in_world - before.body_velocity_in_world) / (2 * h);
    // h^2 / 6 times a third derivative of some 10 m/s^3, and rounding of 15 m over h. Where the descent
    // begins and ends the third derivative jumps, and the difference of first order in h shows: 1e-4 of some
    // 1 m/s^3.
    EXPECT_THAT(velocity, IsNearMatrix(at.body_velocity_in_world, 1e-7)) << t;
    EXPECT_THAT(acceleration, IsNearMatrix(at.body_acceleration_in_world, 1e-4)) << t;
  }
}

TEST(Descent, TiltsAsItsAccelerationAsks) {
  DescentOptions options;
  options.gust_attitude = 0;
  const Descent descent(options, kPad, 2);
  double steepest = 0;
  for (double t = 0; t < 13; t += 0.1) {
    const auto truth = descent.at(t);
    const Eigen::Vector3d thrust = truth.world_from_body.rotation * Eigen::Vector3d(0, 0, -1);
    const Eigen::Vector3d force = truth.body_acceleration_in_world - Eigen::Vector3d(0, 0, 9.80665);
    EXPECT_LE(thrust.cross(force.normalized()).norm(), 1e-12) << t;
    EXPECT_GT(thrust.dot(force), 0) << t;
    // The nose keeps its heading; leaning, it is the projection of the body's x axis.
    const Eigen::Vector3d nose = truth.world_from_body.rotation * Eigen::Vector3d(1, 0, 0);
    const double heading = options.start_bearing + M_PI + options.yaw_drift * t;
    EXPECT_NEAR(wrap_angle(std::atan2(nose.y(), nose.x()) - heading), 0, 1e-12) << t;
    steepest = std::max(steepest, std::acos(-thrust.z()));
  }
  EXPECT_GT(steepest, 0.005);  // it does lean
  EXPECT_LT(steepest, 0.3);    // as a landing vehicle does
}

TEST(Descent, GoesFromItsStartToOverThePadAndStays) {
  DescentOptions options;
  options.touchdown_aside = 0;
  options.gust_position = 0;
  const Descent descent(options, kPad, 3);
  const Eigen::Vector3d start = descent.at(0).world_from_body.translation - kPad;
  EXPECT_NEAR(start.z(), -options.start_height, 1e-12);
  EXPECT_NEAR(start.head<2>().norm(), options.start_aside, 1e-12);
  for (const double t : {12.0, 12.5, 13.0}) {
    EXPECT_THAT(descent.at(t).world_from_body.translation - kPad,
                IsNearMatrix(Eigen::Vector3d(0, 0, -options.touchdown_height), 1e-12));
    EXPECT_LE(descent.at(t).body_velocity_in_world.norm(), 1e-12);
  }
  double height = 1e9;
  for (double t = 0; t < 12; t += 0.05) {
    const double now = -(descent.at(t).world_from_body.translation - kPad).z();
    EXPECT_LT(now, height);  // down only, and never below its end
    EXPECT_GE(now, options.touchdown_height - 1e-12);
    height = now;
  }
}

TEST(Descent, GustsHaveTheirDeviation) {
  // Many flights at one moment: an ensemble is what a deviation is of.
  DescentOptions calm, options;
  calm.gust_position = 0;
  double square = 0;
  constexpr int kFlights = 1000;
  const Eigen::Vector3d quiet = Descent(calm, kPad, 0).at(5).world_from_body.translation;
  for (uint64_t seed = 0; seed < kFlights; ++seed) {
    square += (Descent(options, kPad, seed).at(5).world_from_body.translation - quiet).squaredNorm() / 3;
  }
  // 3000 numbers scatter by 1 / sqrt(2 * 3000) = 1.3 %; four of that.
  EXPECT_NEAR(std::sqrt(square / kFlights) / options.gust_position, 1, 0.052);
}

}  // namespace
}  // namespace perch
