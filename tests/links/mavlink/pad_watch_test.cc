#include "perch/links/mavlink/pad_watch.h"

#include <gtest/gtest.h>

namespace perch::mavlink {
namespace {

constexpr int64_t kMs = 1'000'000;

std::optional<VehicleState> state(StateSource source) {
  VehicleState s;
  s.source = source;
  return s;
}

TEST(PadWatch, SearchesUntilAPoseIsThere) {
  PadWatch watch(1);
  EXPECT_EQ(watch.at(0), PadState::kSearch);
  watch.see(std::nullopt, 5 * kMs);
  EXPECT_EQ(watch.at(100'000 * kMs), PadState::kSearch);
  watch.see(state(StateSource::kVision), 100'000 * kMs);
  EXPECT_EQ(watch.at(100'000 * kMs), PadState::kTrack);
}

TEST(PadWatch, FollowsTheFilter) {
  PadWatch watch(1);
  watch.see(state(StateSource::kVision), 1000 * kMs);
  watch.see(state(StateSource::kPredicted), 1033 * kMs);
  EXPECT_EQ(watch.at(1033 * kMs), PadState::kCoast);
  watch.see(state(StateSource::kVision), 1066 * kMs);
  EXPECT_EQ(watch.at(1066 * kMs), PadState::kTrack);
  watch.see(state(StateSource::kLost), 3000 * kMs);
  EXPECT_EQ(watch.at(3000 * kMs), PadState::kLost);
  EXPECT_EQ(watch.at(900'000 * kMs), PadState::kLost);
  watch.see(state(StateSource::kVision), 900'000 * kMs);
  EXPECT_EQ(watch.at(900'000 * kMs), PadState::kTrack);
}

TEST(PadWatch, ACameraThatStopsIsNoticedWithoutItsFrames) {
  PadWatch watch(1);
  watch.see(state(StateSource::kVision), 1000 * kMs);
  EXPECT_EQ(watch.at(1199 * kMs), PadState::kTrack);
  EXPECT_EQ(watch.at(1201 * kMs), PadState::kCoast);
  EXPECT_EQ(watch.at(2199 * kMs), PadState::kCoast);
  EXPECT_EQ(watch.at(2201 * kMs), PadState::kLost);
  watch.see(state(StateSource::kVision), 2300 * kMs);
  EXPECT_EQ(watch.at(2300 * kMs), PadState::kTrack);
}

}  // namespace
}  // namespace perch::mavlink
