#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "perch/links/mavlink/history.h"
#include "perch/links/mavlink/messages.h"

namespace perch::mavlink {

// All times are of our CLOCK_MONOTONIC, ns. Body axes are FRD, earth axes NED with the autopilot's local
// origin.

struct AttitudeSample {
  int64_t time_ns = 0;
  Eigen::Quaterniond ned_from_body = Eigen::Quaterniond::Identity();
  Eigen::Vector3d body_rate = Eigen::Vector3d::Zero();  // of body against NED, in body axes, rad/s
};

struct MotionSample {
  int64_t time_ns = 0;
  Eigen::Vector3d body_in_ned = Eigen::Vector3d::Zero();           // m
  Eigen::Vector3d body_velocity_in_ned = Eigen::Vector3d::Zero();  // m/s
  // How often the autopilot's estimate has jumped by now. Positions with different numbers are not of one
  // map.
  uint32_t resets = 0;
};

struct GimbalSample {
  int64_t time_ns = 0;
  uint8_t component = 0;  // who said so
  uint16_t flags = 0;     // GIMBAL_DEVICE_FLAGS
  // FRD axes of the camera. Roll and pitch are against the horizon; see ned_from_gimbal for the yaw.
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
};

struct RangeSample {
  int64_t time_ns = 0;
  double distance = 0, min_distance = 0, max_distance = 0;  // m
  uint8_t orientation = 0;                                  // MAV_SENSOR_ORIENTATION; 25 is down
};

// What the autopilot said of its vehicle in the last seconds.
class VehicleHistory {
 public:
  // At 400 Hz, the most that autopilots send, 5 s; at the usual 100 Hz 20 s.
  static constexpr size_t kCapacity = 2048;
  // Between samples further apart an attitude is not known: at 2 rad/s^2 a straight arc over 0.2 s is off by
  // 10 mrad.
  static constexpr int64_t kMaxAttitudeGap = 200'000'000;
  // Beyond the last sample its rate is taken on: at 2 rad/s^2 again 10 mrad.
  static constexpr int64_t kMaxAttitudeAhead = 100'000'000;
  // A cubic through positions and velocities of both ends is off by p'''' T^4 / 384: 2 mm over 0.5 s at 10
  // m/s^4.
  static constexpr int64_t kMaxMotionGap = 500'000'000;
  // With 2 m/s^2, 4 cm.
  static constexpr int64_t kMaxMotionAhead = 200'000'000;

  // Each takes a message whose time is known. False: not finite, not newer than the last, or from a source
  // that gives way to a better one: ATTITUDE_QUATERNION before ATTITUDE before ODOMETRY for attitudes,
  // ODOMETRY before LOCAL_POSITION_NED for positions, as it alone tells of resets.
  bool add(const AttitudeQuaternion& message, int64_t time_ns);
  // Of a source that speaks no MAVLink.
  bool add(const AttitudeSample& sample);
  bool add(const Attitude& message, int64_t time_ns);
  bool add(const Odometry& message, int64_t time_ns);
  bool add(const LocalPositionNed& message, int64_t time_ns);
  bool add(const GimbalDeviceAttitudeStatus& message, uint8_t component, int64_t time_ns);
  bool add(const DistanceSensor& message, int64_t time_ns);

  std::optional<AttitudeSample> attitude_at(int64_t time_ns) const;
  std::optional<MotionSample> motion_at(int64_t time_ns) const;
  // Beyond the last sample, and across a gap of twice that, it is not known: a head turns 80 deg/s.
  static constexpr int64_t kMaxGimbalAhead = 100'000'000;
  std::optional<GimbalSample> gimbal_at(int64_t time_ns) const;

  const History<AttitudeSample>& attitudes() const { return attitudes_; }
  const History<MotionSample>& motions() const { return motions_; }
  const History<GimbalSample>& gimbal() const { return gimbal_; }
  const History<RangeSample>& ranges() const { return ranges_; }  // those that look down

  // The clock the times came by was wrong.
  void clear();

 private:
  bool add_attitude(int rank, const Eigen::Quaterniond& ned_from_body, const Eigen::Vector3d& rate,
                    int64_t time_ns);
  bool add_motion(int rank, MotionSample sample);

  // Where the samples come from, the best first; a worse source is heard when the better is silent.
  struct Source {
    int rank = 0;
    int64_t time_ns = 0;
    bool gives_way(int other_rank, int64_t other_time_ns) const;
  };

  History<AttitudeSample> attitudes_{kCapacity};
  History<MotionSample> motions_{kCapacity};
  History<GimbalSample> gimbal_{kCapacity};
  History<RangeSample> ranges_{256};
  Source attitude_source_, motion_source_;
  std::optional<uint8_t> reset_counter_;
  uint32_t resets_ = 0;
};

// The camera's FRD axes in NED. The yaw of GIMBAL_DEVICE_ATTITUDE_STATUS is against north or against the
// vehicle's heading, as its flags say; never against the body, whose roll and pitch must not be applied.
Eigen::Quaterniond ned_from_gimbal(const GimbalSample& gimbal, const Eigen::Quaterniond& ned_from_body);

}  // namespace perch::mavlink
