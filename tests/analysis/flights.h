#pragma once

#include <cmath>

#include "perch/analysis/score.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "support/rng.h"

namespace perch {

// A flight that never was: navigation is exact, and vision is navigation plus what the test adds.
struct MadeUpFlight {
  int frames = 100;
  SixStates offset = SixStates::Zero();  // added to each pose: m, and rad of the ZYX angles
  double noise = 0;                      // standard deviation of position, m; a tenth of it of rotation, rad
  double yaw = 0.3;                      // of the vehicle
};

inline constexpr int64_t kFrameNs = 33'333'333;
inline constexpr int64_t kStartNs = 1'700'000'000'000'000'000;

// A descent from 9 m to 1 m over the pad, down-looking.
inline Rigid3 descent(double s, double yaw) {
  const YawPitchRoll angles{yaw + 0.2 * std::sin(3 * s), 0.05 * std::sin(20 * s),
                            M_PI + 0.04 * std::cos(17 * s)};
  return {rotation_from_ypr(angles), {1.5 * (1 - s) * std::cos(4 * s), (1 - s) * std::sin(5 * s), 9 - 8 * s}};
}

inline FlightResult make_flight(const MadeUpFlight& made, TestRng& rng) {
  FlightResult result;
  result.flight.name = "made_up";
  result.target = "sharp, 1 m";
  result.chain.world_from_pad = Rigid3{};
  for (int i = 0; i < made.frames; ++i) {
    const int64_t time = kStartNs + i * kFrameNs;
    const Rigid3 truth = descent(made.frames > 1 ? i / (made.frames - 1.0) : 0.5, made.yaw);
    result.flight.nav.samples.push_back({time, truth, Eigen::Vector3d::Zero()});

    SixStates states = six_states(truth) + made.offset;
    UncertainRigid3 vision;
    vision.mean = {rotation_from_ypr({states[3], states[4], states[5]}), states.head<3>()};
    PoseError noise;
    noise << rng.normal3(made.noise), rng.normal3(made.noise / 10);
    vision.mean = perturb(vision.mean, noise);
    vision.covariance.diagonal() << Eigen::Vector3d::Constant(made.noise * made.noise),
        Eigen::Vector3d::Constant(made.noise * made.noise / 100);

    Estimate estimate;
    estimate.timestamp_ns = time;
    estimate.status = EstimateStatus::kOk;
    estimate.pad_from_body = vision;
    estimate.camera_from_target = inverse(vision);
    estimate.reprojection_rms_px = 0.2;
    estimate.features = 24;
    estimate.stages = {{"threshold", 10}, {"segmentation", 20}, {"refine", 30}};
    estimate.detect_us = 30;
    estimate.pose_us = 30;
    estimate.total_us = 80;
    result.estimates.push_back(estimate);
    result.frame_names.push_back(std::to_string(i) + ".png");
  }
  return result;
}

inline void lose(FlightResult& result, size_t frame, EstimateStatus why) {
  Estimate& estimate = result.estimates[frame];
  estimate.status = why;
  estimate.pad_from_body.reset();
  estimate.camera_from_target = {};
}

}  // namespace perch
