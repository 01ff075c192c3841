#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <nav_msgs/Odometry.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/Imu.h>

#include <memory>

namespace perch::ros1 {

// ROS's generated messages ask their allocator for `rebind`, which std::allocator has no more in C++20.
template <typename T>
struct AllocatorOf : std::allocator<T> {
  template <typename U>
  struct rebind {
    using other = AllocatorOf<U>;
  };
  AllocatorOf() = default;
  template <typename U>
  AllocatorOf(const AllocatorOf<U>&) {}
};
using Allocator = AllocatorOf<void>;

using CameraInfo = sensor_msgs::CameraInfo_<Allocator>;
using CompressedImage = sensor_msgs::CompressedImage_<Allocator>;
using Image = sensor_msgs::Image_<Allocator>;
using Imu = sensor_msgs::Imu_<Allocator>;
using Odometry = nav_msgs::Odometry_<Allocator>;
using PoseStamped = geometry_msgs::PoseStamped_<Allocator>;
using PoseWithCovarianceStamped = geometry_msgs::PoseWithCovarianceStamped_<Allocator>;
using Quaternion = geometry_msgs::Quaternion_<Allocator>;
using TransformStamped = geometry_msgs::TransformStamped_<Allocator>;

}  // namespace perch::ros1
