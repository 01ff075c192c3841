#pragma once

#include <cstdint>
#include <optional>

#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/vehicle_history.h"
#include "perch/ptz/ptz_camera.h"

namespace perch::mavlink {

struct GimbalOptions {
  uint8_t system = 1;   // the vehicle's
  uint8_t manager = 1;  // the component that manages the gimbal: usually the autopilot
  uint8_t our_system = 1, our_component = 191;
  uint8_t device = 0;  // the gimbal's id; 0: all
  // What most three-axis gimbals can do; the limits are the manager's to keep.
  HeadModel head = {{-2.7, 2.7, 1.5, 0, 0}, {-1.57, 0.5, 1.5, 0, 0}};
};

// A gimbal by the gimbal protocol v2, through its manager: control is taken first
// (DO_GIMBAL_MANAGER_CONFIGURE), again and again until it is acknowledged and whenever GIMBAL_MANAGER_STATUS
// says that somebody else has it, then GIMBAL_MANAGER_SET_PITCHYAW moves it. Where it is
// GIMBAL_DEVICE_ATTITUDE_STATUS says, which VehicleLink keeps in its history: against the horizon and either
// north or the vehicle's heading, so that the vehicle's own attitude at that moment turns it into the angles
// of a head. Its base has the axes of a camera that looks forward (x right, y down, z forward): pan is the
// yaw, tilt the pitch, and the roll what is left of the vehicle's.
class GimbalCamera : public PtzCamera {
 public:
  // `history` must outlive it, and is read under the caller's lock.
  GimbalCamera(const GimbalOptions& options, const VehicleHistory& history);

  void receive(const CommandAck& ack);
  void receive(const GimbalManagerStatus& status);

  struct Outgoing {
    std::optional<CommandLong> command;
    std::optional<GimbalManagerSetPitchyaw> set;
  };
  // What to send now.
  Outgoing tick(int64_t now_ns);

  void point(const HeadGoal& goal) override;
  void zoom_to(double) override {}  // the camera's, not the gimbal's
  std::optional<HeadAngles> at(int64_t time_ns) const override;
  std::optional<double> zoom() const override { return std::nullopt; }
  HeadModel model() const override { return options_.head; }
  bool ready() const override { return control_; }

 private:
  GimbalManagerSetPitchyaw set_of(const HeadGoal& goal) const;

  GimbalOptions options_;
  const VehicleHistory& history_;
  bool control_ = false;
  std::optional<int64_t> asked_ns_;
  int64_t sent_ns_ = 0, now_ns_ = 0;
  std::optional<HeadGoal> goal_;
};

// GIMBAL_MANAGER_FLAGS and GIMBAL_DEVICE_FLAGS alike: the yaw is against the vehicle, and does not stay with
// north.
inline constexpr uint32_t kGimbalYawInVehicleFrame = 32;

}  // namespace perch::mavlink
