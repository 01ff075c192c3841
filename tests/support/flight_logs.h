#pragma once

#include <cmath>
#include <functional>
#include <string>

#include "perch/geometry/euler.h"
#include "perch/geometry/rigid3.h"
#include "support/dataflash_writer.h"
#include "support/ulog_writer.h"

namespace perch {

// What a vehicle does at a time in s since the autopilot's start: NED and FRD.
struct LoggedMoment {
  Rigid3 world_from_body;
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(), gyro = Eigen::Vector3d::Zero();
};
using LoggedFlight = std::function<LoggedMoment(double)>;

// The log that PX4 would write of it: attitude at 50 Hz, position at 10, gyro at 200, GPS at 5.
inline UlogWriter ulog_of(const LoggedFlight& flight, double begin, double end,
                          uint64_t utc_at_start_us = 0) {
  UlogWriter log(static_cast<uint64_t>(begin * 1e6));
  log.format("vehicle_attitude",
             "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;float[4] delta_q_reset;"
             "uint8_t quat_reset_counter;uint8_t[7] _padding0;");
  log.format(
      "vehicle_local_position",
      "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;"
      "bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;");
  log.format("sensor_combined",
             "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;float[3] accelerometer_m_s2;");
  log.format("sensor_gps",
             "uint64_t timestamp;uint64_t time_utc_usec;uint8_t fix_type;uint8_t[7] _padding0;");
  log.subscribe(3, "vehicle_attitude");
  log.subscribe(4, "vehicle_local_position");
  log.subscribe(5, "sensor_combined");
  log.subscribe(6, "sensor_gps");
  const auto f = [](double number) { return static_cast<float>(number); };
  const auto first = static_cast<int64_t>(std::ceil(begin * 200)), last = static_cast<int64_t>(end * 200);
  for (int64_t i = first; i <= last; ++i) {
    const auto us = static_cast<uint64_t>(i * 5000);
    const LoggedMoment m = flight(static_cast<double>(i) * 0.005);
    const Eigen::Vector3d &p = m.world_from_body.translation, &v = m.velocity;
    const Eigen::Quaterniond& q = m.world_from_body.rotation;
    // The average over the 5 ms before.
    const Eigen::Vector3d w = flight(static_cast<double>(i) * 0.005 - 0.0025).gyro;
    log.row(5, us, f(w.x()), f(w.y()), f(w.z()), uint32_t{5000}, 0.0F, 0.0F, -9.8F);
    // Published 2 ms after it was true.
    if (i % 4 == 0) {
      log.row(3, us + 2000, us, f(q.w()), f(q.x()), f(q.y()), f(q.z()), 1.0F, 0.0F, 0.0F, 0.0F, uint8_t{0});
    }
    if (i % 20 == 0) {
      log.row(4, us + 2000, us, f(p.x()), f(p.y()), f(p.z()), f(v.x()), f(v.y()), f(v.z()), uint8_t{1},
              uint8_t{1}, uint8_t{1}, uint8_t{1});
    }
    if (i % 40 == 0 && utc_at_start_us > 0) log.row(6, us, utc_at_start_us + us, uint8_t{3});
  }
  return log;
}

// The log that ArduPilot would write of it: XKF1 of two cores at 25 Hz, of which the first is flown by, ATT
// at 10 Hz, IMU at 200 Hz, GPS at 5 Hz.
inline DataflashWriter dataflash_of(const LoggedFlight& flight, double begin, double end,
                                    uint16_t gps_week = 0, uint32_t gps_ms_at_start = 0) {
  DataflashWriter log;
  log.format(1, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
  log.format(2, "MULT", "Qbd", "TimeUS,Id,Mult");
  log.format(10, "ATT", "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF");
  log.format(11, "XKF1", "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH");
  log.format(12, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ");
  log.format(13, "GPS", "QBBIHBcLLeffffB",
             "TimeUS,I,Status,GMS,GWk,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ,Yaw,U");
  log.row(2, uint64_t{0}, int8_t{'F'}, 1e-6);
  log.row(2, uint64_t{0}, int8_t{'B'}, 1e-2);
  log.row(2, uint64_t{0}, int8_t{'0'}, 1.0);
  log.units(1, 0, 11, "s#ddhnnnnmmmkkkm", "F-BBB0000000BBBB");
  log.units(1, 0, 12, "s#EEEooo", "F-000000");
  const auto f = [](double number) { return static_cast<float>(number); };
  const auto centi = [](double rad) { return static_cast<int16_t>(std::lround(rad * kDegFromRad * 100)); };
  const auto heading = [](double rad) {
    return static_cast<uint16_t>(std::lround((rad < 0 ? rad + 2 * M_PI : rad) * kDegFromRad * 100) % 36000);
  };
  const auto first = static_cast<int64_t>(std::ceil(begin * 200)), last = static_cast<int64_t>(end * 200);
  for (int64_t i = first; i <= last; ++i) {
    const auto us = static_cast<uint64_t>(i * 5000);
    const LoggedMoment m = flight(static_cast<double>(i) * 0.005);
    const Eigen::Vector3d &w = m.gyro, &p = m.world_from_body.translation, &v = m.velocity;
    const YawPitchRoll ypr = ypr_from_rotation(m.world_from_body.rotation);
    for (uint8_t instance = 0; instance < 2; ++instance) {
      const double wrong = instance;  // the second is far off: whoever takes it is found out
      log.row(12, us, instance, f(w.x() + wrong), f(w.y()), f(w.z()), 0.0F, 0.0F, -9.8F);
      if (i % 8 != 0) continue;
      log.row(11, us, instance, centi(ypr.roll), centi(ypr.pitch), heading(ypr.yaw), f(v.x()), f(v.y()),
              f(v.z()), f(v.z()), f(p.x() + 100 * wrong), f(p.y()), f(p.z()), int16_t{0}, int16_t{0},
              int16_t{0}, int32_t{0});
    }
    if (i % 20 == 0) {
      log.row(10, us, int16_t{0}, centi(ypr.roll), int16_t{0}, centi(ypr.pitch), uint16_t{0},
              heading(ypr.yaw), uint16_t{0}, uint16_t{0}, uint8_t{3});
    }
    if (i % 40 == 0 && gps_week > 0) {
      log.row(13, us, uint8_t{0}, uint8_t{3}, static_cast<uint32_t>(gps_ms_at_start + us / 1000), gps_week,
              uint8_t{12}, int16_t{80}, int32_t{473977418}, int32_t{85455938}, int32_t{48811}, 0.0F, 0.0F,
              0.0F, 0.0F, uint8_t{1});
    }
  }
  return log;
}

}  // namespace perch
