#include <array>
#include <cmath>

#include "perch/geometry/euler.h"
#include "perch/import/log_rows.h"
#include "perch/import/navigation_of_log.h"

namespace perch {
namespace {

constexpr std::array<std::string_view, 7> kMessages{"ATT", "XKF1", "XKF4", "NKF1", "POS", "GPS", "IMU"};

// GPS time began on 6 January 1980, and has not had the 18 leap seconds that UTC has had by 2017, the last.
constexpr int64_t kGpsEpoch = 315964800;  // s since 1970
constexpr int64_t kLeapSeconds = 18;

int64_t time_ns(const LogRows& rows, size_t row) { return ns_of_us(rows.at(row, "TimeUS")); }

// Which of EKF3's cores the vehicle flew by at a row of XKF1, as XKF4 tells: the first until it says another.
class PrimaryCore {
 public:
  explicit PrimaryCore(const LogTables& log) : rows_(log.find("XKF4")) {}
  double at(int64_t when_ns) {
    for (; next_ < rows_.size() && time_ns(rows_, next_) <= when_ns; ++next_) {
      const double told = rows_.at(next_, "PI");
      if (told >= 0) core_ = told;
    }
    return core_;
  }

 private:
  LogRows rows_;
  size_t next_ = 0;
  double core_ = 0;
};

// Roll, Pitch, Yaw in degrees turn NED to FRD about z, y, x in this order.
void read_attitudes(const LogTables& log, const char* message, LogMotion& motion) {
  const LogRows rows(log.find(message));
  PrimaryCore primary(log);
  std::vector<AttitudeSample> attitudes;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (rows.has("C") && rows.at(i, "C") != primary.at(time_ns(rows, i))) continue;
    const Eigen::Vector3d ypr = rows.at(i, "Yaw", "Pitch", "Roll") * kRadFromDeg;
    if (!ypr.allFinite()) continue;
    attitudes.push_back({time_ns(rows, i), rotation_from_ypr({ypr[0], ypr[1], ypr[2]})});
  }
  if (attitudes.size() <= motion.attitudes.size()) return;
  motion.attitudes = std::move(attitudes);
  motion.attitude_from = message;
}

// An EKF's own north, east, down, from its origin.
void read_filter_positions(const LogTables& log, const char* message, LogMotion& motion) {
  const LogRows rows(log.find(message));
  PrimaryCore primary(log);
  for (size_t i = 0; i < rows.size(); ++i) {
    if (rows.has("C") && rows.at(i, "C") != primary.at(time_ns(rows, i))) continue;
    const PositionSample sample{time_ns(rows, i), rows.at(i, "PN", "PE", "PD"), rows.at(i, "VN", "VE", "VD")};
    if (!sample.body_in_world.allFinite() || !sample.body_velocity_in_world->allFinite()) continue;
    motion.positions.push_back(sample);
  }
  if (!motion.positions.empty()) motion.position_from = message;
}

// Latitude and longitude in degrees, altitude in m, on the plane that touches WGS 84 in the first of them.
void read_geodetic_positions(const LogTables& log, const char* message, LogMotion& motion) {
  const LogRows rows(log.find(message));
  std::optional<Eigen::Vector3d> origin;
  for (size_t i = 0; i < rows.size(); ++i) {
    if (rows.has("I") && rows.at(i, "I") != 0) continue;               // the first receiver
    if (rows.has("Status") && !(rows.at(i, "Status") >= 3)) continue;  // no fix in three dimensions
    const Eigen::Vector3d place = rows.at(i, "Lat", "Lng", "Alt");
    if (!place.allFinite() || (place.x() == 0 && place.y() == 0)) continue;
    if (!origin) origin = place;
    constexpr double kEquator = 6378137.0, kEccentricity2 = 6.69437999014e-3;
    const double sine = std::sin(origin->x() * kRadFromDeg);
    const double w2 = 1 - kEccentricity2 * sine * sine;
    const double to_east = kEquator / std::sqrt(w2) * std::cos(origin->x() * kRadFromDeg);
    const double to_north = kEquator * (1 - kEccentricity2) / (w2 * std::sqrt(w2));
    PositionSample sample{
        time_ns(rows, i),
        {(place.x() - origin->x()) * kRadFromDeg * to_north,
         wrap_angle((place.y() - origin->y()) * kRadFromDeg) * to_east, origin->z() - place.z()},
        {}};
    const double speed = rows.at(i, "Spd"), course = rows.at(i, "GCrs") * kRadFromDeg,
                 down = rows.at(i, "VZ");
    const Eigen::Vector3d velocity(speed * std::cos(course), speed * std::sin(course), down);
    if (velocity.allFinite()) sample.body_velocity_in_world = velocity;
    motion.positions.push_back(sample);
  }
  if (!motion.positions.empty()) motion.position_from = message;
}

}  // namespace

std::span<const std::string_view> dataflash_messages() { return kMessages; }

LogMotion motion_of_dataflash(const LogTables& log) {
  LogMotion motion;
  motion.attitude_from = "ATT, XKF1 or NKF1";
  motion.position_from = "XKF1, NKF1, POS or GPS with a fix";
  // The filter's own before others, unless these are denser.
  for (const auto* message : {"XKF1", "NKF1", "ATT"}) read_attitudes(log, message, motion);
  for (const auto* message : {"XKF1", "NKF1"}) {
    if (motion.positions.empty()) read_filter_positions(log, message, motion);
  }
  for (const auto* message : {"POS", "GPS"}) {
    if (motion.positions.empty()) read_geodetic_positions(log, message, motion);
  }
  const LogRows imu(log.find("IMU"));
  for (size_t i = 0; i < imu.size(); ++i) {
    if (imu.has("I") && imu.at(i, "I") != 0) continue;  // the first of several
    motion.gyro.push_back({time_ns(imu, i), imu.at(i, "GyrX", "GyrY", "GyrZ")});
  }
  motion.gyro_from = "IMU";
  const LogRows gps(log.find("GPS"));
  for (size_t i = 0; i < gps.size(); ++i) {
    const double week = gps.at(i, "GWk"), ms = gps.at(i, "GMS");
    // A receiver without a fix may be in any week.
    if (!(gps.at(i, "Status") >= 3 && week > 1500 && week < 1e4 && ms >= 0 && ms < 1e9)) continue;
    const int64_t unix_s = kGpsEpoch + static_cast<int64_t>(week) * 604800 - kLeapSeconds;
    if (time_ns(gps, i) < 0) continue;
    motion.unix_minus_boot_ns.push_back(unix_s * 1'000'000'000 + static_cast<int64_t>(ms) * 1'000'000 -
                                        time_ns(gps, i));
  }
  return motion;
}

}  // namespace perch
