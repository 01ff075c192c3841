#include "perch/links/mavlink/landing_output.h"

#include <gtest/gtest.h>

#include "links/mavlink/fake_autopilot.h"
#include "perch/geometry/so3.h"
#include "perch/links/mavlink/state_texts.h"

namespace perch::mavlink {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// The pad lies on the ground a little north-east of the origin, its face up: z up is NED's -z.
const Rigid3 kNedFromPad{Quaterniond(Eigen::AngleAxisd(0.7, Vector3d::UnitZ())) * Quaterniond(0, 1, 0, 0),
                         {2, 1, 0.5}};

// A vehicle that turns by up to 1 rad/s and flies by up to 3 m/s, ten metres above.
TrueMotion fly(int64_t now_ns) {
  const double t = static_cast<double>(now_ns) * 1e-9;
  const auto rotation = [](double s) {
    return so3_exp({0.2 * std::sin(2 * s), 0.15 * std::sin(3 * s + 1), 0.5 * std::sin(s)});
  };
  TrueMotion motion;
  motion.ned_from_body = {rotation(t), {2 * std::sin(t), 1.5 * std::sin(2 * t), -10 + std::cos(t)}};
  motion.body_velocity_in_ned = {2 * std::cos(t), 3 * std::cos(2 * t), -std::sin(t)};
  motion.body_rate = so3_log(rotation(t - 1e-4).conjugate() * rotation(t + 1e-4)) / 2e-4;
  return motion;
}

Vector3d pad_in_body(int64_t t) { return inverse(fly(t).ned_from_body) * kNedFromPad.translation; }

PadSighting sighting_at(int64_t capture_ns) {
  const TrueMotion truth = fly(capture_ns);
  PadSighting sighting;
  sighting.capture_ns = capture_ns;
  sighting.body_from_pad.mean = inverse(truth.ned_from_body) * kNedFromPad;
  sighting.body_from_pad.covariance = 1e-4 * PoseCovariance::Identity();
  sighting.velocity = truth.ned_from_body.rotation.conjugate() * truth.body_velocity_in_ned;
  sighting.rate = truth.body_rate;
  sighting.trusted = true;
  return sighting;
}

// What an autopilot that is heard without noise and delay has told.
VehicleHistory perfect_history(int64_t until_ns, bool positions = true) {
  VehicleHistory history;
  for (int64_t t = until_ns - 2 * kSecond; t <= until_ns; t += 10 * kMs) {
    const TrueMotion truth = fly(t);
    const Eigen::Quaternionf q = truth.ned_from_body.rotation.cast<float>();
    const Eigen::Vector3f w = truth.body_rate.cast<float>(),
                          p = truth.ned_from_body.translation.cast<float>(),
                          v = truth.body_velocity_in_ned.cast<float>();
    history.add(AttitudeQuaternion{0, q.w(), q.x(), q.y(), q.z(), w.x(), w.y(), w.z(), {}}, t);
    if (positions) history.add(LocalPositionNed{0, p.x(), p.y(), p.z(), v.x(), v.y(), v.z()}, t);
  }
  return history;
}

Vector3d position_of(const LandingTarget& m) { return {m.x, m.y, m.z}; }

TEST(ArduPilot, GetsTheFieldsThatItReadsAndNoOthers) {
  PadSighting sighting;
  sighting.capture_ns = 1'234'567'890'123'000;
  sighting.body_from_pad.mean.translation = {1, -0.5, 10};
  sighting.rate = sighting.velocity = Vector3d::Zero();
  const auto out = ardupilot_message(sighting, VehicleHistory(), sighting.capture_ns + 50 * kMs);
  ASSERT_TRUE(out.landing_target);
  const LandingTarget& m = *out.landing_target;
  EXPECT_EQ(m.time_usec, 1'234'567'890'123u);
  EXPECT_EQ(m.frame, 12);
  EXPECT_EQ(m.position_valid, 1);
  EXPECT_EQ(m.type, 2);
  EXPECT_EQ(position_of(m), Vector3d(1, -0.5, 10));
  EXPECT_EQ(m.distance, 10.062305450439453f);  // as in the golden vector
  EXPECT_EQ(m.q, (std::array<float, 4>{}));
  // body = (-tan(angle_y), tan(angle_x), 1)
  EXPECT_NEAR(-std::tan(m.angle_y), 0.1, 1e-7);
  EXPECT_NEAR(std::tan(m.angle_x), -0.05, 1e-7);
}

TEST(ArduPilot, GetsTheVectorOfTheMomentItWillAttributeItTo) {
  TestRng rng;
  double worst = 0, unpredicted = 0;
  for (int i = 0; i < 500; ++i) {
    const int64_t send = 100 * kSecond + rng.index(1'000'000'000);
    const int64_t capture = send - 10 * kMs - rng.index(240'000'000);
    const int64_t target = send - 20 * kMs - rng.index(230'000'000);
    const auto out = ardupilot_message(sighting_at(capture), perfect_history(send - 20 * kMs), target);
    ASSERT_TRUE(out.landing_target);
    worst = std::max(worst, (position_of(*out.landing_target) - pad_in_body(target)).norm());
    unpredicted = std::max(unpredicted, (pad_in_body(capture) - pad_in_body(target)).norm());
    EXPECT_FLOAT_EQ(out.landing_target->distance,
                    static_cast<float>(position_of(*out.landing_target).norm()));
  }
  // The trapezium of the velocities misses 12 m/s^3 T^3 / 12: 1.2 cm over 0.23 s.
  EXPECT_LT(worst, 0.013);
  EXPECT_GT(unpredicted, 1.0);
}

TEST(ArduPilot, ATurningHoverIsExactByHistoryAndNearlySoByRate) {
  // Without translation the history leaves nothing but rounding; the rate of the exposure misses its change.
  const int64_t send = 100 * kSecond, capture = send - 150 * kMs, target = send - 40 * kMs;
  PadSighting sighting = sighting_at(capture);
  sighting.velocity = Vector3d::Zero();
  const Vector3d in_ned = fly(capture).ned_from_body.rotation * sighting.body_from_pad.mean.translation;
  const Vector3d truth = fly(target).ned_from_body.rotation.conjugate() * in_ned;
  const auto by_history = ardupilot_message(sighting, perfect_history(send, false), target);
  // Slerp between samples 10 ms apart, 1.5 rad/s^2: 2e-5 rad at 10 m.
  EXPECT_LT((position_of(*by_history.landing_target) - truth).norm(), 3e-4);
  const auto by_rate = ardupilot_message(sighting, VehicleHistory(), target);
  // 1.5 rad/s^2 over 0.11 s: 9 mrad at 10 m.
  EXPECT_LT((position_of(*by_rate.landing_target) - truth).norm(), 0.12);
  sighting.rate.reset();
  EXPECT_EQ(ardupilot_message(sighting, VehicleHistory(), target).refusal, LandingRefusal::kNoAttitude);
}

TEST(ArduPilot, TheAutopilotsVelocityServesWhereTheFilterHasNone) {
  const int64_t send = 100 * kSecond, capture = send - 150 * kMs, target = send - 40 * kMs;
  PadSighting sighting = sighting_at(capture);
  const auto with = ardupilot_message(sighting, perfect_history(send), target);
  sighting.velocity.reset();
  const auto without = ardupilot_message(sighting, perfect_history(send), target);
  EXPECT_LT((position_of(*with.landing_target) - position_of(*without.landing_target)).norm(), 1e-5);
}

TEST(Px4, GetsThePadsPlaceInItsMapWhateverTheVehicleDoes) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    const int64_t send = 100 * kSecond + rng.index(1'000'000'000);
    const int64_t capture = send - rng.index(300'000'000);
    const auto out = px4_message(sighting_at(capture), perfect_history(send));
    ASSERT_TRUE(out.landing_target);
    EXPECT_EQ(out.landing_target->frame, 1);
    EXPECT_EQ(out.landing_target->position_valid, 1);
    EXPECT_EQ(out.landing_target->time_usec, static_cast<uint64_t>(capture / 1000));
    // Slerp: 2e-5 rad at 10 m; floats of 10 m: 1e-6.
    EXPECT_LT((position_of(*out.landing_target) - kNedFromPad.translation).norm(), 3e-4);
  }
}

TEST(Px4, AResetAfterTheExposureIsRefused) {
  const int64_t send = 100 * kSecond;
  VehicleHistory history = perfect_history(send - 100 * kMs);
  const PadSighting sighting = sighting_at(send - 150 * kMs);
  EXPECT_EQ(px4_message(sighting, history).refusal, LandingRefusal::kNone);
  const Eigen::Vector3f p = fly(send).ned_from_body.translation.cast<float>();
  history.add(LocalPositionNed{0, p.x() + 5, p.y(), p.z(), 0, 0, 0}, send - 50 * kMs);
  EXPECT_EQ(px4_message(sighting, history).refusal, LandingRefusal::kReset);
}

TEST(Px4, WithoutAttitudeOrPositionNothingIsSaid) {
  const PadSighting sighting = sighting_at(100 * kSecond);
  EXPECT_EQ(px4_message(sighting, VehicleHistory()).refusal, LandingRefusal::kNoAttitude);
  EXPECT_EQ(px4_vte_message(sighting, VehicleHistory()).refusal, LandingRefusal::kNoAttitude);
  VehicleHistory history;
  history.add(AttitudeQuaternion{0, 1, 0, 0, 0, 0, 0, 0, {}}, 100 * kSecond);
  EXPECT_EQ(px4_message(sighting, history).refusal, LandingRefusal::kNoPosition);
  EXPECT_EQ(px4_vte_message(sighting, history).refusal, LandingRefusal::kNone);
}

TEST(Px4Vte, TakesTheFrameInWhichTheCovarianceIsDiagonal) {
  const int64_t capture = 100 * kSecond;
  const VehicleHistory history = perfect_history(capture);
  const Eigen::Matrix3d ned_from_body = fly(capture).ned_from_body.rotation.toRotationMatrix();
  const Eigen::Matrix3d variances = Vector3d(0.01, 0.04, 0.25).asDiagonal();
  for (const bool body : {true, false}) {
    PadSighting sighting = sighting_at(capture);
    sighting.body_from_pad.covariance.topLeftCorner<3, 3>() =
        body ? variances : Eigen::Matrix3d(ned_from_body.transpose() * variances * ned_from_body);
    const auto out = px4_vte_message(sighting, history);
    ASSERT_TRUE(out.target_relative);
    const TargetRelative& m = *out.target_relative;
    EXPECT_EQ(m.frame, body ? 1 : 2);
    EXPECT_EQ(m.timestamp, static_cast<uint64_t>(capture / 1000));
    EXPECT_EQ(m.type, 2);
    for (size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(m.pos_std[i], std::sqrt(variances(Eigen::Index(i), Eigen::Index(i))), 1e-3);
    EXPECT_NEAR(m.yaw_std, 0.01, 1e-6);

    Quaterniond ned_from_frame = Quaterniond::Identity();
    if (body) {
      ned_from_frame = Quaterniond(m.q_sensor[0], m.q_sensor[1], m.q_sensor[2], m.q_sensor[3]);
    } else {
      EXPECT_EQ(m.q_sensor, (std::array<float, 4>{}));
    }
    const Vector3d relative = ned_from_frame * Vector3d(m.x, m.y, m.z);
    EXPECT_LT((fly(capture).ned_from_body.translation + relative - kNedFromPad.translation).norm(), 1e-5);
    // The target's x is the pad's, its z is down.
    const Quaterniond target(m.q_target[0], m.q_target[1], m.q_target[2], m.q_target[3]);
    EXPECT_LT((ned_from_frame * target * Vector3d::UnitX() - kNedFromPad.rotation * Vector3d::UnitX()).norm(),
              1e-6);
    EXPECT_LT((ned_from_frame * target * Vector3d::UnitZ() - Vector3d::UnitZ()).norm(), 1e-6);
  }
}

TEST(Sighting, OfAStateIsTheSameMotionSeenFromTheBody) {
  TestRng rng;
  VehicleState state;
  state.pad_from_body = rng.pose(3);
  state.body_velocity_in_pad = rng.normal3();
  state.body_angular_velocity_in_pad = rng.normal3();
  state.covariance.diagonal().setConstant(0.01);
  const PadSighting sighting = sighting_from(state, 5, true);
  EXPECT_EQ(sighting.capture_ns, 5);
  EXPECT_LT((state.pad_from_body * sighting.body_from_pad.mean.translation).norm(), 1e-12);
  EXPECT_LT((state.pad_from_body.rotation * *sighting.velocity - state.body_velocity_in_pad).norm(), 1e-12);
  EXPECT_LT((state.pad_from_body.rotation * *sighting.rate - state.body_angular_velocity_in_pad).norm(),
            1e-12);
  // The pad's place seen from afar is as unsure as the rotation makes it.
  EXPECT_GT(sighting.body_from_pad.covariance(0, 0) + sighting.body_from_pad.covariance(1, 1), 0.02);
}

TEST(Profile, IsThatOfTheHeartbeatUnlessToldOtherwise) {
  Autopilot autopilot;
  ParameterReader parameters;
  autopilot.autopilot = mav_autopilot::kArdupilot;
  EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kArdupilot);
  autopilot.autopilot = mav_autopilot::kPx4;
  // LANDING_TARGET to one whose estimator runs would be wrong: nothing until that is known.
  parameters.read({"VTE_EN"});
  int64_t now_ns = 0;
  for (int asked = 0; asked < 8; now_ns += kSecond) {
    EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kNone);
    asked += parameters.ask(now_ns).has_value();
  }
  EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kPx4);  // an older one has no such parameter
  parameters.read({"VTE_EN"});                                          // the link was cut and came back
  EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kPx4);
  ParamValue value;
  set_text(value.param_id, "VTE_EN");
  value.param_value = 1;
  value.param_type = mav_param_type::kReal32;
  parameters.receive(value, mav_autopilot::kPx4);
  EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kPx4Vte);
  autopilot.autopilot = 0;
  EXPECT_EQ(profile_for(autopilot, parameters), LandingProfile::kNone);
  for (const char* name : {"ardupilot", "px4", "px4-vte"}) EXPECT_EQ(name_of(*profile_named(name)), name);
  EXPECT_FALSE(profile_named("none"));
}

