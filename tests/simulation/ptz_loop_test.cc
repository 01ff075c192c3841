// The paper's section 3.2 in a closed loop: a vehicle that swings, a head that follows, VISCA at 9600 baud
// between.

#include <gtest/gtest.h>

#include <cmath>
#include <deque>

#include "links/visca/visca_rig.h"
#include "perch/estimator/estimator.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "perch/ptz/head_control.h"
#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"
#include "support/rng.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr double kDeg = kRadFromDeg;

// 5 m over the pad, to and fro at 1 m/s over 4 m with 2 m/s^2 at the turns, rolling and pitching by 10
// degrees. World NED with the pad in its origin, level; body FRD.
Rigid3 world_from_body(double t) {
  constexpr double kTurn = 1.0, kLeg = 3.0, kPeriod = 2 * (kTurn + kLeg);  // s
  const double phase = std::fmod(t, kPeriod);
  const auto leg = [](double s) {  // from rest in the middle of a turn to that of the next
    if (s < kTurn / 2) return s * s;
    if (s < kTurn / 2 + kLeg) return 0.25 + (s - kTurn / 2);
    return 3.5 - (kTurn + kLeg - s) * (kTurn + kLeg - s);
  };
  const double aside = phase < kPeriod / 2 ? leg(phase) : 3.5 - leg(phase - kPeriod / 2);
  const double roll = 10 * kDeg * std::sin(2 * M_PI * t / 3.1),
               pitch = 10 * kDeg * std::sin(2 * M_PI * t / 4.3);
  return {rotation_from_ypr({0.05 * t, pitch, roll}), {0.3, aside - 1.75, -5}};
}

const Rigid3 kWorldFromPad{rotation_from_ypr({0.4, 0, M_PI}), {0, 0, 0}};
// Bolted under the body: zero looks straight down, the picture's right is the body's right, so that the pan's
// 200 degrees are for the roll and the way aside, the tilt's 50 for the pitch.
const Rigid3 kBodyFromBase{rotation_from_ypr({M_PI / 2, 0, 0}), {0.1, 0, 0.05}};

RunConfig config_of(bool moving) {
  RunConfig config;
  config.target = sharp_target();
  config.frames.body_from_base = kBodyFromBase;
  if (moving) config.frames.pan_tilt.emplace();
  return config;
}

// The EVI-D30's widest lens, 48.8 degrees.
CameraModel small_camera(int width) {
  const double f = width / 2.0 / std::tan(24.4 * kDeg);
  return CameraModel::pinhole(f, f, (width - 1) / 2.0, (width * 3 / 4 - 1) / 2.0, width, width * 3 / 4);
}

// What the two drive: pictures at 30 Hz that arrive 35 ms late, an autopilot that tells attitudes at 50 Hz.
class Loop {
 public:
  Loop(bool rendered, double flipped = 0)
      : rendered_(rendered),
        config_(config_of(true)),
        camera_(small_camera(rendered ? 320 : 640)),
        rig_(flipped),
        control_(config_.frames, camera_, evi_d30()),
        filter_(config_.tracking) {
    if (rendered) {
      renderer_.emplace(camera_, config_.target);
      estimator_.emplace(config_, camera_);
      fixed_estimator_.emplace(config_of(false), camera_);
    }
  }

  void step() {
    rig_.step();
    const int64_t now = rig_.now_ns();
    if (now >= next_attitude_ns_) {
      next_attitude_ns_ += 20'000'000;
      AutopilotSample sample;
      sample.timestamp_ns = now;
      sample.world_from_body = attitude(now);
      said_.push_back(sample);
    }
    if (now >= next_frame_ns_ + kLate) {
      expose(next_frame_ns_, now);
      next_frame_ns_ = std::llround(static_cast<double>(++frame_) * 1e9 / 30);
    }
  }
  void run(double seconds) {
    const int64_t until = rig_.now_ns() + std::llround(seconds * 1e9);
    while (rig_.now_ns() < until) step();
  }

  struct Seen {
    double t = 0;
    bool centred = false, measured = false, searching = false;
    double error = 0;           // of the body's place, m
    double attitude_error = 0;  // rad
    double fixed_error = 0, fixed_attitude_error = 0;
    bool fixed_measured = false;
  };
  std::vector<Seen> seen;
  ViscaRig& rig() { return rig_; }
  double seconds() const { return rig_.seconds(); }
  bool covered = false;  // the target
  double dropped = 0;    // part of the pictures without a pose

 private:
  static constexpr int64_t kLate = 35'000'000;

