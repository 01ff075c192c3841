#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "perch/import/autopilot_log.h"

namespace perch {

bool is_ros_bag(const std::filesystem::path& file);

// A ROS 1 bag, through Debian's rosbag-storage. Stamps are those of the messages' headers, or when they were
// recorded where these are 0.
//
//   pictures    sensor_msgs/Image (mono, RGB, BGR, Bayer, 8 or 16 bits) and CompressedImage (JPEG, PNG)
//   camera      sensor_msgs/CameraInfo, of the pictures' own name space where there are several
//   poses       nav_msgs/Odometry, geometry_msgs/PoseStamped, PoseWithCovarianceStamped, TransformStamped:
//               world_from_body, its axes those of the bag (ROS: ENU and FLU)
//   gyro        sensor_msgs/Imu
class RosBag {
 public:
  // Of each of these the bag may have one topic: `topics` names those to take where it has more (empty: any).
  // Throws std::runtime_error naming the file and the cause: no bag, one cut off before its index, a topic
  // that is not there, with those that are.
  RosBag(const std::filesystem::path& file, const std::vector<std::string>& topics);
  ~RosBag();

  bool has_pictures() const;
  bool has_poses() const;

  // cam0's data, data.csv and, where it can be said, camera.cameramodel; compressed pictures as they are,
  // others as PNG. What cannot be used is skipped and noted. Throws std::runtime_error when there is no
  // picture, with the topics there are.
  void write_pictures(const std::filesystem::path& cam0, std::vector<std::string>& problems,
                      const std::function<void(double part)>& progress) const;

  // Throws std::runtime_error when there are no poses, with the topics there are.
  AutopilotLog navigation() const;

 private:
  struct Topics;
  std::filesystem::path file_;
  std::unique_ptr<Topics> topics_;
};

}  // namespace perch
