#include "perch/analysis/touch_down.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "support/rng.h"

namespace perch {
namespace {

// Down from 5 m at 0.5 m/s while going aside at 0.1 m/s, on legs of 0.2 m; then it stands.
struct Landing {
  std::vector<FrameRecord> frames;
  std::vector<std::optional<VehicleState>> states;
  static constexpr double kLegs = 0.2, kRate = 30;

  explicit Landing(double start = 5) {
    for (int i = 0; i < 15 * kRate; ++i) {
      const double t = i / kRate, fall = start - 0.5 * t;
      const bool stands = fall <= kLegs;
      const double stood_at = (start - kLegs) / 0.5;
      FrameRecord frame;
      frame.timestamp_ns = std::llround(1e9 * t);
      SixStates navigation = SixStates::Zero();
      navigation.head<3>() << 0.1 * std::min(t, stood_at), -0.3, std::max(fall, kLegs);
      frame.navigation = navigation;
      frames.push_back(frame);
      VehicleState state;
      state.timestamp_ns = frame.timestamp_ns;
      state.pad_from_body.translation = navigation.head<3>();
      if (!stands) state.body_velocity_in_pad = {0.1, 0, -0.5};
      state.source = StateSource::kVision;
      states.push_back(state);
    }
  }
};

TEST(TouchDown, IsWhereNavigationComesToStand) {
  const Landing landing;
  const auto touch_down = find_touch_down(landing.frames, landing.states);
  ASSERT_TRUE(touch_down);
  // 5 cm above the lowest, 9.5 s after the start; between two frames by interpolation, exact on a line.
  EXPECT_NEAR(touch_down->height, 0.25, 1e-9);
  EXPECT_NEAR(touch_down->time, 9.5, 1e-6);
  EXPECT_NEAR(touch_down->place.x(), 0.95, 1e-6);
  EXPECT_NEAR(touch_down->place.y(), -0.3, 1e-9);
}

TEST(TouchDown, AStraightDescentIsForetoldExactly) {
  const Landing landing;
  const auto touch_down = find_touch_down(landing.frames, landing.states);
  ASSERT_TRUE(touch_down);
  EXPECT_GT(touch_down->forecasts.size(), 200u);
  for (const TouchDownForecast& forecast : touch_down->forecasts) {
    EXPECT_NEAR(forecast.place_error, 0, 1e-6);
    EXPECT_NEAR(forecast.time_error, 0, 1e-6);
  }
}

TEST(TouchDown, AnErrorOfTheStateIsOneOfTheForecast) {
  Landing landing;
  for (auto& state : landing.states) {
    state->body_velocity_in_pad.y() += 0.2;       // aside: 0.2 m for each second to go
    state->pad_from_body.translation.z() += 0.1;  // 0.2 s later at 0.5 m/s
  }
  const auto touch_down = find_touch_down(landing.frames, landing.states);
  ASSERT_TRUE(touch_down);
  for (const TouchDownForecast& forecast : touch_down->forecasts) {
    // And 0.1 m/s for the 0.2 s.
    EXPECT_NEAR(forecast.place_error, std::hypot(0.2 * (forecast.to_go + 0.2), 0.1 * 0.2), 1e-6);
    EXPECT_NEAR(forecast.time_error, 0.2, 1e-6);
  }
  ASSERT_EQ(touch_down->bins.size(), 5u);
  EXPECT_EQ(touch_down->bins[0].to, 0.5);
  EXPECT_NEAR(touch_down->bins[0].time_mean, 0.2, 1e-6);
  EXPECT_LT(touch_down->bins[0].place_rms, touch_down->bins[4].place_rms);
}

TEST(TouchDown, NoneWithoutNavigationOrDescent) {
  Landing blind;
  for (FrameRecord& frame : blind.frames) frame.navigation.reset();
  EXPECT_FALSE(find_touch_down(blind.frames, blind.states));
  const Landing hop(0.6);  // 40 cm are none
  EXPECT_FALSE(find_touch_down(hop.frames, hop.states));
  EXPECT_FALSE(find_touch_down({}, {}));
}

TEST(TouchDown, StatesThatRiseOrAreLostForetellNothing) {
  Landing landing;
  for (size_t i = 0; i < landing.states.size(); ++i) {
    if (i % 2 == 0) landing.states[i]->source = StateSource::kLost;
    if (i % 2 == 1) landing.states[i]->body_velocity_in_pad.z() = 0.1;
  }
  const auto touch_down = find_touch_down(landing.frames, landing.states);
  ASSERT_TRUE(touch_down);
  EXPECT_TRUE(touch_down->forecasts.empty());
  EXPECT_TRUE(touch_down->bins.empty());
}

}  // namespace
}  // namespace perch