  Eigen::Quaterniond attitude(int64_t t) {
    return so3_exp(rng_.normal3(0.003)) * world_from_body(1e-9 * static_cast<double>(t)).rotation;
  }
  Rigid3 camera_from_pad(int64_t t) const {
    const auto head = rig_const().at(t);
    return inverse(world_from_body(1e-9 * static_cast<double>(t)) * kBodyFromBase *
                   base_from_camera(config_.frames, HeadAngles{head.pan, head.tilt})) *
           kWorldFromPad;
  }
  const SimulatedEviD30& rig_const() const { return const_cast<Loop*>(this)->rig_.device(); }

  void expose(int64_t t, int64_t now) {
    const Rigid3 truth = camera_from_pad(t);
    const auto pixel = camera_.pixel_from_camera(truth.translation);
    const Eigen::Vector2d size(camera_.width(), camera_.height());
    const Eigen::Vector2d off =
        pixel ? Eigen::Vector2d((*pixel - (size - Eigen::Vector2d::Ones()) / 2).cwiseQuotient(size))
              : Eigen::Vector2d::Ones();
    Seen frame;
    frame.t = 1e-9 * static_cast<double>(t);
    frame.centred = off.cwiseAbs().maxCoeff() <= 0.15;
    // Whole in the picture: its half side is 0.5 m.
    const double half = 0.5 / 5 * camera_.intrinsics()[0] / size.y();
    const bool in_view = !covered && off.cwiseAbs().maxCoeff() < 0.5 - half && rng_.uniform(0, 1) >= dropped;
    const auto angles = rig_.camera().at(t);
    std::optional<VehicleState> state;
    std::optional<UncertainRigid3> pose;
    std::optional<HeadControl::Glimpse> glimpse;
    if (rendered_) {
      Estimator::Aid aid;
      aid.angles = angles;
      aid.world_from_body = attitude(t);
      aid.autopilot = std::exchange(said_, {});
      Frame picture;
      picture.timestamp_ns = t;
      picture.grey = picture_of(covered ? Rigid3{Eigen::Quaterniond::Identity(), {50, 0, 5}} : truth);
      const Estimate estimate = estimator_->process(picture, aid);
      pose = estimate.pad_from_body;
      state = estimate.state;
      compare_fixed(t, frame);
    } else {
      for (const auto& sample : std::exchange(said_, {})) filter_.hear(sample);
      if (in_view) glimpse = {t, truth.translation};
      if (in_view && angles) {
        const PoseError noise = (PoseError() << rng_.normal3(0.01), rng_.normal3(0.01)).finished();
        UncertainRigid3 measured{perturb(truth, noise)};
        measured.covariance.diagonal().setConstant(1e-4);
        pose = pad_from_body_by_vision(config_.frames, measured, angles);
      }
      state = filter_.update(t, pose);
    }
    if (pose) {
      const Rigid3 expected = inverse(kWorldFromPad) * world_from_body(frame.t);
      frame.measured = true;
      frame.error = (pose->mean.translation - expected.translation).norm();
      frame.attitude_error = pose->mean.rotation.angularDistance(expected.rotation);
    }
    const auto move = control_.update(now, state, attitude(now), rig_.camera(), glimpse);
    if (move) rig_.camera().point(move->goal);
    frame.searching = move && move->searching;
    seen.push_back(frame);
  }

  cv::Mat picture_of(const Rigid3& camera_from_target) {
    return Sensor().picture(renderer_->radiance(camera_from_target), 1, ++pictures_);
  }

  // The same place seen by a camera that is fixed where the head looked best: at the target, with known
  // angles.
  void compare_fixed(int64_t t, Seen& frame) {
    const Rigid3 body = world_from_body(1e-9 * static_cast<double>(t));
    const auto head = rig_.device().at(t);
    RunConfig config = config_of(false);
    FrameChain chain = config.frames;
    chain.base_from_camera = base_from_camera(config_.frames, HeadAngles{head.pan, head.tilt});
    Frame picture;
    picture.timestamp_ns = t;
    picture.grey = picture_of(camera_from_pad(t));
    Estimator::Aid aid;
    aid.world_from_body = body.rotation * kBodyFromBase.rotation * chain.base_from_camera.rotation *
                          kBodyFromBase.rotation.conjugate();
    const Estimate estimate = fixed_estimator_->process(picture, aid);
    if (estimate.status != EstimateStatus::kOk) return;
    const auto pose = pad_from_body_by_vision(chain, estimate.camera_from_target);
    const Rigid3 expected = inverse(kWorldFromPad) * body;
    frame.fixed_measured = true;
    frame.fixed_error = (pose.mean.translation - expected.translation).norm();
    frame.fixed_attitude_error = pose.mean.rotation.angularDistance(expected.rotation);
  }

