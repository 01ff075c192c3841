#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

#include "perch/analysis/frame_look.h"
#include "perch/estimator/estimate.h"
#include "perch/flight/flight.h"
#include "perch/frames/frame_chain.h"

namespace perch {

// A pose of the body in the pad frame as the paper's figure 3.4 plots it: x, y, z [m], then the ZYX angles
// yaw, pitch, roll [rad].
using SixStates = Eigen::Matrix<double, 6, 1>;
inline constexpr std::array<std::string_view, 6> kStateNames = {"x", "y", "z", "yaw", "pitch", "roll"};
inline constexpr bool is_angle(size_t state) { return state >= 3; }

SixStates six_states(const Rigid3& pad_from_body);

// The standard deviations of the six states. The angles' are infinite or NaN at pitch = +-pi/2, where a small
// rotation can be any change of yaw and roll.
SixStates six_sigmas(const UncertainRigid3& pad_from_body);

// How far vision is from a reference: navigation, or the flight's own truth.
struct FrameError {
  SixStates difference = SixStates::Zero();  // vision minus reference; angles wrapped to (-pi, pi]
  double position = 0;                       // length of the position's difference, m
  double rotation = 0;  // angle between the two attitudes, rad: free of the ZYX angles' pole
  // Where the reference tells no attitude, angles, rotation and seen_position are NaN.
  // Of the target's origin as the camera sees it, m: what the picture gives, before the attitude's error
  // swings the body about the pad.
  double seen_position = 0;
  // Normalised error squared of camera_from_target under its covariance; empty when that is not positive
  // definite. The reference's own noise is not in it: against navigation it counts as vision's.
  std::optional<double> nees;
};

// What the analysis keeps of an estimate: some 500 bytes, so that a long flight's correspondences can go.
struct FrameRecord {
  int64_t timestamp_ns = 0;  // camera clock
  EstimateStatus status = EstimateStatus::kNoTarget;
  double total_us = 0;
  double ambiguity = 0;
  int threshold = -1;                                       // grey level, where the method had one
  GreyHistogram grey;                                       // of the picture
  std::optional<double> nis;                                // the filter's normalised innovation squared
  double speed = std::numeric_limits<double>::quiet_NaN();  // of the body by navigation, m/s
  // With kOk:
  double range = std::numeric_limits<double>::quiet_NaN();       // camera to the target's origin, m
  double view_angle = std::numeric_limits<double>::quiet_NaN();  // line of sight to the target's normal, rad
  std::optional<TargetLook> look;
  double reprojection_rms_px = std::numeric_limits<double>::quiet_NaN();
  int features = 0;
  std::optional<SixStates> vision, sigma;
  // Wherever navigation and world_from_pad are there, detected or not:
  std::optional<SixStates> navigation;
  // Where both are:
  std::optional<FrameError> error;
  // Where the flight holds its exact truth beside navigation:
  std::optional<FrameError> truth_error;
};

FrameRecord make_frame_record(const Estimate& estimate, const FrameChain& chain, const Flight& flight);

// The frame's error against the truth, or against navigation.
inline const std::optional<FrameError>& error_of(const FrameRecord& frame, bool against_truth) {
  return against_truth ? frame.truth_error : frame.error;
}

// Of an estimate that has pad_from_body. `reference` is the body in the pad frame, by navigation or truth.
FrameError frame_error(const Estimate& estimate, const FrameChain& chain, const Rigid3& reference);

}  // namespace perch
