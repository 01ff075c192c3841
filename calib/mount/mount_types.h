#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/flight/flight.h"
#include "perch/frames/frame_chain.h"
#include "perch/pose/reprojection.h"

namespace perch {

// What one picture tells: where the target is, and the points that say so.
struct Sighting {
  int64_t timestamp_ns = 0;  // camera clock
  size_t frame = 0;          // of the flight
  // Absent: the picture leaves two poses, and only the rest of the flight can choose.
  std::optional<UncertainRigid3> camera_from_target;
  std::vector<Observation> observations;
};

struct MountFlight {
  std::string name;
  CameraModel camera = CameraModel::pinhole(500, 500, 320, 240, 641, 481);
  std::vector<Sighting> sightings;  // in the order of time
  NavTrack nav;
  std::vector<GimbalSample> gimbal;
};

// Deviations of the navigation source. NaN: measured from the flights themselves.
struct NavigationNoise {
  static constexpr double kMeasured = std::numeric_limits<double>::quiet_NaN();
  double position = kMeasured;        // of each axis and sample, m
  double rotation = kMeasured;        // rad
  double position_drift = kMeasured;  // of the slowly varying part, m
  double rotation_drift = kMeasured;  // rad
  double drift_time = kMeasured;      // its correlation time, s
};

// A prior: what is known from elsewhere, with deviations; infinite: nothing.
struct PosePrior {
  Rigid3 mean;
  Eigen::Vector3d position_sigma = Eigen::Vector3d::Constant(INFINITY);  // m
  Eigen::Vector3d rotation_sigma = Eigen::Vector3d::Constant(INFINITY);  // rad
  bool is_given() const {
    return position_sigma.minCoeff() < INFINITY || rotation_sigma.minCoeff() < INFINITY;
  }
};

struct MountPriors {
  std::optional<PosePrior> body_from_base, world_from_pad;
  std::optional<double> time_offset, time_offset_sigma;  // s
};

struct MountOptions {
  bool shared_pad = false;     // all flights over one pad; else each has its own
  bool shared_offset = false;  // one clock offset; else each flight has its own
  double offset_reach = 0.25;  // s, to either side of frames.time_offset
  NavigationNoise noise;
  MountPriors priors;
  // What is not known better than this is not written without a prior.
  double largest_rotation_sigma = 0.5 * 0.017453292519943295;  // rad
  double largest_position_sigma = 0.05;                        // m
  double largest_offset_sigma = 0.010;                         // s
  double largest_pad_sigma = 0.25;                             // m
};

// The unknowns of a pan/tilt head, about its nominal axes: see head_of().
inline constexpr int kHeadSize = 11;
using HeadVector = Eigen::Matrix<double, kHeadSize, 1>;
inline constexpr std::array<const char*, kHeadSize> kHeadNames = {
    "pan axis direction 1", "pan axis direction 2",  "pan axis point 1",
    "pan axis point 2",     "tilt axis direction 1", "tilt axis direction 2",
    "tilt axis point 1",    "tilt axis point 2",     "pan scale",
    "tilt scale",           "head latency"};

// Everything that is sought. With a pan/tilt head the turns at reading 0 belong to the mount: `mount` is then
// the camera's pose at zero readings.
struct MountState {
  Rigid3 mount;                 // body_from_base; with a head body_from_zero
  std::vector<Rigid3> pads;     // world_from_pad, of each flight or one
  std::vector<double> offsets;  // camera clock minus navigation clock, of each flight or one, s
  HeadVector head = HeadVector::Zero();
};

}  // namespace perch
