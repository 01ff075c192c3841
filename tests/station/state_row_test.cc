#include "perch/station/state_row.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch {
namespace {

using testing::Each;
using testing::Eq;
using testing::IsNan;

// What is sent are floats: half a unit in the last of their 24 binary digits.
MATCHER_P(IsFloatOf, expected, "") { return std::abs(double{arg} - (expected)) <= 6e-8 * std::abs(expected); }

std::vector<float> part(const StateRow& row, size_t first, size_t count) {
  return {row.values.begin() + static_cast<std::ptrdiff_t>(first),
          row.values.begin() + static_cast<std::ptrdiff_t>(first + count)};
}

Estimate seen() {
  Estimate e;
  e.timestamp_ns = 1'234'567'890'123'456'789;
  e.status = EstimateStatus::kOk;
  e.camera_from_target.mean = {Eigen::Quaterniond(-0.1, 0.7, 0.5, 0.5).normalized(), {0.1, -0.2, 4.5}};
  e.reprojection_rms_px = 0.125;
  e.features = 25;
  e.ambiguity = 0.0625;
  e.total_us = 1500;
  VehicleState& s = e.state.emplace();
  s.source = StateSource::kVision;
  s.pad_from_body = {rotation_from_ypr({3, -0.2, 0.1}), {1, -2, 4}};
  s.body_velocity_in_pad = {0.1, 0.2, -0.5};
  s.body_angular_velocity_in_pad = {0.01, -0.02, 0.03};
  s.covariance.diagonal().head<3>() << 1e-4, 4e-4, 9e-4;
  return e;
}

TEST(StateRow, HoldsTheStateInMetresAndDegrees) {
  const StateRow row = state_row(seen(), {}, {}, 12.5);
  EXPECT_EQ(row.timestamp_ns, 1'234'567'890'123'456'789);
  EXPECT_EQ(row.status, 0);
  EXPECT_EQ(row.source, 1);
  EXPECT_THAT(part(row, StateRow::kState, 6),
              testing::ElementsAre(1, -2, 4, IsFloatOf(3 * kDegFromRad), IsFloatOf(-0.2 * kDegFromRad),
                                   IsFloatOf(0.1 * kDegFromRad)));
  EXPECT_THAT(part(row, StateRow::kSigma, 3),
              testing::ElementsAre(IsFloatOf(0.01), IsFloatOf(0.02), IsFloatOf(0.03)));
  EXPECT_THAT(part(row, StateRow::kVelocity, 6),
              testing::ElementsAre(IsFloatOf(0.1), IsFloatOf(0.2), -0.5F, IsFloatOf(0.01 * kDegFromRad),
                                   IsFloatOf(-0.02 * kDegFromRad), IsFloatOf(0.03 * kDegFromRad)));
  // A quaternion and its negative turn alike; the files have that with positive w.
  const Eigen::Quaterniond q = Eigen::Quaterniond(0.1, -0.7, -0.5, -0.5).normalized();
  EXPECT_THAT(part(row, StateRow::kCamera, 7),
              testing::ElementsAre(IsFloatOf(0.1), IsFloatOf(-0.2), 4.5F, IsFloatOf(q.w()), IsFloatOf(q.x()),
                                   IsFloatOf(q.y()), IsFloatOf(q.z())));
  EXPECT_EQ(row.values[StateRow::kReprojection], 0.125F);
  EXPECT_EQ(row.values[StateRow::kFeatures], 25);
  EXPECT_EQ(row.values[StateRow::kAmbiguity], 0.0625F);
  EXPECT_EQ(row.values[StateRow::kEstimate], 1.5F);
  EXPECT_EQ(row.values[StateRow::kLatency], 12.5F);
}

TEST(StateRow, SaysNotANumberOfWhatIsNotKnown) {
  Estimate e;  // no target, and none before
  StateRow row = state_row(e, {}, {}, {});
  EXPECT_EQ(row.status, static_cast<int>(EstimateStatus::kNoTarget));
  EXPECT_EQ(row.source, 0);
  EXPECT_EQ(row.values[StateRow::kFeatures], 0);
  EXPECT_EQ(row.values[StateRow::kEstimate], 0);
  row.values[StateRow::kFeatures] = row.values[StateRow::kEstimate] = NAN;
  EXPECT_THAT(row.values, Each(IsNan()));

  // Predicted: a state, but no pose of this frame.
  e = seen();
  e.status = EstimateStatus::kNoTarget;
  e.state->source = StateSource::kPredicted;
  row = state_row(e, {}, {}, {});
  EXPECT_EQ(row.source, 2);
  EXPECT_EQ(row.values[StateRow::kState], 1);
  EXPECT_THAT(part(row, StateRow::kCamera, 8), Each(IsNan()));

  // Lost: what the filter still holds is no place of the vehicle.
  e.state->source = StateSource::kLost;
  row = state_row(e, {}, {}, {});
  EXPECT_EQ(row.source, 3);
  EXPECT_THAT(part(row, StateRow::kState, 18), Each(IsNan()));
}

TEST(StateRow, HoldsNavigationsPoseAndTheHead) {
  Estimator::Aid aid;
  aid.angles = HeadAngles{0.5, -0.25};
  aid.zoom = 0.75;
  const StateRow row =
      state_row(Estimate{}, aid, Rigid3{rotation_from_ypr({-1, 0.5, 0.25}), {7, 8, 9}}, std::nullopt);
  EXPECT_THAT(part(row, StateRow::kNavigation, 6),
              testing::ElementsAre(7, 8, 9, IsFloatOf(-kDegFromRad), IsFloatOf(0.5 * kDegFromRad),
                                   IsFloatOf(0.25 * kDegFromRad)));
  EXPECT_THAT(part(row, StateRow::kPan, 3),
              testing::ElementsAre(IsFloatOf(0.5 * kDegFromRad), IsFloatOf(-0.25 * kDegFromRad), 0.75F));
}

// The covariance is of a rotation vector in the pad's axes, truth = Exp(r) R; the page shows angles. Their
// sigmas by differences: r = 1e-6 rad, whose square is nothing beside it; 1e-4 of the value remains for
// floats and differences.
TEST(StateRow, TurnsTheCovarianceOfTheRotationIntoSigmasOfTheAngles) {
  TestRng rng;
  for (int i = 0; i < 50; ++i) {
    Estimate e = seen();
    VehicleState& s = *e.state;
    const YawPitchRoll angles{rng.uniform(-3, 3), rng.uniform(-1.2, 1.2), rng.uniform(-3, 3)};
    s.pad_from_body.rotation = rotation_from_ypr(angles);
    Eigen::Matrix3d root;
    for (int k = 0; k < 9; ++k) root(k) = rng.uniform(-0.01, 0.01);
    const Eigen::Matrix3d covariance = root * root.transpose();
    s.covariance.block<3, 3>(3, 3) = covariance;
    constexpr double kStep = 1e-6;
    Eigen::Matrix3d J;
    for (int k = 0; k < 3; ++k) {
      const YawPitchRoll moved =
          ypr_from_rotation(so3_exp(kStep * Eigen::Vector3d::Unit(k)) * s.pad_from_body.rotation);
      J.col(k) << wrap_angle(moved.yaw - angles.yaw), moved.pitch - angles.pitch,
          wrap_angle(moved.roll - angles.roll);
    }
    J /= kStep;
    const Eigen::Vector3d expected = kDegFromRad * (J * covariance * J.transpose()).diagonal().cwiseSqrt();
    const StateRow row = state_row(e, {}, {}, {});
    for (size_t k = 0; k < 3; ++k) {
      const double value = expected[static_cast<Eigen::Index>(k)];
      EXPECT_NEAR(row.values[StateRow::kSigma + 3 + k], value, 1e-4 * value) << i << " " << k;
    }
  }
}

TEST(StateRow, IsAsManyLittleEndianBytesAsItsLayoutSays) {
  StateRow row;
  row.sequence = 0x01020304;
  row.timestamp_ns = -2;
  row.status = 5;
  row.source = 3;
  for (size_t i = 0; i < row.values.size(); ++i) row.values[i] = static_cast<float>(i) + 0.5F;
  std::vector<uint8_t> bytes{9};  // it appends
  append_row(row, bytes);
  ASSERT_EQ(bytes.size(), 1 + kStateRowBytes);
  const std::vector<uint8_t> head(bytes.begin() + 1, bytes.begin() + 17);
  EXPECT_THAT(head,
              testing::ElementsAre(4, 3, 2, 1, 5, 3, 0, 0, 0xfe, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff));
  float last = 0;
  std::memcpy(&last, bytes.data() + bytes.size() - 4, 4);
  EXPECT_EQ(last, row.values.back());
  EXPECT_EQ(kStateRowColumns[StateRow::kZoom], "zoom");
}

}  // namespace
}  // namespace perch
