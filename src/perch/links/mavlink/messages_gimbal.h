#pragma once

#include <array>
#include <cstdint>

namespace perch::mavlink {

// Where a gimbal points, and how it is told to.
// Fields in wire order, names as in MAVLink's XML, units beside them; an empty line parts the extensions.

struct MountOrientation {  // MOUNT_ORIENTATION
  static constexpr uint32_t kId = 265;
  uint32_t time_boot_ms = 0;  // ms
  float roll = 0;             // deg
  float pitch = 0;            // deg
  float yaw = 0;              // deg

  float yaw_absolute = 0;  // deg
};

struct CameraFovStatus {  // CAMERA_FOV_STATUS
  static constexpr uint32_t kId = 271;
  uint32_t time_boot_ms = 0;  // ms
  int32_t lat_camera = 0;     // degE7
  int32_t lon_camera = 0;     // degE7
  int32_t alt_camera = 0;     // mm
  int32_t lat_image = 0;      // degE7
  int32_t lon_image = 0;      // degE7
  int32_t alt_image = 0;      // mm
  std::array<float, 4> q{};
  float hfov = 0;  // deg
  float vfov = 0;  // deg

  uint8_t camera_device_id = 0;
};

struct GimbalManagerInformation {  // GIMBAL_MANAGER_INFORMATION
  static constexpr uint32_t kId = 280;
  uint32_t time_boot_ms = 0;  // ms
  uint32_t cap_flags = 0;
  float roll_min = 0;   // rad
  float roll_max = 0;   // rad
  float pitch_min = 0;  // rad
  float pitch_max = 0;  // rad
  float yaw_min = 0;    // rad
  float yaw_max = 0;    // rad
  uint8_t gimbal_device_id = 0;
};

struct GimbalManagerStatus {  // GIMBAL_MANAGER_STATUS
  static constexpr uint32_t kId = 281;
  uint32_t time_boot_ms = 0;  // ms
  uint32_t flags = 0;
  uint8_t gimbal_device_id = 0;
  uint8_t primary_control_sysid = 0;
  uint8_t primary_control_compid = 0;
  uint8_t secondary_control_sysid = 0;
  uint8_t secondary_control_compid = 0;
};

struct GimbalDeviceInformation {  // GIMBAL_DEVICE_INFORMATION
  static constexpr uint32_t kId = 283;
  uint64_t uid = 0;
  uint32_t time_boot_ms = 0;  // ms
  uint32_t firmware_version = 0;
  uint32_t hardware_version = 0;
  float roll_min = 0;   // rad
  float roll_max = 0;   // rad
  float pitch_min = 0;  // rad
  float pitch_max = 0;  // rad
  float yaw_min = 0;    // rad
  float yaw_max = 0;    // rad
  uint16_t cap_flags = 0;
  uint16_t custom_cap_flags = 0;
  std::array<char, 32> vendor_name{};
  std::array<char, 32> model_name{};
  std::array<char, 32> custom_name{};

  uint8_t gimbal_device_id = 0;
};

struct GimbalDeviceSetAttitude {  // GIMBAL_DEVICE_SET_ATTITUDE
  static constexpr uint32_t kId = 284;
  std::array<float, 4> q{};
  float angular_velocity_x = 0;  // rad/s
  float angular_velocity_y = 0;  // rad/s
  float angular_velocity_z = 0;  // rad/s
  uint16_t flags = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
};

struct GimbalDeviceAttitudeStatus {  // GIMBAL_DEVICE_ATTITUDE_STATUS
  static constexpr uint32_t kId = 285;
  uint32_t time_boot_ms = 0;  // ms
  std::array<float, 4> q{};
  float angular_velocity_x = 0;  // rad/s
  float angular_velocity_y = 0;  // rad/s
  float angular_velocity_z = 0;  // rad/s
  uint32_t failure_flags = 0;
  uint16_t flags = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;

  float delta_yaw = 0;           // rad
  float delta_yaw_velocity = 0;  // rad/s
  uint8_t gimbal_device_id = 0;
};

struct AutopilotStateForGimbalDevice {  // AUTOPILOT_STATE_FOR_GIMBAL_DEVICE
  static constexpr uint32_t kId = 286;
  uint64_t time_boot_us = 0;  // us
  std::array<float, 4> q{};
  uint32_t q_estimated_delay_us = 0;          // us
  float vx = 0;                               // m/s
  float vy = 0;                               // m/s
  float vz = 0;                               // m/s
  uint32_t v_estimated_delay_us = 0;          // us
  float feed_forward_angular_velocity_z = 0;  // rad/s
  uint16_t estimator_status = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  uint8_t landed_state = 0;

  float angular_velocity_z = 0;  // rad/s
};

struct GimbalManagerSetPitchyaw {  // GIMBAL_MANAGER_SET_PITCHYAW
  static constexpr uint32_t kId = 287;
  uint32_t flags = 0;
  float pitch = 0;       // rad
  float yaw = 0;         // rad
  float pitch_rate = 0;  // rad/s
  float yaw_rate = 0;    // rad/s
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  uint8_t gimbal_device_id = 0;
};

}  // namespace perch::mavlink