TEST(LandingOutput, RefusesWhatMustNotBeSentAndSaysWhy) {
  LinkedWorld world;
  world.autopilot.motion = fly;
  LandingOutput output;
  const auto refusal = [&](const PadSighting& sighting) {
    EXPECT_TRUE(output.bytes(sighting, world.link, world.now_ns).empty());
    return output.last_refusal();
  };
  EXPECT_EQ(refusal(sighting_at(world.now_ns)), LandingRefusal::kNoLink);
  world.run(5);
  const PadSighting good = sighting_at(world.now_ns - 50 * kMs);
  PadSighting bad = good;
  bad.trusted = false;
  EXPECT_EQ(refusal(bad), LandingRefusal::kUntrusted);
  bad = good;
  bad.capture_ns = world.now_ns - 600 * kMs;
  EXPECT_EQ(refusal(bad), LandingRefusal::kStale);
  bad.capture_ns = world.now_ns + 10 * kMs;
  EXPECT_EQ(refusal(bad), LandingRefusal::kFuture);
  bad.capture_ns = INT64_MIN / 2;
  EXPECT_EQ(refusal(bad), LandingRefusal::kStale);
  for (const double number : {double(NAN), double(INFINITY), 0.0}) {
    bad = good;
    bad.body_from_pad.mean.translation.setConstant(number);
    EXPECT_EQ(refusal(bad), LandingRefusal::kNotFinite) << number;
  }
  bad = good;
  bad.body_from_pad.mean.rotation.coeffs().setZero();
  EXPECT_EQ(refusal(bad), LandingRefusal::kNotFinite);
  bad = good;
  bad.body_from_pad.covariance(1, 1) = -1;
  EXPECT_EQ(refusal(bad), LandingRefusal::kNotFinite);
  bad = good;
  bad.velocity = Vector3d(0, NAN, 0);
  EXPECT_EQ(refusal(bad), LandingRefusal::kNotFinite);

  EXPECT_FALSE(output.bytes(good, world.link, world.now_ns).empty());
  EXPECT_EQ(refusal(good), LandingRefusal::kRepeated);
  EXPECT_EQ(output.sent(), 1u);
  world.autopilot.silent = true;
  world.run(5);
  EXPECT_EQ(refusal(sighting_at(world.now_ns)), LandingRefusal::kNoLink);
  EXPECT_EQ(output.count(LandingRefusal::kNoLink), 2u);
  EXPECT_EQ(name_of(LandingRefusal::kReset), "reset");
}

