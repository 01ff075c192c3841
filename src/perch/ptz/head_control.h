#pragma once

#include <cstdint>
#include <optional>

#include "perch/camera/camera_model.h"
#include "perch/ptz/ptz_camera.h"
#include "perch/ptz/search_pattern.h"
#include "perch/tracking/vehicle_state.h"

namespace perch {

struct HeadControlOptions {
  // Nearer than this, and slow, the head rests: half a degree is a hundredth of the EVI-D30's picture.
  double dead_band = 0.5 * 0.017453292519943295;  // rad
  // Of the error a second. The head's own delay allows about 1 / (2 x 0.08 s) without ringing.
  double gain = 4;
  // From a command's making to its effect: its bytes at 9600 baud, a turn of the line, and the device's
  // picture.
  double lag = 0.05;  // s
};

// Keeps the target in the middle of the picture: speeds for the head, made anew with each picture.
//
//   speed = d/dt a(t) + gain (a(t) - head(t)),   t = now + lag
//
// a(t) are the angles that centre the target where the tracked velocity takes it by then (angles_to_see_at).
// When the target is lost: search, first about where it should be.
class HeadControl {
 public:
  // Throws std::invalid_argument when the chain has no moving head.
  HeadControl(const FrameChain& chain, const CameraModel& camera, const HeadModel& model,
              const HeadControlOptions& options = {});

  struct Move {
    HeadGoal goal;  // kDrive
    bool searching = false;
  };
  // Where a picture shows the target, though nobody knows the head's angles well enough to measure with them.
  struct Glimpse {
    int64_t time_ns = 0;
    Eigen::Vector3d target_in_camera = Eigen::Vector3d::Zero();
  };
  // `state`: of the last picture. `glimpse`: followed where there is no state. `world_from_body`: the
  // attitude now, where it is known. No move when the head does not say where it is: a search in the dark
  // finds nothing.
  std::optional<Move> update(int64_t now_ns, const std::optional<VehicleState>& state,
                             const std::optional<Eigen::Quaterniond>& world_from_body, const PtzCamera& head,
                             const std::optional<Glimpse>& glimpse = {});

  // What centres the target at a time; empty when no angles do.
  std::optional<HeadAngles> centring(const VehicleState& state, int64_t time_ns) const;

  // The lens at another zoom: the dead band is a part of the picture.
  void look_through(const CameraModel& camera);

  // How far the target is and how fast it comes nearer, and how far off the middle it is or may get before
  // the head has followed. Empty when nobody knows.
  struct Sight {
    double distance = 0;  // m
    double closing = 0;   // m/s
    double aside = 0;     // rad
  };
  std::optional<Sight> sight(const VehicleState& state, int64_t now_ns, const PtzCamera& head) const;

 private:
  struct Seen {
    int64_t time_ns = 0;
    Eigen::Vector3d target =
        Eigen::Vector3d::Zero();  // from the body; axes of the world where they are known
    Eigen::Vector3d velocity = Eigen::Vector3d::Zero();  // m/s
    bool in_world = false;
  };

  std::optional<HeadAngles> centring(const Eigen::Vector3d& target_in_body) const;
  void remember(const VehicleState& state, int64_t now_ns,
                const std::optional<Eigen::Quaterniond>& world_from_body);
  bool remember(const Glimpse& glimpse, int64_t now_ns,
                const std::optional<Eigen::Quaterniond>& world_from_body, const PtzCamera& head);
  HeadAngles expected(int64_t time_ns, const std::optional<Eigen::Quaterniond>& world_from_body) const;
  double speed(const AxisLimits& axis, double goal, double goal_rate, double angle) const;

  FrameChain chain_;
  Rigid3 zero_from_body_;
  Eigen::Vector3d middle_ray_;
  double widest_, view_;  // the smaller angle of the picture at first, and now, rad
  HeadModel model_;
  HeadControlOptions options_;
  SearchPattern search_;
  std::optional<Seen> seen_;
  std::optional<int64_t> lost_since_ns_;
};

}  // namespace perch
