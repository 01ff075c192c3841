#pragma once

#include <array>
#include <cstdint>

namespace perch::mavlink {

// What a landing is told of its target.
// Fields in wire order, names as in MAVLink's XML, units beside them; an empty line parts the extensions.

struct LandingTarget {  // LANDING_TARGET
  static constexpr uint32_t kId = 149;
  uint64_t time_usec = 0;  // us
  float angle_x = 0;       // rad
  float angle_y = 0;       // rad
  float distance = 0;      // m
  float size_x = 0;        // rad
  float size_y = 0;        // rad
  uint8_t target_num = 0;
  uint8_t frame = 0;

  float x = 0;  // m
  float y = 0;  // m
  float z = 0;  // m
  std::array<float, 4> q{};
  uint8_t type = 0;
  uint8_t position_valid = 0;
};

struct TargetAbsolute {  // TARGET_ABSOLUTE
  static constexpr uint32_t kId = 510;
  uint64_t timestamp = 0;      // us
  int32_t lat = 0;             // degE7
  int32_t lon = 0;             // degE7
  float alt = 0;               // m
  std::array<float, 3> vel{};  // m/s
  std::array<float, 3> acc{};  // m/s/s
  std::array<float, 4> q_target{};
  std::array<float, 3> rates{};         // rad/s
  std::array<float, 2> position_std{};  // m
  std::array<float, 3> vel_std{};       // m/s
  std::array<float, 3> acc_std{};       // m/s/s
  uint8_t id = 0;
  uint8_t sensor_capabilities = 0;
};

struct TargetRelative {  // TARGET_RELATIVE
  static constexpr uint32_t kId = 511;
  uint64_t timestamp = 0;          // us
  float x = 0;                     // m
  float y = 0;                     // m
  float z = 0;                     // m
  std::array<float, 3> pos_std{};  // m
  float yaw_std = 0;               // rad
  std::array<float, 4> q_target{};
  std::array<float, 4> q_sensor{};
  uint8_t id = 0;
  uint8_t frame = 0;
  uint8_t type = 0;
};

}  // namespace perch::mavlink