// The whole way: an autopilot whose clock drifts behind a jittery link, sightings with a latency that varies.
struct Arrived {
  double worst = 0;
  size_t count = 0;
};

Arrived fly_and_send(uint8_t kind, const std::function<double(const LandingTarget&, int64_t)>& error) {
  LinkedWorld world(kind);
  world.autopilot.autopilot = kind;
  world.autopilot.motion = fly;
  LandingOutput output;
  world.run(12);  // clocks agree, and a PX4 without VTE_EN has been asked for it in vain
  Arrived arrived;
  for (int i = 0; i < 300; ++i) {
    world.run(0.033);
    const int64_t capture = world.now_ns - 30 * kMs - world.autopilot.rng.index(120'000'000);
    const auto bytes = output.bytes(sighting_at(capture), world.link, world.now_ns);
    FrameParser parser;
    parser.parse_datagram(bytes, [&](const Frame& frame) {
      arrived.worst = std::max(arrived.worst, error(*decode<LandingTarget>(frame), world.now_ns));
      ++arrived.count;
    });
  }
  return arrived;
}

TEST(LandingOutput, ReachesArduPilotWithItsLagTakenOut) {
  const Arrived arrived = fly_and_send(mav_autopilot::kArdupilot, [](const LandingTarget& m, int64_t sent) {
    const int64_t lag = 62'500'000;  // the fake's PLND_LAG, read from it
    return (position_of(m) - pad_in_body(sent - lag)).norm();
  });
  EXPECT_GT(arrived.count, 200u);  // captures that overtake each other are not sent
  // 1.2 rad/s by 1.5 ms of clocks, there and then, at 10 m.
  EXPECT_LT(arrived.worst, 0.03);
}

