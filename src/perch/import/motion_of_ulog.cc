#include <array>
#include <cmath>

#include "perch/import/log_rows.h"
#include "perch/import/navigation_of_log.h"

namespace perch {
namespace {

constexpr std::array<std::string_view, 6> kTopics{"vehicle_attitude",         "vehicle_local_position",
                                                  "vehicle_angular_velocity", "sensor_combined",
                                                  "vehicle_gps_position",     "sensor_gps"};

// When a row was measured, which newer PX4 tells beside when it was published.
int64_t time_ns(const LogRows& rows, size_t row) {
  const double sample = rows.at(row, "timestamp_sample");
  return ns_of_us(sample > 0 ? sample : rows.at(row, "timestamp"));
}

void read_attitudes(const LogTables& log, LogMotion& motion) {
  // Hamilton, w x y z, body FRD to earth NED (VehicleAttitude.msg): world_from_body as it is.
  const LogRows rows(log.find("vehicle_attitude"));
  for (size_t i = 0; i < rows.size(); ++i) {
    const Eigen::Quaterniond q(rows.at(i, "q[0]"), rows.at(i, "q[1]"), rows.at(i, "q[2]"),
                               rows.at(i, "q[3]"));
    if (!(std::abs(q.norm() - 1) < 0.01)) continue;
    motion.attitudes.push_back({time_ns(rows, i), q.normalized()});
  }
  motion.attitude_from = "vehicle_attitude";
}

void read_positions(const LogTables& log, const std::string& name, LogMotion& motion) {
  const LogRows rows(log.find("vehicle_local_position"));
  size_t invalid = 0;
  for (size_t i = 0; i < rows.size(); ++i) {
    // Logs of before these flags have none, and say so by NaN.
    if (rows.at(i, "xy_valid") == 0 || rows.at(i, "z_valid") == 0) {
      ++invalid;
      continue;
    }
    PositionSample sample{time_ns(rows, i), rows.at(i, "x", "y", "z"), rows.at(i, "vx", "vy", "vz")};
    if (!sample.body_in_world.allFinite()) continue;
    if (!sample.body_velocity_in_world->allFinite() || rows.at(i, "v_xy_valid") == 0 ||
        rows.at(i, "v_z_valid") == 0) {
      sample.body_velocity_in_world.reset();
    }
    motion.positions.push_back(sample);
  }
  motion.position_from =
      motion.positions.empty() ? "valid rows of vehicle_local_position" : "vehicle_local_position";
  if (invalid > 0) {
    motion.problems.push_back(name + ": vehicle_local_position: " + std::to_string(invalid) + " of " +
                              std::to_string(rows.size()) +
                              " positions that the autopilot calls invalid, skipped");
  }
}

// `averaged_over` is the column of the time before its stamp that a row is the average of, us.
std::vector<GyroSample> read_gyro(const LogTables& log, std::string_view topic, const std::string& field,
                                  std::string_view averaged_over) {
  const LogRows rows(log.find(topic));
  std::vector<GyroSample> gyro;
  for (size_t i = 0; i < rows.size(); ++i) {
    const double us = rows.at(i, averaged_over);
    const int64_t middle_ns = us > 0 && us < 1e5 ? static_cast<int64_t>(us * 500) : 0;
    gyro.push_back({time_ns(rows, i) - middle_ns, rows.at(i, field + "[0]", field + "[1]", field + "[2]")});
  }
  return gyro;
}

}  // namespace

std::span<const std::string_view> ulog_topics() { return kTopics; }

LogMotion motion_of_ulog(const LogTables& log, const std::string& name) {
  LogMotion motion;
  read_attitudes(log, motion);
  read_positions(log, name, motion);
  // What has more rows: which of the two is logged often depends on the logging profile.
  motion.gyro = read_gyro(log, "sensor_combined", "gyro_rad", "gyro_integral_dt");
  motion.gyro_from = "sensor_combined";
  if (auto filtered = read_gyro(log, "vehicle_angular_velocity", "xyz", "");
      filtered.size() > motion.gyro.size()) {
    motion.gyro = std::move(filtered);
    motion.gyro_from = "vehicle_angular_velocity";
  }
  for (const auto* topic : {"sensor_gps", "vehicle_gps_position"}) {
    const LogRows rows(log.find(topic));
    for (size_t i = 0; i < rows.size(); ++i) {
      const int64_t utc = ns_of_us(rows.at(i, "time_utc_usec")), boot = ns_of_us(rows.at(i, "timestamp"));
      if (utc > 0 && boot >= 0) motion.unix_minus_boot_ns.push_back(utc - boot);
    }
    if (!motion.unix_minus_boot_ns.empty()) break;
  }
  return motion;
}

}  // namespace perch
