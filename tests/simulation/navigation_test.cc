#include "perch/simulation/navigation.h"

#include <gmock/gmock.h>

#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr int64_t kStart = 1700000000000000000;

TEST(Navigation, WithoutNoiseIsTheTruthOnItsOwnClock) {
  NavigationOptions options;
  options.position_white = options.position_drift = 0;
  options.attitude_white = options.attitude_drift = options.velocity_white = 0;
  options.time_offset = 0.123;
  const Descent descent({}, {12, -7, -0.4}, 1);
  const auto reports = navigate(descent, options, kStart, 1);
  ASSERT_GT(reports.size(), 600u);
  for (size_t i = 0; i < reports.size(); ++i) {
    // The camera's clock is ahead by the offset.
    const int64_t camera_ns = reports[i].timestamp_ns + 123000000;
    const auto truth = descent.at(static_cast<double>(camera_ns - kStart) * 1e-9);
    EXPECT_LE((reports[i].world_from_body.translation - truth.world_from_body.translation).norm(), 1e-12);
    EXPECT_LE(reports[i].world_from_body.rotation.angularDistance(truth.world_from_body.rotation), 1e-12);
    EXPECT_LE((reports[i].body_velocity_in_world - truth.body_velocity_in_world).norm(), 1e-12);
    if (i > 0) {
      EXPECT_EQ(reports[i].timestamp_ns - reports[i - 1].timestamp_ns, 20000000);
    }
  }
  // The first and the last picture lie between two reports.
  EXPECT_LT(reports.front().timestamp_ns + 123000000, kStart);
  EXPECT_GT(reports.back().timestamp_ns + 123000000, kStart + std::llround(descent.duration() * 1e9));
}

TEST(Navigation, ErrorsHaveTheirDeviations) {
  // An hour of hovering, so that the drift is seen many times over.
  DescentOptions hover;
  hover.hover = 3600;
  const Descent descent(hover, {0, 0, 0}, 1);
  NavigationOptions options;
  options.drift_correlation = 2;
  options.rate_hz = 10;
  double position = 0, attitude = 0, velocity = 0, step = 0;
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  const auto reports = navigate(descent, options, kStart, 4);
  for (const auto& report : reports) {
    const auto truth = descent.at(static_cast<double>(report.timestamp_ns - kStart) * 1e-9);
    const Eigen::Vector3d error = report.world_from_body.translation - truth.world_from_body.translation;
    position += error.squaredNorm();
    step += (error - last).squaredNorm();
    last = error;
    attitude +=
        so3_log(report.world_from_body.rotation * truth.world_from_body.rotation.conjugate()).squaredNorm();
    velocity += (report.body_velocity_in_world - truth.body_velocity_in_world).squaredNorm();
  }
  const double n = 3 * static_cast<double>(reports.size());
  // Some 3 * 900 independent drifts: a deviation scatters by 1.4 %; five of that.
  EXPECT_NEAR(std::sqrt(position / n), 0.02, 0.02 * 0.07);
  EXPECT_NEAR(std::sqrt(attitude / n), std::hypot(0.003, 0.005), 0.0058 * 0.07);
  EXPECT_NEAR(std::sqrt(velocity / n), 0.03, 0.03 * 0.01);  // 108000 independent ones: 0.2 %
  // From report to report: twice the white variance, and of the drift's 2 (1 - exp(-0.1 / 2)).
  const double expected = 2 * 1e-4 + 2 * (1 - std::exp(-0.05)) * 0.0173 * 0.0173;
  EXPECT_NEAR(step / n, expected, 0.03 * expected);
}

}  // namespace
}  // namespace perch
