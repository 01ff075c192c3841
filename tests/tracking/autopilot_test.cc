// The filter with an autopilot, and measurements in any order.

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "perch/geometry/so3.h"
#include "perch/tracking/filter.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

constexpr int64_t kSecond = 1'000'000'000;

// A body over a pad in an autopilot's world: the pad lies turned there as it likes and stands or sails along
// a straight line; the body swings over it.
struct Scene {
  Rigid3 world_from_pad;
  Eigen::Vector3d pad_velocity{0, 0, 0};  // in the world, m/s

  static double time(int64_t t) { return static_cast<double>(t) * 1e-9; }
  Rigid3 pad_from_body(int64_t t) const {
    const double s = time(t);
    return {so3_exp({0.1 * std::sin(s), 0.1 * std::sin(1.3 * s), 0.3 * s}) *
                Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX())),
            {std::sin(0.7 * s), std::cos(0.9 * s), 6 - 0.3 * s}};
  }
  Eigen::Vector3d velocity(int64_t t) const {
    const double s = time(t);
    return {0.7 * std::cos(0.7 * s), -0.9 * std::sin(0.9 * s), -0.3};
  }
  // Central differences of a smooth motion.
  Eigen::Vector3d angular_velocity_in_body(int64_t t) const {
    constexpr int64_t kStep = 1'000'000;
    return so3_log(pad_from_body(t - kStep).rotation.conjugate() * pad_from_body(t + kStep).rotation) /
           (2 * time(kStep));
  }
  AutopilotSample sample(int64_t t) const {
    AutopilotSample sample;
    sample.timestamp_ns = t;
    sample.world_from_body = world_from_pad.rotation * pad_from_body(t).rotation;
    sample.body_velocity_in_world = world_from_pad.rotation * velocity(t) + pad_velocity;
    sample.angular_velocity_in_body = angular_velocity_in_body(t);
    return sample;
  }
};

// A pose as a camera metres away sees it: the direction well, the tilt badly, and so the place beside the
// pad.
UncertainRigid3 seen(const Rigid3& pad_from_body, TestRng& rng) {
  constexpr double kTilt = 0.01, kPlace = 0.002;
  const Eigen::Vector3d r = rng.normal3(kTilt), d = rng.normal3(kPlace);
  const Eigen::Matrix3d arm = skew(pad_from_body.translation);
  PoseError error;
  error << d - arm * r, r;
  Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Identity() * kPlace;
  root.topRightCorner<3, 3>() = -arm * kTilt;
  root.bottomRightCorner<3, 3>() = Eigen::Matrix3d::Identity() * kTilt;
  return {perturb(pad_from_body, error), root * root.transpose()};
}

struct Told {
  int64_t timestamp_ns = 0;
  std::optional<UncertainRigid3> pose;
  AutopilotSample sample;
  int64_t arrival_ns = 0;
};

// Ten seconds of frames at 30 Hz and samples at 50 Hz, in the order of their times.
std::vector<Told> flight(const Scene& scene, TestRng& rng, bool with_autopilot = true) {
  std::vector<Told> told;
  for (int64_t i = 0; i < 300; ++i) {
    const int64_t t = i * kSecond / 30;
    told.push_back({t, seen(scene.pad_from_body(t), rng), {}, t});
  }
  for (int64_t i = 0; with_autopilot && i < 500; ++i) {
    const int64_t t = i * kSecond / 50 + 1'234'567;
    AutopilotSample sample = scene.sample(t);
    sample.world_from_body = so3_exp(rng.normal3(0.003)) * *sample.world_from_body;
    *sample.body_velocity_in_world += rng.normal3(0.03);
    *sample.angular_velocity_in_body += rng.normal3(0.01);
    told.push_back({t, std::nullopt, sample, t});
  }
  std::stable_sort(told.begin(), told.end(),
                   [](const Told& a, const Told& b) { return a.timestamp_ns < b.timestamp_ns; });
  return told;
}

void tell(VehicleFilter& filter, const Told& told) {
  if (told.pose) {
    filter.update(told.timestamp_ns, told.pose);
  } else {
    filter.hear(told.sample);
  }
}

struct Rms {
  double velocity = 0, rotation = 0, position = 0;
};

