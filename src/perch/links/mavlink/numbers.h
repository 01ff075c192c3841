#pragma once

#include <cstdint>

namespace perch::mavlink {

// MAVLink's enumerations, of each only what Perch sends or looks at (common.xml, minimal.xml).

namespace mav_type {
inline constexpr uint8_t kGcs = 6;
inline constexpr uint8_t kOnboardController = 18;
inline constexpr uint8_t kGimbal = 26;
}  // namespace mav_type

namespace mav_autopilot {
inline constexpr uint8_t kArdupilot = 3;
inline constexpr uint8_t kInvalid = 8;  // no autopilot: a camera, a gimbal, a ground station
inline constexpr uint8_t kPx4 = 12;
}  // namespace mav_autopilot

namespace mav_component {
inline constexpr uint8_t kAutopilot = 1;
inline constexpr uint8_t kOnboardComputer = 191;
}  // namespace mav_component

inline constexpr uint8_t kStateActive = 4;          // MAV_STATE
inline constexpr uint8_t kModeFlagArmed = 128;      // MAV_MODE_FLAG_SAFETY_ARMED
inline constexpr uint8_t kLandedStateOnGround = 1;  // MAV_LANDED_STATE
inline constexpr uint8_t kOrientationDown = 25;     // MAV_SENSOR_ROTATION_PITCH_270
inline constexpr uint8_t kTargetTypeFiducial = 2;   // LANDING_TARGET_TYPE_VISION_FIDUCIAL
inline constexpr uint8_t kMavlinkVersion = 3;       // HEARTBEAT.mavlink_version, of MAVLink 1 and 2 alike

namespace mav_frame {
inline constexpr uint8_t kLocalNed = 1;
inline constexpr uint8_t kBodyFrd = 12;
}  // namespace mav_frame

namespace target_frame {  // TARGET_OBS_FRAME of TARGET_RELATIVE
inline constexpr uint8_t kBodyFrd = 1;
inline constexpr uint8_t kLocalOffsetNed = 2;  // axes of NED, origin at the vehicle
}  // namespace target_frame

namespace mav_command {
inline constexpr uint16_t kSetMessageInterval = 511;  // param1 id, param2 interval in us
inline constexpr uint16_t kRequestMessage = 512;      // param1 id
inline constexpr uint16_t kGimbalManagerConfigure =
    1001;  // param1, 2 who controls, -1 in 3, 4: as it is, 7 the gimbal
}  // namespace mav_command

namespace mav_result {
inline constexpr uint8_t kAccepted = 0;
inline constexpr uint8_t kTemporarilyRejected = 1;
inline constexpr uint8_t kDenied = 2;
inline constexpr uint8_t kUnsupported = 3;
inline constexpr uint8_t kFailed = 4;
}  // namespace mav_result

namespace mav_severity {
inline constexpr uint8_t kWarning = 4;
inline constexpr uint8_t kInfo = 6;
}  // namespace mav_severity

namespace mav_param_type {
inline constexpr uint8_t kUint8 = 1;
inline constexpr uint8_t kInt8 = 2;
inline constexpr uint8_t kUint16 = 3;
inline constexpr uint8_t kInt16 = 4;
inline constexpr uint8_t kUint32 = 5;
inline constexpr uint8_t kInt32 = 6;
inline constexpr uint8_t kReal32 = 9;
}  // namespace mav_param_type

}  // namespace perch::mavlink
