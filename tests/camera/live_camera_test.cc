#include "perch/camera/live_camera.h"

#include <gmock/gmock.h>

#include <limits>
#include <stdexcept>

#include "camera/fake_clock.h"
#include "support/rng.h"

namespace perch {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr int64_t kMs = 1'000'000;

// A camera of 100 Hz whose pictures are stamped 3 ms before they are there, while nothing is wrong with it.
struct World {
  FakeClock clock;
  bool there = true;         // open() works
  bool frozen = false;       // no pictures come
  bool breaks = false;       // the next grab() throws
  int64_t stamp_off_ns = 0;  // added to the stamps
  bool settling = false;
  int width = 4;
  std::vector<int64_t> opened_ms;  // when it was tried, since the start
  int open = 0;                    // open()s less close()s
};

class ScriptedCamera : public CameraDevice {
 public:
  explicit ScriptedCamera(World& world) : world_(world) {}
  ~ScriptedCamera() override { EXPECT_EQ(world_.open, 0); }
  void open() override {
    world_.opened_ms.push_back(world_.clock.now_ns() / kMs - 5000);
    if (!world_.there) throw std::runtime_error("toy: not there");
    ++world_.open;
    EXPECT_EQ(world_.open, 1);
  }
  void close() override {
    --world_.open;
    EXPECT_EQ(world_.open, 0);
  }
  Grab grab(Frame& frame, int64_t timeout_ns) override {
    EXPECT_EQ(world_.open, 1);
    if (world_.breaks || !world_.there) {
      world_.breaks = false;
      throw std::runtime_error("toy: broke");
    }
    const int64_t now = world_.clock.now_ns(), due = (now / (10 * kMs) + 1) * 10 * kMs;
    world_.clock.pass(std::min(timeout_ns, due - now));
    if (world_.frozen || due - now > timeout_ns) return {};
    frame.timestamp_ns = due - 3 * kMs + world_.stamp_off_ns;
    frame.grey = cv::Mat::zeros(4, world_.width, CV_8UC1);
    return {true, 0, "", world_.settling};
  }
  std::string name() const override { return "toy"; }

