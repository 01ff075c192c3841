#include "perch/ptz/zoom_control.h"

#include <gtest/gtest.h>

#include <cmath>

namespace perch {
namespace {

constexpr double kDeg = 0.017453292519943295;
constexpr double kRadius = 0.7;  // m

CameraModel lens(double zoom) {
  const double f = 320 / std::tan(24.4 * kDeg) * std::pow(12, zoom);
  return CameraModel::pinhole(f, f, 319.5, 239.5, 640, 480);
}
ZoomTable table() { return ZoomTable({{0, lens(0)}, {0.5, lens(0.5)}, {1, lens(1)}}); }

// Of half the picture's smaller side, what lies so far off the middle.
double part(double zoom, double angle) { return lens(zoom).intrinsics()[0] * std::tan(angle) / 240; }

// The zoom follows at the EVI-D30's speed, the sight is that of a vehicle that comes down at 1 m/s from 20 m
// to 6.
TEST(ZoomControl, FillsThePictureOnTheWayDownWithoutLosingTheTarget) {
  ZoomControl control(table(), kRadius, 0.6);
  double told = 0, zoom = 0;
  int moves = 0;
  double filled = 0;
  for (int i = 0; i < 14 * 30; ++i) {
    const double t = i / 30.0;
    const double swing = 3 * kDeg * std::abs(std::sin(2 * M_PI * t / 3));
    const double distance = 20 - t;
    const double goal =
        control.update(static_cast<int64_t>(t * 1e9), HeadControl::Sight{distance, 1, swing}, told);
    moves += goal != told;
    told = goal;
    zoom += std::clamp(told - zoom, -1 / 2.2 / 30, 1 / 2.2 / 30);
    const double angle = std::atan(kRadius / distance);
    EXPECT_LE(part(zoom, angle + swing), 1) << t;
    EXPECT_LE(part(zoom, angle), 0.6 * 1.02) << t;
    if (t > 3) filled += part(zoom, angle) / (11 * 30);
  }
  EXPECT_GT(filled, 0.3);
  EXPECT_LT(moves, 14);  // a lens that always moves shows nothing that can be measured
}

TEST(ZoomControl, ARestlessTargetNeedsRoom) {
  ZoomControl calm(table(), kRadius, 0.6), restless(table(), kRadius, 0.6);
  double calm_zoom = 0, restless_zoom = 0;
  for (int64_t t = 0; t < 5'000'000'000; t += 33'000'000) {
    calm_zoom = calm.update(t, HeadControl::Sight{15, 0, 1 * kDeg}, calm_zoom);
    restless_zoom = restless.update(t, HeadControl::Sight{15, 0, 8 * kDeg}, restless_zoom);
  }
  EXPECT_GT(calm_zoom, restless_zoom + 0.1);
  // What swung just now swings again.
  const double before = restless_zoom;
  EXPECT_EQ(restless.update(5'300'000'000, HeadControl::Sight{15, 0, 0}, restless_zoom), before);
}

TEST(ZoomControl, OfALostTargetTheWidest) {
  ZoomControl control(table(), kRadius, 0.6);
  EXPECT_EQ(control.update(0, std::nullopt, 0.7), 0);
}

}  // namespace
}  // namespace perch