// From the second second on.
Rms errors(const Scene& scene, const std::vector<Told>& flight, const TrackingOptions& options = {}) {
  VehicleFilter filter(options);
  Rms sum;
  int count = 0;
  for (const Told& told : flight) {
    tell(filter, told);
    if (!told.pose || told.timestamp_ns < kSecond) continue;
    const auto state = filter.predict(told.timestamp_ns);
    const Rigid3 truth = scene.pad_from_body(told.timestamp_ns);
    sum.velocity += (state->body_velocity_in_pad - scene.velocity(told.timestamp_ns)).squaredNorm();
    sum.rotation += std::pow(state->pad_from_body.rotation.angularDistance(truth.rotation), 2);
    sum.position += (state->pad_from_body.translation - truth.translation).squaredNorm();
    ++count;
  }
  return {std::sqrt(sum.velocity / count), std::sqrt(sum.rotation / count), std::sqrt(sum.position / count)};
}

bool same_bits(const VehicleState& a, const VehicleState& b) {
  return a.timestamp_ns == b.timestamp_ns && a.source == b.source &&
         a.pad_from_body.rotation.coeffs() == b.pad_from_body.rotation.coeffs() &&
         a.pad_from_body.translation == b.pad_from_body.translation &&
         a.body_velocity_in_pad == b.body_velocity_in_pad &&
         a.body_angular_velocity_in_pad == b.body_angular_velocity_in_pad && a.covariance == b.covariance;
}

TEST(Autopilot, HelpsWhateverTheHeadingOfThePadInItsWorld) {
  for (unsigned number = 0; number < 5; ++number) {
    TestRng rng(number);
    Scene scene;
    // Upside down in NED, turned about the vertical by anything, and not quite level.
    scene.world_from_pad.rotation = so3_exp(rng.normal3(0.05)) *
                                    Eigen::AngleAxisd(rng.uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX());
    TestRng alone_noise(number), aided_noise(number);
    const Rms alone = errors(scene, flight(scene, alone_noise, false));
    const Rms aided = errors(scene, flight(scene, aided_noise));
    // Vision alone sees 6 cm of sideways noise at 6 m, and that 30 times a second.
    EXPECT_LT(aided.velocity, 0.05) << number;
    EXPECT_LT(aided.velocity, 0.3 * alone.velocity) << number;
    EXPECT_LT(aided.rotation, 0.7 * alone.rotation) << number;
    EXPECT_LT(aided.position, 0.7 * alone.position) << number;
  }
}

TEST(Autopilot, DoesNotBiasWhenItsGroundVelocityIsNotThatOverThePad) {
  // A ship at 8 m/s: what the autopilot says is 8 m/s off from what is asked.
  Scene scene;
  scene.world_from_pad.rotation = Eigen::AngleAxisd(M_PI, Eigen::Vector3d(1, 0.3, 0).normalized());
  scene.pad_velocity = {6, -5, 0};
  TestRng noise;
  EXPECT_LT(errors(scene, flight(scene, noise)).velocity, 0.05);
}

TEST(Autopilot, IsMetAnewWhenItsHeadingIsReset) {
  Scene scene;
  TestRng noise;
  auto told = flight(scene, noise);
  // From the fifth second on its world is turned by 40 degrees, and its velocity with it.
  const auto turn = so3_exp({0, 0, 0.7});
  for (Told& t : told) {
    if (t.pose || t.timestamp_ns < 5 * kSecond) continue;
    t.sample.world_from_body = turn * *t.sample.world_from_body;
    t.sample.body_velocity_in_world = turn * *t.sample.body_velocity_in_world;
  }
  TestRng alone_noise;
  const Rms alone = errors(scene, flight(scene, alone_noise, false));
  const Rms rms = errors(scene, told);
  // For one second of ten it has vision alone.
  EXPECT_LT(rms.velocity, 0.6 * alone.velocity);
  EXPECT_LT(rms.rotation, alone.rotation);
}

