// What a head is told, by what it says of itself.

#include "live_head.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr int64_t kMs = 1'000'000;

// Says where it is while it is asked to, and remembers what it was told.
class ToldHead : public PtzCamera {
 public:
  void point(const HeadGoal& goal) override { told.push_back(goal); }
  void zoom_to(double zoom) override { zooms.push_back(zoom); }
  std::optional<HeadAngles> at(int64_t) const override { return angles; }
  std::optional<double> zoom() const override { return zooms.empty() ? 0 : zooms.back(); }
  HeadModel model() const override { return evi_d30(); }
  bool ready() const override { return true; }

  std::optional<HeadAngles> angles = HeadAngles{};
  std::vector<HeadGoal> told;
  std::vector<double> zooms;
};

class LiveHeadTest : public testing::Test {
 protected:
  LiveHead head(const char* ptz) {
    RunConfig config;
    config.target = sharp_target();
    config.frames.pan_tilt = PanTilt{};
    config.frames.body_from_base = Rigid3{};
    const auto options = read_ptz_options(Section::parse(ptz, "run.yaml"));
    return {*options, config, config.frames, CameraModel::pinhole(300, 300, 159.5, 119.5, 320, 240),
            evi_d30()};
  }
  // A picture in which nothing is seen, 33 ms after the last.
  void steer(LiveHead& live) {
    now_ns_ += 33 * kMs;
    live.steer(now_ns_, {}, {}, {}, camera_);
  }
  bool stands(const HeadGoal& goal) const {
    return goal.kind == HeadGoal::Kind::kDrive && goal.pan == 0 && goal.tilt == 0;
  }

  ToldHead camera_;
  int64_t now_ns_ = 1000 * kMs;
};

constexpr char kFollows[] = "{device: 'visca+serial:/dev/null:9600'}";

TEST_F(LiveHeadTest, IsStoppedAFifthOfASecondAfterItLastSaidWhereItIs) {
  LiveHead live = head(kFollows);
  for (int i = 0; i < 30; ++i) steer(live);
  ASSERT_FALSE(camera_.told.empty());
  EXPECT_EQ(live.status(now_ns_, camera_)["doing"], "searches");
  EXPECT_FALSE(stands(camera_.told.back()));

  camera_.told.clear();
  camera_.angles.reset();
  const int64_t blind_ns = now_ns_ + 33 * kMs;
  while (now_ns_ + 33 * kMs <= blind_ns + 200 * kMs) steer(live);
  EXPECT_TRUE(camera_.told.empty());  // a gap of a line that garbles
  EXPECT_EQ(live.status(now_ns_, camera_)["doing"], "blind");
  steer(live);
  ASSERT_EQ(camera_.told.size(), 1u);
  EXPECT_TRUE(stands(camera_.told.back()));

  // It goes on when it says so again, and a second gap has its fifth of a second, too.
  camera_.angles = HeadAngles{};
  steer(live);
  EXPECT_EQ(live.status(now_ns_, camera_)["doing"], "searches");
  camera_.told.clear();
  camera_.angles.reset();
  for (int i = 0; i < 5; ++i) steer(live);
  EXPECT_TRUE(camera_.told.empty());
}

TEST_F(LiveHeadTest, ThatIsNotToFollowIsToldNothingButToGoToItsMiddle) {
  LiveHead live = head("{device: 'visca+serial:/dev/null:9600', follow: false}");
  for (int i = 0; i < 30; ++i) steer(live);
  camera_.angles.reset();
  for (int i = 0; i < 30; ++i) steer(live);
  EXPECT_TRUE(camera_.told.empty());
  EXPECT_TRUE(camera_.zooms.empty());
  live.centre(now_ns_, camera_);
  ASSERT_EQ(camera_.told.size(), 1u);
  EXPECT_EQ(camera_.told[0].kind, HeadGoal::Kind::kAbsolute);
  EXPECT_TRUE(live.is_centring(now_ns_ + 1900 * kMs));
  EXPECT_FALSE(live.is_centring(now_ns_ + 2100 * kMs));
}

}  // namespace
}  // namespace perch