 private:
  World& world_;
};

std::unique_ptr<LiveSource> camera(World& world, const LiveOptions& options = {}) {
  return make_live_camera(std::make_unique<ScriptedCamera>(world), options, world.clock);
}

// Asks for pictures for so long; how many came.
int watch(LiveSource& source, World& world, int64_t duration_ms) {
  int pictures = 0;
  for (const int64_t end = world.clock.now_ns() + duration_ms * kMs; world.clock.now_ns() < end;) {
    if (source.next(milliseconds(7))) ++pictures;
  }
  return pictures;
}

TEST(LiveCamera, GivesPicturesAsTheyComeWithTheLatencyTakenOff) {
  World world;
  LiveOptions options;
  options.latency = 0.002;
  const auto source = camera(world, options);
  const LiveFrame picture = source->next(milliseconds(20)).value();
  EXPECT_EQ(picture.arrived_ns, 5'010 * kMs);
  EXPECT_EQ(picture.frame.timestamp_ns, 5'005 * kMs);
  EXPECT_FALSE(source->next(milliseconds(9)));
  EXPECT_TRUE(source->next(milliseconds(1)));
  EXPECT_EQ(watch(*source, world, 1000), 100);
  EXPECT_FALSE(source->ended());
  EXPECT_FALSE(source->recorded());
  EXPECT_EQ(source->counters().frames, 102);
  EXPECT_EQ(source->counters().last_problem, "");
}

TEST(LiveCamera, KeepsPicturesBackWhileTheirTimesSettleAndStaysOpen) {
  World world;
  world.settling = true;
  const auto source = camera(world);
  EXPECT_EQ(watch(*source, world, 8000), 0);
  EXPECT_GE(source->counters().settling, 790);
  EXPECT_EQ(world.opened_ms.size(), 1U);
  world.settling = false;
  EXPECT_GE(watch(*source, world, 1000), 95);
}

TEST(LiveCamera, WaitsForACameraThatIsNotThereLongerAndLonger) {
  World world;
  world.there = false;
  const auto source = camera(world);
  EXPECT_EQ(watch(*source, world, 17'000), 0);
  EXPECT_THAT(world.opened_ms, ElementsAre(0, 100, 300, 700, 1500, 3100, 6300, 11300, 16300));
  EXPECT_EQ(source->counters().open_failed, 9);
  EXPECT_EQ(source->counters().reopened, 0);
  EXPECT_EQ(source->counters().last_problem, "toy: not there");
  world.there = true;
  EXPECT_GE(watch(*source, world, 6000), 100);
  world.opened_ms.clear();
  world.breaks = true;  // pictures came meanwhile: the next attempt is soon again
  EXPECT_GE(watch(*source, world, 1000), 85);
  EXPECT_EQ(world.opened_ms.size(), 1U);
  EXPECT_EQ(source->counters().reopened, 1);
}

TEST(LiveCamera, ACameraThatOpensButGivesNothingIsNotOpenedAllTheTime) {
  World world;
  world.frozen = true;
  LiveOptions options;
  options.first_picture = 1;
  const auto source = camera(world, options);
  watch(*source, world, 60'000);
  EXPECT_LT(world.opened_ms.size(), 16U);
  EXPECT_GT(source->counters().stalled, 9);
  EXPECT_EQ(source->counters().last_problem, "toy: no picture for 1000 ms");
}

TEST(LiveCamera, AFrozenCameraIsOpenedAnewAfterTenPeriods) {
  World world;
  LiveOptions options;
  options.rate_hz = 10;  // as it was asked; it is faster
  const auto source = camera(world, options);
  watch(*source, world, 1000);
  world.frozen = true;
  world.opened_ms.clear();
  watch(*source, world, 990);
  EXPECT_EQ(source->counters().stalled, 0);
  watch(*source, world, 130);
  EXPECT_EQ(source->counters().stalled, 1);
  EXPECT_THAT(world.opened_ms, ElementsAre(2100));
  world.frozen = false;
  EXPECT_GT(watch(*source, world, 1000), 95);
  EXPECT_EQ(source->counters().reopened, 1);
}

TEST(LiveCamera, ANewSizeIsGivenAndCounted) {
  World world;
  const auto source = camera(world);
  watch(*source, world, 100);
  world.width = 8;
  EXPECT_EQ(source->next(milliseconds(20)).value().frame.grey.cols, 8);
  watch(*source, world, 100);
  EXPECT_EQ(source->counters().resized, 1);
}

TEST(LiveCamera, PicturesWhoseTimeCannotBeTrueAreDroppedAndSaid) {
  World world;
  const auto source = camera(world);
  for (const int64_t off_ms : {40L, -6'000L, 1'700'000'000'000L}) {
    world.stamp_off_ns = off_ms * kMs;
    const int64_t dropped = source->counters().dropped;
    EXPECT_EQ(watch(*source, world, 100), 0) << off_ms;
    EXPECT_NEAR(static_cast<double>(source->counters().dropped - dropped), 10, 1);
  }
  EXPECT_THAT(source->counters().last_problem,
              HasSubstr("toy: a picture stamped 1699999999997 ms after it arr"));
  world.stamp_off_ns = 0;
  EXPECT_EQ(watch(*source, world, 100), 10);
  world.stamp_off_ns = -10 * kMs;  // the last one's stamp again
  EXPECT_FALSE(source->next(milliseconds(10)));
  EXPECT_THAT(source->counters().last_problem, HasSubstr("no later than the one before it"));
  EXPECT_EQ(source->counters().stalled, 0);
}

// Whatever happens to the camera: nothing is thrown, stamps increase, pictures are on time, and when all is
// well again pictures come within the longest back-off.
TEST(LiveCamera, SurvivesAnythingInAnyOrder) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    TestRng rng(seed);
    World world;
    LiveOptions options;
    options.first_picture = 0.7;
    const auto source = camera(world, options);
    int64_t last = std::numeric_limits<int64_t>::min(), given = 0;
    const auto look = [&](int64_t duration_ms) {
      for (const int64_t end = world.clock.now_ns() + duration_ms * kMs; world.clock.now_ns() < end;) {
        const auto picture = source->next(milliseconds(rng.index(30)));
        if (!picture) {
          world.clock.pass(kMs);
          continue;
        }
        ++given;
        EXPECT_GT(picture->frame.timestamp_ns, last);
        EXPECT_GE(picture->arrived_ns, picture->frame.timestamp_ns - 20 * kMs);
        EXPECT_LE(picture->arrived_ns, picture->frame.timestamp_ns + 5'000 * kMs);
        last = picture->frame.timestamp_ns;
      }
    };
    for (int event = 0; event < 30; ++event) {
      world.there = rng.index(4) != 0;
      world.frozen = rng.index(4) == 0;
      world.breaks = rng.index(4) == 0;
      world.stamp_off_ns = rng.index(4) == 0 ? int64_t{rng.index(20'000)} * kMs - 10'000 * kMs : 0;
      world.width = rng.index(4) == 0 ? 8 : 4;
      look(rng.index(2000));
    }
    world.there = true;
    world.frozen = world.breaks = false;
    world.stamp_off_ns = 0;
    look(5100);
    const int64_t before = given;
    look(100);
    EXPECT_GE(given - before, 3) << seed;
    EXPECT_EQ(source->counters().frames, given);
  }
}

}  // namespace
}  // namespace perch