TEST(Autopilot, ThatIsWrongDoesNoHarm) {
  Scene scene;
  TestRng alone_noise;
  const Rms alone = errors(scene, flight(scene, alone_noise, false));
  const auto wrong = [&](const auto& spoil) {
    TestRng noise;
    auto told = flight(scene, noise);
    for (Told& t : told) {
      if (!t.pose) spoil(t.sample);
    }
    return errors(scene, told);
  };
  const Rms frozen = wrong([&](AutopilotSample& sample) {
    const int64_t t = sample.timestamp_ns;
    sample = scene.sample(0);
    sample.timestamp_ns = t;
  });
  const Rms inverted =
      wrong([](AutopilotSample& sample) { sample.world_from_body = sample.world_from_body->conjugate(); });
  const Rms other_axes = wrong([](AutopilotSample& sample) {
    std::swap(sample.body_velocity_in_world->x(), sample.body_velocity_in_world->y());
  });
  // What cannot be explained by a pad that moves is refused; the rest costs some noise, but never the pad.
  for (const Rms& rms : {frozen, inverted, other_axes}) {
    EXPECT_LT(rms.velocity, 2 * alone.velocity);
    EXPECT_LT(rms.position, 1.5 * alone.position);
    EXPECT_LT(rms.rotation, 2 * alone.rotation);
  }
}

TEST(Autopilot, SamplesThatAreNoneChangeNothing) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  Scene scene;
  TestRng noise;
  const auto told = flight(scene, noise);
  VehicleFilter filter{TrackingOptions{}}, disturbed{TrackingOptions{}};
  for (const Told& t : told) {
    std::vector<AutopilotSample> none(8);
    for (auto& sample : none) sample.timestamp_ns = t.timestamp_ns;
    none[1].world_from_body = Eigen::Quaterniond(nan, 0, 0, 0);
    none[2].world_from_body = Eigen::Quaterniond(0, 0, 0, 0);
    none[3].body_velocity_in_world = Eigen::Vector3d(0, nan, 0);
    none[4].angular_velocity_in_body = Eigen::Vector3d(0, 0, std::numeric_limits<double>::infinity());
    none[5] = scene.sample(t.timestamp_ns);
    none[5].attitude_sigma = none[5].velocity_sigma = none[5].angular_velocity_sigma = nan;
    none[6] = scene.sample(t.timestamp_ns - kSecond);
    none[7] = scene.sample(t.timestamp_ns + 2 * kSecond);
    for (const auto& sample : none) disturbed.hear(sample);
    tell(filter, t);
    tell(disturbed, t);
    for (const auto& sample : none) disturbed.hear(sample);
  }
  EXPECT_TRUE(same_bits(*filter.predict(10 * kSecond), *disturbed.predict(10 * kSecond)));
}

TEST(Autopilot, AloneNeitherStartsNorProlongsTracking) {
  Scene scene;
  VehicleFilter filter{TrackingOptions{}};
  TestRng noise;
  for (int64_t t = 0; t < kSecond; t += kSecond / 50) {
    filter.hear(scene.sample(t));
    EXPECT_FALSE(filter.update(t, std::nullopt));
  }
  filter.update(kSecond, seen(scene.pad_from_body(kSecond), noise));
  for (int64_t t = kSecond; t <= 3 * kSecond; t += kSecond / 50) {
    filter.hear(scene.sample(t));
    const auto state = filter.update(t + 1, std::nullopt);
    EXPECT_EQ(state->source, t + 1 <= 2 * kSecond ? StateSource::kPredicted : StateSource::kLost) << t;
  }
}

TEST(Autopilot, CarriesThroughASecondWithoutPoses) {
  Scene scene;
  TestRng noise;
  const auto told = flight(scene, noise);
  VehicleFilter aided{TrackingOptions{}}, alone{TrackingOptions{}};
  for (const Told& t : told) {
    if (t.timestamp_ns > 9 * kSecond) break;
    const bool hidden = t.timestamp_ns > 8 * kSecond;
    if (!t.pose) {
      aided.hear(t.sample);
    } else {
      aided.update(t.timestamp_ns, hidden ? std::nullopt : t.pose);
      alone.update(t.timestamp_ns, hidden ? std::nullopt : t.pose);
    }
  }
  const int64_t end = 9 * kSecond - kSecond / 30;
  const Rigid3 truth = scene.pad_from_body(end);
  const auto error = [&](const VehicleFilter& filter) {
    return (filter.predict(end)->pad_from_body.translation - truth.translation).norm();
  };
  // 3 cm/s of velocity noise, 50 times in that second, over a second: below a centimetre; and the pad's
  // bearing in the world is known to some milliradians of a metre.
  EXPECT_LT(error(aided), 0.03);
  EXPECT_GT(error(alone), 3 * error(aided));
}

