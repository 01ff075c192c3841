#include "perch/analysis/error_curves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "analysis/flights.h"

namespace perch {
namespace {

FrameRecord frame_with(double error, double speed) {
  FrameRecord frame;
  frame.range = 2;
  frame.speed = speed;
  frame.error = FrameError{};
  frame.error->position = error;
  return frame;
}

const ErrorCurve& by(const std::vector<ErrorCurve>& curves, const std::string& what) {
  for (const ErrorCurve& curve : curves) {
    if (curve.by == what) return curve;
  }
  throw std::runtime_error("no curve by " + what);
}

TEST(ErrorCurves, PutEachFrameIntoTheBinOfItsValue) {
  std::vector<FrameRecord> frames;
  for (int i = 0; i < 90; ++i) frames.push_back(frame_with(0.1 * (i / 30 + 1), i / 30 + 0.5));
  const auto curves = error_curves(frames, false);
  const ErrorCurve& speed = by(curves, "speed");
  size_t count = 0;
  for (const ErrorBin& bin : speed.bins) {
    count += bin.count;
    if (bin.count > 0) {
      EXPECT_NEAR(bin.position_rms, 0.1 * (std::floor(bin.from) + 1), 1e-12);
    }
  }
  EXPECT_EQ(count, 90u);
  EXPECT_EQ(by(curves, "distance").bins.size(), 1u);
  // Nobody knows it of any frame.
  EXPECT_TRUE(by(curves, "visible").bins.empty());
  EXPECT_TRUE(by(curves, "view_angle").bins.empty());
}

TEST(ErrorCurves, TheViewAngleIsThatOfTheTargetsNormal) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 3}, rng);
  for (Estimate& estimate : result.estimates) {
    // 3 m above the target and 3 m aside: seen from 45 degrees, whatever way the camera is turned.
    const Rigid3 target_from_camera{rng.rotation(), {0, 3, 3}};
    estimate.camera_from_target.mean = inverse(target_from_camera);
  }
  const ErrorCurve angle = by(score_flight(result).curves, "view_angle");
  ASSERT_EQ(angle.bins.size(), 1u);
  EXPECT_LE(angle.bins[0].from, 45 * kRadFromDeg + 1e-9);
  EXPECT_GT(angle.bins[0].to, 45 * kRadFromDeg - 1e-9);
}

TEST(ErrorCurves, GoByTheTruthWhereItIsAskedFor) {
  std::vector<FrameRecord> frames(5, frame_with(0.3, 1));
  for (FrameRecord& frame : frames) frame.truth_error = frame_with(0.1, 1).error;
  EXPECT_NEAR(by(error_curves(frames, false), "speed").bins[0].position_rms, 0.3, 1e-12);
  EXPECT_NEAR(by(error_curves(frames, true), "speed").bins[0].position_rms, 0.1, 1e-12);
}

}  // namespace
}  // namespace perch