  bool rendered_;
  RunConfig config_;
  CameraModel camera_;
  ViscaRig rig_;
  HeadControl control_;
  VehicleFilter filter_;
  std::optional<Renderer> renderer_;
  std::optional<Estimator> estimator_, fixed_estimator_;
  std::vector<AutopilotSample> said_;
  TestRng rng_;
  int64_t next_frame_ns_ = 0, next_attitude_ns_ = 0, frame_ = 0;
  uint64_t pictures_ = 0;
};

double centred(const Loop& loop, double from, double to) {
  int all = 0, good = 0;
  for (const auto& frame : loop.seen) {
    if (frame.t < from || frame.t >= to) continue;
    ++all;
    good += frame.centred;
  }
  return static_cast<double>(good) / all;
}

// The first time from which on the target is measured and centred for a quarter of a second; -1: never.
double found_again(const Loop& loop, double from) {
  double since = -1;
  for (const auto& frame : loop.seen) {
    if (frame.t < from) continue;
    if (!frame.measured || !frame.centred) {
      since = -1;
    } else if (since < 0) {
      since = frame.t;
    } else if (frame.t - since > 0.25) {
      return since - from;
    }
  }
  return -1;
}

TEST(PtzLoop, KeepsTheTargetInTheMiddleForAMinute) {
  Loop loop(false);
  loop.run(63);
  const double part = centred(loop, 3, 63);
  std::printf("centred %.4f of 60 s\n", part);
  RecordProperty("centred", std::to_string(part));
  EXPECT_GE(part, 0.99);
}

TEST(PtzLoop, FindsTheTargetAgainWithinThreeSeconds) {
  for (const double covered : {0.5, 2.0, 5.0}) {
    Loop loop(false);
    loop.run(10);
    loop.covered = true;
    loop.run(covered);
    loop.covered = false;
    const double from = loop.seconds();
    loop.run(6);
    const double took = found_again(loop, from);
    std::printf("covered %.1f s: found after %.2f s\n", covered, took);
    EXPECT_GE(took, 0) << covered;
    EXPECT_LE(took, 3) << covered;
  }
  Loop loop(false);
  loop.run(10);
  loop.rig().device().knock(60 * kDeg, -20 * kDeg);
  const double from = loop.seconds();
  loop.run(6);
  const double took = found_again(loop, from);
  std::printf("knocked away: found after %.2f s\n", took);
  EXPECT_GE(took, 0);
  EXPECT_LE(took, 3);
}

TEST(PtzLoop, HoldsOnWithAHundredthOfTheBytesGarbled) {
  Loop loop(false, 0.01);
  loop.run(63);
  const double part = centred(loop, 3, 63);
  std::printf("garbled: centred %.4f\n", part);
  EXPECT_GE(part, 0.9);
}

// Rendered pictures, detection and all. The fixed camera looks at the same pictures' scene from the same
// place with its direction known exactly.
TEST(PtzLoop, TheHeadsAnglesDoNotSpoilThePose) {
  Loop loop(true);
  loop.run(5);
  double moving = 0, fixed = 0, moving_angle = 0, fixed_angle = 0;
  int both = 0, all = 0;
  for (const auto& frame : loop.seen) {
    if (frame.t < 1) continue;
    ++all;
    if (!frame.measured || !frame.fixed_measured) continue;
    ++both;
    moving += frame.error * frame.error;
    fixed += frame.fixed_error * frame.fixed_error;
    moving_angle += frame.attitude_error * frame.attitude_error;
    fixed_angle += frame.fixed_attitude_error * frame.fixed_attitude_error;
  }
  const auto rms = [&](double sum) { return std::sqrt(sum / both); };
  std::printf(
      "rendered: %d of %d frames, centred %.3f; place moving %.2f mm, fixed %.2f mm; attitude %.3f, %.3f "
      "deg\n",
      both, all, centred(loop, 1, 5), 1000 * rms(moving), 1000 * rms(fixed), rms(moving_angle) / kDeg,
      rms(fixed_angle) / kDeg);
  EXPECT_GT(both, 0.9 * all);
  EXPECT_GE(centred(loop, 1, 5), 0.99);
  EXPECT_LE(rms(moving), 1.5 * rms(fixed));
  EXPECT_LE(rms(moving_angle), 1.5 * rms(fixed_angle));
}

}  // namespace
}  // namespace perch
