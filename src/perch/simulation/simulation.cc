#include "perch/simulation/simulation.h"

#include <cmath>

#include "perch/geometry/euler.h"

namespace perch {

namespace {

constexpr int64_t kStartNs = 1700000000000000000;  // a date like any other
// Numbers of the independent random streams of one seed.
constexpr uint64_t kDescentStream = 1, kNavigationStream = 2, kPictureStream = 3, kDeckStream = 4;

uint64_t stream_seed(uint64_t seed, uint64_t stream) { return RandomStream(seed, stream).bits(); }

// Rounded from the start, not added up: 30 Hz has no whole number of nanoseconds.
int64_t frame_ns(int64_t frame, double rate_hz) {
  return std::llround(static_cast<double>(frame) / rate_hz * 1e9);
}

}  // namespace

Simulation::Simulation()
    // The camera's x is the body's y (right), its y backwards, its z down; then 8 degrees of pitch.
    : body_from_camera{rotation_from_ypr({0, 8 * kRadFromDeg, 0}) * rotation_from_ypr({M_PI / 2, 0, 0}),
                       {0.1, 0, 0.05}},
      world_from_pad{rotation_from_ypr({25 * kRadFromDeg, 0, M_PI}), {12, -7, -0.4}} {}

SimulatedFlight::SimulatedFlight(const Simulation& simulation)
    : simulation_(simulation),
      descent_(simulation.flight, simulation.world_from_pad.translation,
               stream_seed(simulation.seed, kDescentStream)),
      deck_(simulation.deck, simulation.world_from_pad, stream_seed(simulation.seed, kDeckStream)),
      renderer_(simulation.camera, simulation.target, simulation.picture.scene, simulation.picture.optics),
      sensor_(simulation.picture.sensor) {}

int64_t SimulatedFlight::frames() const {
  return static_cast<int64_t>(std::floor(descent_.duration() * simulation_.rate_hz)) + 1;
}

int64_t SimulatedFlight::timestamp_ns(int64_t frame) const {
  return kStartNs + frame_ns(frame, simulation_.rate_hz);
}

double SimulatedFlight::time(int64_t frame) const {
  return static_cast<double>(frame_ns(frame, simulation_.rate_hz)) * 1e-9;
}

VehicleTruth SimulatedFlight::vehicle(int64_t frame) const { return vehicle_at(time(frame)); }
VehicleTruth SimulatedFlight::vehicle_at(double time) const { return descent_.at(time); }

PadTruth SimulatedFlight::pad(int64_t frame) const { return pad_at(time(frame)); }
PadTruth SimulatedFlight::pad_at(double time) const { return deck_.at(time); }

Rigid3 SimulatedFlight::pad_from_body(int64_t frame) const {
  return inverse(pad(frame).world_from_pad) * vehicle(frame).world_from_body;
}

// p = Q^T (P_body - P_pad): p' = Q^T (V_body - V_pad) - W x p.
Eigen::Vector3d SimulatedFlight::body_velocity_in_pad(int64_t frame) const {
  const PadTruth pad_truth = pad(frame);
  const Eigen::Vector3d apart = vehicle(frame).body_velocity_in_world - pad_truth.pad_velocity_in_world;
  return pad_truth.world_from_pad.rotation.conjugate() * apart -
         pad_truth.angular_velocity_in_pad.cross(pad_from_body(frame).translation);
}

Rigid3 SimulatedFlight::camera_from_target_at(double time, const HeadAngles& head) const {
  FrameChain chain;
  chain.pan_tilt.emplace();
  const Rigid3 world_from_camera =
      descent_.at(time).world_from_body * simulation_.body_from_camera * base_from_camera(chain, head);
  return inverse(world_from_camera) * deck_.at(time).world_from_pad;
}

Rigid3 SimulatedFlight::camera_from_target(int64_t frame) const {
  return camera_from_target_at(time(frame), {});
}

cv::Mat_<uint8_t> SimulatedFlight::picture(int64_t frame, const HeadAngles& head) const {
  const double middle = time(frame);
  const PoseAt pose = [&](double t) { return camera_from_target_at(middle + t, head); };
  const auto radiance = renderer_.radiance(pose, simulation_.shutter, middle);
  return sensor_.picture(radiance, stream_seed(simulation_.seed, kPictureStream),
                         static_cast<uint64_t>(frame));
}

std::vector<NavigationReport> SimulatedFlight::navigation() const {
  return navigate(descent_, simulation_.nav, kStartNs, stream_seed(simulation_.seed, kNavigationStream));
}

}  // namespace perch
