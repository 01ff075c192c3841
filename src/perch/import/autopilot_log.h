#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "perch/flight/nav_track.h"

namespace perch {

struct GyroSample {
  int64_t timestamp_ns = 0;
  Eigen::Vector3d angular_velocity_in_body = Eigen::Vector3d::Zero();  // of the body in the world, rad/s
};

// What an autopilot's log tells of a flight. World NED, body FRD, as both autopilots have them.
struct AutopilotLog {
  std::string kind;              // "PX4 ULog", "ArduPilot DataFlash"
  NavTrack nav;                  // at the times of the denser of attitude and position
  std::vector<GyroSample> gyro;  // times strictly increasing; empty where the log has none
  std::string attitude_from, position_from, gyro_from;  // the messages
  // The log's clock counts since the autopilot's start. Where GPS told the time, all times above have this
  // added: they are since 1970, as well as GPS's own delay of some 0.2 s lets them be.
  std::optional<int64_t> unix_minus_boot_ns;
  std::vector<std::string> problems;
};

// Whether the file begins as one of the two.
bool is_autopilot_log(const std::filesystem::path& file);

// Throws std::runtime_error naming the file and the cause: no such log, or no attitude or position in it,
// with the messages it has.
AutopilotLog read_autopilot_log(const std::filesystem::path& file);

}  // namespace perch