TEST(Lateness, OfAnyMeasurementChangesNoBitOfTheResult) {
  Scene scene;
  scene.world_from_pad.rotation = so3_exp({2, 1, -1});
  for (unsigned number = 0; number < 2; ++number) {
    TestRng rng(number);
    auto told = flight(scene, rng);
    // Some frames and samples of one time, some wrong, so that gates and restarts are on the way too.
    for (Told& t : told) {
      if (!t.pose && rng.index(5) == 0) t.sample.timestamp_ns = t.timestamp_ns = t.timestamp_ns / 100 * 100;
      if (t.pose && rng.index(20) == 0) t.pose->mean.translation += rng.normal3(3);
    }
    VehicleFilter in_order{TrackingOptions{}}, late{TrackingOptions{}};
    for (const Told& t : told) tell(in_order, t);
    // WHEN each comes up to 0.3 s late, in an order of its own
    auto arrivals = told;
    for (Told& t : arrivals) t.arrival_ns = t.timestamp_ns + static_cast<int64_t>(rng.uniform(0, 0.3e9));
    // But the first frame: what is said before it, whenever, is not kept.
    std::stable_sort(arrivals.begin(), arrivals.end(), [](const Told& a, const Told& b) {
      return std::pair(a.timestamp_ns > 0, a.arrival_ns) < std::pair(b.timestamp_ns > 0, b.arrival_ns);
    });
    for (const Told& t : arrivals) tell(late, t);
    // THEN both know the same, now and for as long as the history reaches back
    for (const int64_t ago : {int64_t{0}, kSecond / 10, kSecond / 3}) {
      const int64_t t = 10 * kSecond - ago;
      const auto a = in_order.predict(t), b = late.predict(t);
      ASSERT_TRUE(a && b);
      EXPECT_TRUE(same_bits(*a, *b)) << number << ' ' << ago;
    }
  }
}

TEST(Lateness, TheStateOfAFrameIsThatOfItsTime) {
  Scene scene;
  TestRng rng;
  const auto told = flight(scene, rng);
  VehicleFilter plain{TrackingOptions{}}, ahead{TrackingOptions{}};
  // The autopilot is 100 ms ahead of the frames, which take their time.
  size_t next = 0;
  for (const Told& t : told) {
    if (!t.pose) {
      plain.hear(t.sample);
      continue;
    }
    if (t.timestamp_ns > 0) {
      for (; next < told.size() && told[next].timestamp_ns < t.timestamp_ns + kSecond / 10; ++next) {
        if (!told[next].pose && told[next].timestamp_ns > 0) ahead.hear(told[next].sample);
      }
    }
    const auto a = plain.update(t.timestamp_ns, t.pose), b = ahead.update(t.timestamp_ns, t.pose);
    ASSERT_TRUE(same_bits(*a, *b)) << t.timestamp_ns;
  }
}

TEST(Lateness, BeyondTheHistoryIsTooLate) {
  Scene scene;
  TestRng rng;
  auto told = flight(scene, rng);
  VehicleFilter filter{TrackingOptions{}}, other{TrackingOptions{}};
  for (const Told& t : told) {
    tell(filter, t);
    // This one misses a sample, and hears it after 0.51 s.
    if (t.pose || t.timestamp_ns < 5 * kSecond || t.timestamp_ns > 5 * kSecond + kSecond / 60) tell(other, t);
    if (t.timestamp_ns == 5 * kSecond + kSecond * 8 / 15) {
      const auto before = other.predict(t.timestamp_ns);
      for (const Told& missed : told) {
        if (!missed.pose && missed.timestamp_ns >= 5 * kSecond &&
            missed.timestamp_ns <= 5 * kSecond + kSecond / 60) {
          other.hear(missed.sample);
        }
      }
      EXPECT_TRUE(same_bits(*before, *other.predict(t.timestamp_ns)));
    }
  }
  EXPECT_FALSE(same_bits(*filter.predict(6 * kSecond), *other.predict(6 * kSecond)) &&
               filter.predict(6 * kSecond).has_value());
}

}  // namespace
}  // namespace perch
