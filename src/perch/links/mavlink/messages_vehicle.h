#pragma once

#include <array>
#include <cstdint>

namespace perch::mavlink {

// How the vehicle lies, where it is and what its sensors say.
// Fields in wire order, names as in MAVLink's XML, units beside them; an empty line parts the extensions.

struct GpsRawInt {  // GPS_RAW_INT
  static constexpr uint32_t kId = 24;
  uint64_t time_usec = 0;  // us
  int32_t lat = 0;         // degE7
  int32_t lon = 0;         // degE7
  int32_t alt = 0;         // mm
  uint16_t eph = 0;
  uint16_t epv = 0;
  uint16_t vel = 0;  // cm/s
  uint16_t cog = 0;  // cdeg
  uint8_t fix_type = 0;
  uint8_t satellites_visible = 0;

  int32_t alt_ellipsoid = 0;  // mm
  uint32_t h_acc = 0;         // mm
  uint32_t v_acc = 0;         // mm
  uint32_t vel_acc = 0;       // mm/s
  uint32_t hdg_acc = 0;       // degE5
  uint16_t yaw = 0;           // cdeg
};

struct RawImu {  // RAW_IMU
  static constexpr uint32_t kId = 27;
  uint64_t time_usec = 0;  // us
  int16_t xacc = 0;
  int16_t yacc = 0;
  int16_t zacc = 0;
  int16_t xgyro = 0;
  int16_t ygyro = 0;
  int16_t zgyro = 0;
  int16_t xmag = 0;
  int16_t ymag = 0;
  int16_t zmag = 0;

  uint8_t id = 0;
  int16_t temperature = 0;  // cdegC
};

struct Attitude {  // ATTITUDE
  static constexpr uint32_t kId = 30;
  uint32_t time_boot_ms = 0;  // ms
  float roll = 0;             // rad
  float pitch = 0;            // rad
  float yaw = 0;              // rad
  float rollspeed = 0;        // rad/s
  float pitchspeed = 0;       // rad/s
  float yawspeed = 0;         // rad/s
};

struct AttitudeQuaternion {  // ATTITUDE_QUATERNION
  static constexpr uint32_t kId = 31;
  uint32_t time_boot_ms = 0;  // ms
  float q1 = 0;
  float q2 = 0;
  float q3 = 0;
  float q4 = 0;
  float rollspeed = 0;   // rad/s
  float pitchspeed = 0;  // rad/s
  float yawspeed = 0;    // rad/s

  std::array<float, 4> repr_offset_q{};
};

struct LocalPositionNed {  // LOCAL_POSITION_NED
  static constexpr uint32_t kId = 32;
  uint32_t time_boot_ms = 0;  // ms
  float x = 0;                // m
  float y = 0;                // m
  float z = 0;                // m
  float vx = 0;               // m/s
  float vy = 0;               // m/s
  float vz = 0;               // m/s
};

struct GlobalPositionInt {  // GLOBAL_POSITION_INT
  static constexpr uint32_t kId = 33;
  uint32_t time_boot_ms = 0;  // ms
  int32_t lat = 0;            // degE7
  int32_t lon = 0;            // degE7
  int32_t alt = 0;            // mm
  int32_t relative_alt = 0;   // mm
  int16_t vx = 0;             // cm/s
  int16_t vy = 0;             // cm/s
  int16_t vz = 0;             // cm/s
  uint16_t hdg = 0;           // cdeg
};

struct VisionPositionEstimate {  // VISION_POSITION_ESTIMATE
  static constexpr uint32_t kId = 102;
  uint64_t usec = 0;  // us
  float x = 0;        // m
  float y = 0;        // m
  float z = 0;        // m
  float roll = 0;     // rad
  float pitch = 0;    // rad
  float yaw = 0;      // rad

  std::array<float, 21> covariance{};
  uint8_t reset_counter = 0;
};

struct HighresImu {  // HIGHRES_IMU
  static constexpr uint32_t kId = 105;
  uint64_t time_usec = 0;   // us
  float xacc = 0;           // m/s/s
  float yacc = 0;           // m/s/s
  float zacc = 0;           // m/s/s
  float xgyro = 0;          // rad/s
  float ygyro = 0;          // rad/s
  float zgyro = 0;          // rad/s
  float xmag = 0;           // gauss
  float ymag = 0;           // gauss
  float zmag = 0;           // gauss
  float abs_pressure = 0;   // hPa
  float diff_pressure = 0;  // hPa
  float pressure_alt = 0;
  float temperature = 0;  // degC
  uint16_t fields_updated = 0;

  uint8_t id = 0;
};

struct SimState {  // SIM_STATE
  static constexpr uint32_t kId = 108;
  float q1 = 0;
  float q2 = 0;
  float q3 = 0;
  float q4 = 0;
  float roll = 0;   // rad
  float pitch = 0;  // rad
  float yaw = 0;    // rad
  float xacc = 0;   // m/s/s
  float yacc = 0;   // m/s/s
  float zacc = 0;   // m/s/s
  float xgyro = 0;  // rad/s
  float ygyro = 0;  // rad/s
  float zgyro = 0;  // rad/s
  float lat = 0;    // deg
  float lon = 0;    // deg
  float alt = 0;    // m
  float std_dev_horz = 0;
  float std_dev_vert = 0;
  float vn = 0;  // m/s
  float ve = 0;  // m/s
  float vd = 0;  // m/s

  int32_t lat_int = 0;  // degE7
  int32_t lon_int = 0;  // degE7
};

struct DistanceSensor {  // DISTANCE_SENSOR
  static constexpr uint32_t kId = 132;
  uint32_t time_boot_ms = 0;      // ms
  uint16_t min_distance = 0;      // cm
  uint16_t max_distance = 0;      // cm
  uint16_t current_distance = 0;  // cm
  uint8_t type = 0;
  uint8_t id = 0;
  uint8_t orientation = 0;
  uint8_t covariance = 0;  // cm^2

  float horizontal_fov = 0;  // rad
  float vertical_fov = 0;    // rad
  std::array<float, 4> quaternion{};
  uint8_t signal_quality = 0;  // %
};

struct Odometry {  // ODOMETRY
  static constexpr uint32_t kId = 331;
  uint64_t time_usec = 0;  // us
  float x = 0;             // m
  float y = 0;             // m
  float z = 0;             // m
  std::array<float, 4> q{};
  float vx = 0;          // m/s
  float vy = 0;          // m/s
  float vz = 0;          // m/s
  float rollspeed = 0;   // rad/s
  float pitchspeed = 0;  // rad/s
  float yawspeed = 0;    // rad/s
  std::array<float, 21> pose_covariance{};
  std::array<float, 21> velocity_covariance{};
  uint8_t frame_id = 0;
  uint8_t child_frame_id = 0;

  uint8_t reset_counter = 0;
  uint8_t estimator_type = 0;
  int8_t quality = 0;  // %
};

}  // namespace perch::mavlink
