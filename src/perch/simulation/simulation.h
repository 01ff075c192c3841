#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "perch/frames/frame_chain.h"
#include "perch/simulation/deck.h"
#include "perch/simulation/descent.h"
#include "perch/simulation/navigation.h"
#include "perch/simulation/picture.h"
#include "perch/target/landing_target.h"

namespace perch {

// All of a simulated landing: what configs/simulation/*.yaml say. The pad is the target (target_from_pad
// identity).
struct Simulation {
  std::filesystem::path target_file;
  LandingTarget target;
  CameraModel camera = CameraModel::pinhole(450, 450, 319.5, 239.5, 640, 480);
  double rate_hz = 30;
  // Under the nose, looking down and 8 degrees forward; up in the picture is forward.
  Rigid3 body_from_camera;
  // Who tells where a head turns the camera to (perch-visca-sim --truth); empty: it is fixed.
  // body_from_camera is then that at zero angles. For pictures as they happen alone: a head answers to what
  // is seen.
  std::string head;
  // Its focal length at the narrow end over that at the wide one, which `camera` has; in between a power.
  double zoom_ratio = 1;
  // Level, face up: the pad's z is -z of NED.
  Rigid3 world_from_pad;
  // A pad on a ship moves about that place; the flight goes to it, too, and does not follow the deck.
  std::optional<DeckOptions> deck;
  ShutterOptions shutter;
  PictureOptions picture;
  DescentOptions flight;
  NavigationOptions nav;
  uint64_t seed = 1;

  Simulation();
};

// Reads `target`, `camera`, `flight`, `deck`, `scene`, `sensor`, `nav` and `seed`, refuses unknown keys.
// Every key has a default but `target`. Throws ConfigError.
Simulation read_simulation(Section root);

// A simulation in flight. Const calls may run in several threads: frames depend on nothing but their number.
class SimulatedFlight {
 public:
  explicit SimulatedFlight(const Simulation& simulation);

  int64_t frames() const;
  int64_t timestamp_ns(int64_t frame) const;  // mid-exposure, camera clock
  VehicleTruth vehicle(int64_t frame) const;  // then
  PadTruth pad(int64_t frame) const;
  VehicleTruth vehicle_at(double time) const;  // at any time in s since the start, that of frame 0
  PadTruth pad_at(double time) const;
  Rigid3 pad_from_body(int64_t frame) const;
  Eigen::Vector3d body_velocity_in_pad(int64_t frame) const;  // as seen from the pad, m/s
  Rigid3 camera_from_target(int64_t frame) const;
  cv::Mat_<uint8_t> picture(int64_t frame, const HeadAngles& head = {}) const;
  std::vector<NavigationReport> navigation() const;
  const Simulation& simulation() const { return simulation_; }

 private:
  double time(int64_t frame) const;  // since the start, s
  Rigid3 camera_from_target_at(double time, const HeadAngles& head) const;

  Simulation simulation_;
  Descent descent_;
  Deck deck_;
  Renderer renderer_;
  Sensor sensor_;
};

}  // namespace perch
