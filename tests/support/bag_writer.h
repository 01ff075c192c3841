#pragma once

#include <rosbag/bag.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "perch/flight/nav_track.h"
#include "perch/import/ros_messages.h"

namespace perch {

// Writes ROS 1 bags as ROS does, with its own library.
class BagWriter {
 public:
  explicit BagWriter(const std::filesystem::path& file) { bag_.open(file.string(), rosbag::bagmode::Write); }

  void image(const std::string& topic, int64_t time_ns, const cv::Mat& picture, const std::string& encoding) {
    auto message = stamped<ros1::Image>(time_ns);
    message.width = static_cast<uint32_t>(picture.cols);
    message.height = static_cast<uint32_t>(picture.rows);
    message.step = static_cast<uint32_t>(picture.step);
    message.encoding.assign(encoding.begin(), encoding.end());
    message.data.assign(picture.datastart, picture.dataend);
    write(topic, time_ns, message);
  }
  void compressed(const std::string& topic, int64_t time_ns, const std::vector<uint8_t>& bytes,
                  const std::string& format) {
    auto message = stamped<ros1::CompressedImage>(time_ns);
    message.format.assign(format.begin(), format.end());
    message.data.assign(bytes.begin(), bytes.end());
    write(topic, time_ns, message);
  }
  void camera_info(const std::string& topic, int64_t time_ns, cv::Size size,
                   const std::vector<double>& fx_fy_cx_cy, const std::vector<double>& distortion,
                   const std::string& model) {
    auto message = stamped<ros1::CameraInfo>(time_ns);
    message.width = static_cast<uint32_t>(size.width);
    message.height = static_cast<uint32_t>(size.height);
    message.distortion_model.assign(model.begin(), model.end());
    message.D.assign(distortion.begin(), distortion.end());
    message.K = {fx_fy_cx_cy[0], 0, fx_fy_cx_cy[2], 0, fx_fy_cx_cy[1], fx_fy_cx_cy[3], 0, 0, 1};
    write(topic, time_ns, message);
  }
  // The twist is in the body's own axes, as nav_msgs/Odometry says.
  void odometry(const std::string& topic, const NavSample& sample) {
    auto message = stamped<ros1::Odometry>(sample.timestamp_ns);
    put(message.pose.pose.position, message.pose.pose.orientation, sample.world_from_body);
    const Eigen::Vector3d v = sample.world_from_body.rotation.conjugate() * sample.body_velocity_in_world;
    message.twist.twist.linear.x = v.x();
    message.twist.twist.linear.y = v.y();
    message.twist.twist.linear.z = v.z();
    write(topic, sample.timestamp_ns, message);
  }
  void pose(const std::string& topic, const NavSample& sample) {
    auto message = stamped<ros1::PoseStamped>(sample.timestamp_ns);
    put(message.pose.position, message.pose.orientation, sample.world_from_body);
    write(topic, sample.timestamp_ns, message);
  }
  void transform(const std::string& topic, const NavSample& sample) {
    auto message = stamped<ros1::TransformStamped>(sample.timestamp_ns);
    put(message.transform.translation, message.transform.rotation, sample.world_from_body);
    write(topic, sample.timestamp_ns, message);
  }
  void imu(const std::string& topic, int64_t time_ns, const Eigen::Vector3d& gyro) {
    auto message = stamped<ros1::Imu>(time_ns);
    message.angular_velocity.x = gyro.x();
    message.angular_velocity.y = gyro.y();
    message.angular_velocity.z = gyro.z();
    write(topic, time_ns, message);
  }
  void close() { bag_.close(); }

 private:
  template <typename Message>
  static Message stamped(int64_t time_ns) {
    Message message;
    message.header.stamp.fromNSec(static_cast<uint64_t>(time_ns));
    return message;
  }
  static void put(auto& place, auto& rotation, const Rigid3& pose) {
    place.x = pose.translation.x();
    place.y = pose.translation.y();
    place.z = pose.translation.z();
    rotation.w = pose.rotation.w();
    rotation.x = pose.rotation.x();
    rotation.y = pose.rotation.y();
    rotation.z = pose.rotation.z();
  }
  template <typename Message>
  void write(const std::string& topic, int64_t time_ns, const Message& message) {
    ros::Time time;
    time.fromNSec(static_cast<uint64_t>(time_ns + 20'000'000));  // it arrives later than it was true
    bag_.write(topic, time, message);
  }
  rosbag::Bag bag_;
};

}  // namespace perch