TEST(LandingOutput, ReachesPx4AtOnePlace) {
  const Arrived arrived = fly_and_send(mav_autopilot::kPx4, [](const LandingTarget& m, int64_t) {
    return (position_of(m) - kNedFromPad.translation).norm();
  });
  EXPECT_GT(arrived.count, 200u);
  // 1 rad/s by 1.5 ms at 10 m, 3 m/s by 1.5 ms.
  EXPECT_LT(arrived.worst, 0.025);
}

TEST(StateTexts, TellEachChangeOnceAndFlickerOnlyWhereItEnds) {
  StateTexts texts;
  const auto told = [&](PadState state, int64_t now) {
    const auto text = texts.update(state, now);
    return text ? text_of(text->text) : "";
  };
  EXPECT_EQ(told(PadState::kSearch, 1 * kSecond), "Perch: pad SEARCH");
  EXPECT_EQ(told(PadState::kSearch, 9 * kSecond), "");
  EXPECT_EQ(told(PadState::kTrack, 10 * kSecond), "Perch: pad TRACK");
  EXPECT_EQ(told(PadState::kCoast, 10 * kSecond + 100 * kMs), "");
  EXPECT_EQ(told(PadState::kTrack, 10 * kSecond + 200 * kMs), "");
  EXPECT_EQ(told(PadState::kTrack, 12 * kSecond), "");
  EXPECT_EQ(told(PadState::kCoast, 12 * kSecond + 100 * kMs), "Perch: pad COAST");
  EXPECT_EQ(told(PadState::kLost, 12 * kSecond + 200 * kMs), "");
  EXPECT_EQ(told(PadState::kLost, 13 * kSecond + 200 * kMs), "Perch: pad LOST");
  EXPECT_EQ(texts.update(PadState::kSearch, 20 * kSecond)->severity, 6);
  EXPECT_EQ(texts.update(PadState::kLost, 30 * kSecond)->severity, 4);
}

}  // namespace
}  // namespace perch::mavlink
