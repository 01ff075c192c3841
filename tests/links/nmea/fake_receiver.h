#pragma once

#include <cmath>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "perch/geometry/euler.h"
#include "perch/geometry/geodetic.h"
#include "perch/geometry/rigid3.h"

namespace perch::nmea {

// "GPHDT,1.0,T" with its '$', checksum and line end.
inline std::string sentence_of(const std::string& body) {
  unsigned char sum = 0;
  for (const char c : body) sum = static_cast<unsigned char>(sum ^ static_cast<unsigned char>(c));
  char end[8];
  std::snprintf(end, sizeof(end), "*%02X\r\n", unsigned{sum});
  return "$" + body + end;
}

struct ReceiverTruth {
  Rigid3 ned_from_body;
  Eigen::Vector3d body_velocity_in_ned = Eigen::Vector3d::Zero();  // m/s
};

// Writes what a receiver with an inertial unit says of a moment. Latitudes with 8 decimals of a minute: 0.02
// mm.
struct FakeReceiver {
  Geodetic origin{52.31 * kRadFromDeg, 10.55 * kRadFromDeg, 110};
  double separation = 44.2;  // of the geoid, m
  int quality = 4;
  double hdop = 0.8;

  static std::string time_text(int64_t of_day_ms) {
    char text[20];
    const auto ms = static_cast<int>(of_day_ms % 86'400'000);
    std::snprintf(text, sizeof(text), "%02d%02d%02d.%03d", ms / 3'600'000, ms / 60'000 % 60, ms / 1000 % 60,
                  ms % 1000);
    return text;
  }
  static std::string angle_text(double rad, int digits, char positive, char negative) {
    const double degrees = std::abs(rad) * kDegFromRad, whole = std::floor(degrees);
    char text[40];
    std::snprintf(text, sizeof(text), "%0*d%011.8f,%c", digits, static_cast<int>(whole),
                  60 * (degrees - whole), rad >= 0 ? positive : negative);
    return text;
  }

  // By the ellipsoid's radii at the origin: over 100 m right to a tenth of a millimetre at middle latitudes.
  Geodetic place_of(const Eigen::Vector3d& ned) const {
    Geodetic low = origin;
    const LocalFrame frame(origin);
    // Newton: the map is all but linear.
    for (int i = 0; i < 6; ++i) {
      const Eigen::Vector3d off = ned - frame.ned(low);
      low.latitude += off.x() / 6.37e6;
      low.longitude += off.y() / (6.38e6 * std::cos(origin.latitude));
      low.height -= off.z();
    }
    return low;
  }

  std::string gga(int64_t ms, const ReceiverTruth& truth) const {
    const Geodetic place = place_of(truth.ned_from_body.translation);
    char rest[80];
    std::snprintf(rest, sizeof(rest), ",%d,14,%.1f,%.4f,M,%.1f,M,1.0,0001", quality, hdop,
                  place.height - separation, separation);
    return sentence_of("GNGGA," + time_text(ms) + "," + angle_text(place.latitude, 2, 'N', 'S') + "," +
                       angle_text(place.longitude, 3, 'E', 'W') + rest);
  }
  std::string rmc(int64_t ms, const ReceiverTruth& truth) const {
    const Geodetic place = place_of(truth.ned_from_body.translation);
    const Eigen::Vector3d& v = truth.body_velocity_in_ned;
    char rest[80];
    std::snprintf(rest, sizeof(rest), ",%.4f,%.3f,080326,,,R", std::hypot(v.x(), v.y()) * 3600 / 1852,
                  heading_deg(std::atan2(v.y(), v.x())));
    return sentence_of("GNRMC," + time_text(ms) + ",A," + angle_text(place.latitude, 2, 'N', 'S') + "," +
                       angle_text(place.longitude, 3, 'E', 'W') + rest);
  }
  static std::string pashr(int64_t ms, const ReceiverTruth& truth) {
    const YawPitchRoll a = ypr_from_rotation(truth.ned_from_body.rotation);
    char text[120];
    std::snprintf(text, sizeof(text), ",%.3f,T,%+.3f,%+.3f,+0.00,0.020,0.020,0.100,2,1", heading_deg(a.yaw),
                  a.roll * kDegFromRad, a.pitch * kDegFromRad);
    return sentence_of("PASHR," + time_text(ms) + text);
  }
  static double heading_deg(double yaw) { return std::fmod(yaw * kDegFromRad + 720, 360); }
};

}  // namespace perch::nmea
