#pragma once

#include <vector>

#include "perch/import/autopilot_log.h"
#include "perch/import/log_tables.h"

namespace perch {

// A log's attitudes and positions come in messages of their own, each with its own times.

struct AttitudeSample {
  int64_t timestamp_ns = 0;
  Eigen::Quaterniond world_from_body = Eigen::Quaterniond::Identity();
};

struct PositionSample {
  int64_t timestamp_ns = 0;
  Eigen::Vector3d body_in_world = Eigen::Vector3d::Zero();  // m
  std::optional<Eigen::Vector3d> body_velocity_in_world;    // m/s
};

struct LogMotion {
  std::vector<AttitudeSample> attitudes;
  std::vector<PositionSample> positions;
  std::vector<GyroSample> gyro;
  std::string attitude_from, position_from, gyro_from;  // the messages; where there are none, those expected
  std::vector<int64_t> unix_minus_boot_ns;              // as each GPS message says
  std::vector<std::string> problems;
};

// The messages that these read, and what they make of them. Rows with NaN or that the autopilot calls invalid
// are left out; times may be in any order.
std::span<const std::string_view> ulog_topics();
LogMotion motion_of_ulog(const LogTables& log, const std::string& name);
std::span<const std::string_view> dataflash_messages();
LogMotion motion_of_dataflash(const LogTables& log);

// In the order of their times, joined, and on the clock that GPS tells. Throws std::runtime_error, with what
// was `found` in their place, when there is no attitude or no position, or no time at which both are known.
AutopilotLog log_of_motion(const std::string& kind, const std::string& name, LogMotion motion,
                           const std::string& found);

// Both at the times of the denser: attitudes along the shorter arc, positions by the cubic that has their
// velocities, neither across a gap of more than NavTrack::kMaxGap.
NavTrack join(const std::vector<AttitudeSample>& attitudes, const std::vector<PositionSample>& positions);

}  // namespace perch
