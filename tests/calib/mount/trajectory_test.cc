#include "calib/mount/trajectory.h"

#include <gtest/gtest.h>

#include <cmath>

#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch {
namespace {

// RMS of the curve's place about the truth, m: 20 s at 100 Hz with 2 cm of noise. With `late` each twentieth
// sample comes so long before the next one, s, as where stamps are those of arrival.
double rms_error(double late) {
  TestRng rng;
  const auto truth = [](double t) { return Eigen::Vector3d(std::sin(t), std::cos(0.7 * t), 0.3 * t); };
  NavTrack nav;
  for (int i = 0; i < 2000; ++i) {
    const double t = 0.01 * (late > 0 && i % 20 == 10 ? i + 1 : i) - (late > 0 && i % 20 == 10 ? late : 0);
    NavSample sample;
    sample.timestamp_ns = std::llround(1e9 * t);
    sample.world_from_body = {so3_exp(rng.normal3(0.005)), truth(t) + rng.normal3(0.02)};
    nav.samples.push_back(sample);
  }
  const Trajectory trajectory(nav);
  double sum = 0;
  int count = 0;
  for (double t = 1; t < 19; t += 0.013, ++count)
    sum += (trajectory.at(std::llround(1e9 * t))->world_from_body.translation - truth(t)).squaredNorm();
  return std::sqrt(sum / count);
}

// One sample of twenty is lost at most.
TEST(Trajectory, TwoSamplesAlmostAtOnceDoNotBendIt) {
  const double even = rms_error(0);
  EXPECT_LT(even, 0.01);
  for (const double late : {5e-3, 2e-3, 1e-3, 1e-4, 3e-5, 1e-5, 1e-6}) EXPECT_LT(rms_error(late), 1.2 * even) << late;
}

}  // namespace
}  // namespace perch
