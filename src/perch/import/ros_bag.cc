#include "perch/import/ros_bag.h"

#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <fstream>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <stdexcept>

#include "perch/camera/camera_model.h"
#include "perch/config/atomic_file.h"
#include "perch/flight/sensor_file.h"
#include "perch/import/navigation_of_log.h"
#include "perch/import/ros_messages.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

constexpr std::string_view kBagMagic = "#ROSBAG V";

const std::vector<std::string> kPictures{"sensor_msgs/Image", "sensor_msgs/CompressedImage"};
const std::vector<std::string> kCameras{"sensor_msgs/CameraInfo"};
const std::vector<std::string> kPoses{"nav_msgs/Odometry", "geometry_msgs/PoseStamped",
                                      "geometry_msgs/PoseWithCovarianceStamped",
                                      "geometry_msgs/TransformStamped"};
const std::vector<std::string> kGyros{"sensor_msgs/Imu"};

struct Topic {
  std::string name, type;
};

template <typename Message>
int64_t stamp_ns(const Message& message, const rosbag::MessageInstance& instance) {
  const ros::Time& stamp = message.header.stamp;
  return static_cast<int64_t>((stamp.isZero() ? instance.getTime() : stamp).toNSec());
}

std::string text_of(const auto& text) { return {text.begin(), text.end()}; }

// An Image's numbers as OpenCV has them, and what makes of them a picture to write; -1: as it is.
struct Encoding {
  const char* name;
  int type;
  int conversion;
};
constexpr Encoding kEncodings[] = {
    {"mono8", CV_8UC1, -1},
    {"8UC1", CV_8UC1, -1},
    {"mono16", CV_16UC1, -1},
    {"16UC1", CV_16UC1, -1},
    {"bgr8", CV_8UC3, -1},
    {"8UC3", CV_8UC3, -1},
    {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
    {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
    {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
    {"yuv422", CV_8UC2, cv::COLOR_YUV2GRAY_UYVY},
    {"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2GRAY_YUY2},
    // OpenCV names a pattern by the second row's second and third pixel.
    {"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2BGR},
    {"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2BGR},
    {"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2BGR},
    {"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2BGR},
};

// Empty, with why, where it cannot be one.
cv::Mat picture_of(const ros1::Image& image, std::string& why) {
  const auto* encoding = std::find_if(std::begin(kEncodings), std::end(kEncodings),
                                      [&](const Encoding& e) { return text_of(image.encoding) == e.name; });
  if (encoding == std::end(kEncodings)) {
    why = "encoding \"" + text_of(image.encoding) + "\" is none that can be read";
    return {};
  }
  const size_t row = static_cast<size_t>(image.width) * CV_ELEM_SIZE(encoding->type);
  constexpr uint32_t kMostPixels = 50'000'000;
  if (image.width == 0 || image.height == 0 || image.width > kMostPixels / image.height || image.step < row ||
      image.data.size() < static_cast<size_t>(image.step) * image.height) {
    why = std::to_string(image.width) + "x" + std::to_string(image.height) + " pixels in rows of " +
          std::to_string(image.step) + " bytes, of which there are " + std::to_string(image.data.size());
    return {};
  }
  const cv::Mat raw(static_cast<int>(image.height), static_cast<int>(image.width), encoding->type,
                    const_cast<uint8_t*>(image.data.data()), image.step);
  cv::Mat picture = raw.clone();
  if (encoding->type == CV_16UC1 && image.is_bigendian) {
    for (auto it = picture.begin<uint16_t>(); it != picture.end<uint16_t>(); ++it)
      *it = static_cast<uint16_t>(*it << 8 | *it >> 8);
  }
  if (encoding->conversion >= 0) cv::cvtColor(raw, picture, encoding->conversion);
  return picture;
}

std::string extension_of(std::span<const uint8_t> data) {
  const auto begins = [&](std::initializer_list<uint8_t> magic) {
    return data.size() > magic.size() && std::equal(magic.begin(), magic.end(), data.begin());
  };
  if (begins({0xFF, 0xD8, 0xFF})) return ".jpg";
  if (begins({0x89, 'P', 'N', 'G'})) return ".png";
  return "";
}

void write_bytes(const fs::path& file, std::span<const uint8_t> bytes) {
  std::ofstream stream(file, std::ios::binary);
  stream.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  stream.close();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
}

// What read_camera_model takes.
std::string camera_info_yaml(const ros1::CameraInfo& info) {
  return "image_width: " + std::to_string(info.width) + "\nimage_height: " + std::to_string(info.height) +
         "\ndistortion_model: \"" + text_of(info.distortion_model) + "\"\nK: [" +
         list_of_numbers({info.K.begin(), info.K.end()}) + "]\nD: [" +
         list_of_numbers({info.D.begin(), info.D.end()}) + "]\n";
}

Eigen::Quaterniond rotation_of(const ros1::Quaternion& q) { return {q.w, q.x, q.y, q.z}; }

void add_pose(LogMotion& motion, int64_t time_ns, const ros1::Quaternion& rotation,
              const Eigen::Vector3d& place, const std::optional<Eigen::Vector3d>& velocity_in_body = {}) {
  const Eigen::Quaterniond q = rotation_of(rotation);
  if (!(std::abs(q.norm() - 1) < 0.01) || !place.allFinite()) return;
  PositionSample position{time_ns, place, {}};
  if (velocity_in_body && velocity_in_body->allFinite())
    position.body_velocity_in_world = q.normalized() * *velocity_in_body;
  motion.attitudes.push_back({time_ns, q.normalized()});
  motion.positions.push_back(position);
}

template <typename Vector>
Eigen::Vector3d vector_of(const Vector& v) {
  return {v.x, v.y, v.z};
}

void add_pose(LogMotion& motion, const rosbag::MessageInstance& m) {
  if (const auto odometry = m.instantiate<ros1::Odometry>()) {
    const auto& pose = odometry->pose.pose;
    add_pose(motion, stamp_ns(*odometry, m), pose.orientation, vector_of(pose.position),
             vector_of(odometry->twist.twist.linear));
  } else if (const auto stamped = m.instantiate<ros1::PoseStamped>()) {
    add_pose(motion, stamp_ns(*stamped, m), stamped->pose.orientation, vector_of(stamped->pose.position));
  } else if (const auto with = m.instantiate<ros1::PoseWithCovarianceStamped>()) {
    const auto& pose = with->pose.pose;
    add_pose(motion, stamp_ns(*with, m), pose.orientation, vector_of(pose.position));
  } else if (const auto transform = m.instantiate<ros1::TransformStamped>()) {
    add_pose(motion, stamp_ns(*transform, m), transform->transform.rotation,
             vector_of(transform->transform.translation));
  }
}

}  // namespace

struct RosBag::Topics {
  rosbag::Bag bag;
  std::vector<Topic> all;
  std::string pictures, camera, poses, gyro;  // empty: none

  std::string list() const {
    std::string text;
    for (const Topic& topic : all) text += (text.empty() ? "" : ", ") + topic.name + " (" + topic.type + ")";
    return text.empty() ? "no topic" : text;
  }
  std::vector<std::string> of_types(const std::vector<std::string>& types) const {
    std::vector<std::string> names;
    for (const Topic& topic : all) {
      if (std::find(types.begin(), types.end(), topic.type) != types.end()) names.push_back(topic.name);
    }
    return names;
  }
};

bool is_ros_bag(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::string begin(kBagMagic.size(), '\0');
  stream.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  return stream && begin == kBagMagic;
}

RosBag::RosBag(const fs::path& file, const std::vector<std::string>& topics)
    : file_(file), topics_(std::make_unique<Topics>()) {
  try {
    topics_->bag.open(file.string(), rosbag::bagmode::Read);
    rosbag::View view(topics_->bag);
    for (const rosbag::ConnectionInfo* connection : view.getConnections()) {
      const Topic topic{connection->topic, connection->datatype};
      const bool known = std::any_of(topics_->all.begin(), topics_->all.end(),
                                     [&](const Topic& other) { return other.name == topic.name; });
      if (!known) topics_->all.push_back(topic);
    }
  } catch (const rosbag::BagUnindexedException&) {
    throw std::runtime_error(file.string() +
                             ": a bag without its index, cut off while it was recorded: rosbag "
                             "reindex makes one");
  } catch (const std::exception& e) {
    throw std::runtime_error(file.string() + ": no bag that can be read: " + e.what());
  }
  for (const std::string& topic : topics) {
    if (std::none_of(topics_->all.begin(), topics_->all.end(),
                     [&](const Topic& t) { return t.name == topic; }))
      throw std::runtime_error(file.string() + ": no topic " + topic + ", found " + topics_->list());
  }
  const auto one_of = [&](const char* what, const std::vector<std::string>& types) -> std::string {
    std::vector<std::string> names = topics_->of_types(types);
    std::vector<std::string> chosen;
    for (const auto& name : names) {
      if (std::find(topics.begin(), topics.end(), name) != topics.end()) chosen.push_back(name);
    }
    if (!chosen.empty()) names = chosen;
    if (names.size() < 2) return names.empty() ? "" : names.front();
    std::string list;
    for (const auto& name : names) list += (list.empty() ? "" : ", ") + name;
    throw std::runtime_error(file.string() + ": several topics with " + what + ": " + list +
                             "; --topic says which to take");
  };
  topics_->pictures = one_of("pictures", kPictures);
  topics_->poses = one_of("poses", kPoses);
  topics_->gyro = one_of("angular velocities", kGyros);
  // /camera/image_raw and its /camera/camera_info; /camera/image_raw/compressed is deeper.
  for (fs::path space = topics_->pictures; space.has_relative_path() && topics_->camera.empty();) {
    space = space.parent_path();
    const auto infos = topics_->of_types(kCameras);
    const std::string info = (space / "camera_info").string();
    if (std::find(infos.begin(), infos.end(), info) != infos.end()) topics_->camera = info;
  }
  if (topics_->camera.empty()) topics_->camera = one_of("camera models", kCameras);
}

RosBag::~RosBag() = default;

bool RosBag::has_pictures() const { return !topics_->pictures.empty(); }
bool RosBag::has_poses() const { return !topics_->poses.empty(); }

void RosBag::write_pictures(const fs::path& cam0, std::vector<std::string>& problems,
                            const std::function<void(double)>& progress) const {
  if (!has_pictures()) {
    throw std::runtime_error(file_.string() +
                             ": no pictures: expected sensor_msgs/Image or CompressedImage, found " +
                             topics_->list());
  }
  fs::create_directories(cam0 / "data");
  std::string rows = "#timestamp [ns],filename\n";
  size_t written = 0, skipped = 0;
  std::set<int64_t> times;
  std::string first_why;
  rosbag::View view(topics_->bag, rosbag::TopicQuery(topics_->pictures));
  size_t seen = 0;
  for (const rosbag::MessageInstance& m : view) {
    progress(static_cast<double>(++seen) / static_cast<double>(view.size()));
    std::string why, name;
    int64_t time = 0;
    try {
      if (const auto compressed = m.instantiate<ros1::CompressedImage>()) {
        time = stamp_ns(*compressed, m);
        const std::string extension = extension_of(compressed->data);
        if (times.contains(time)) {
          why = "its time is that of a picture before";
        } else if (extension.empty()) {
          why = "format \"" + text_of(compressed->format) + "\" is neither JPEG nor PNG";
        } else {
          name = std::to_string(time) + extension;
          write_bytes(cam0 / "data" / name, compressed->data);
        }
      } else if (const auto image = m.instantiate<ros1::Image>()) {
        time = stamp_ns(*image, m);
        const cv::Mat picture = picture_of(*image, why);
        if (times.contains(time)) {
          why = "its time is that of a picture before";
        } else if (!picture.empty()) {
          name = std::to_string(time) + ".png";
          // Noise does not compress: the fastest level costs 3 % of space.
          if (!cv::imwrite((cam0 / "data" / name).string(), picture, {cv::IMWRITE_PNG_COMPRESSION, 1}))
            throw std::runtime_error((cam0 / "data" / name).string() + ": cannot be written");
        }
      }
    } catch (const rosbag::BagException& e) {
      why = e.what();
    } catch (const ros::Exception& e) {
      why = e.what();
    } catch (const std::bad_alloc&) {  // a length that is broken
      why = "its length is wrong";
    } catch (const std::length_error&) {
      why = "its length is wrong";
    }
    if (name.empty()) {
      ++skipped;
      if (first_why.empty()) first_why = why;
      continue;
    }
    times.insert(time);
    rows += std::to_string(time) + "," + name + "\n";
    ++written;
  }
  if (skipped > 0) {
    problems.push_back(file_.string() + ": " + topics_->pictures + ": " + std::to_string(skipped) +
                       " pictures skipped, the first: " + first_why);
  }
  if (written == 0)
    throw std::runtime_error(file_.string() + ": " + topics_->pictures + ": no picture: " + first_why);
  write_whole_file(cam0 / "data.csv", rows);
  if (topics_->camera.empty()) return;
  rosbag::View infos(topics_->bag, rosbag::TopicQuery(topics_->camera));
  for (const rosbag::MessageInstance& m : infos) {
    const auto info = m.instantiate<ros1::CameraInfo>();
    if (!info || info->K[0] <= 0) continue;  // ROS has zeros for a camera that nobody has calibrated
    write_whole_file(cam0 / "camera_info.yaml", camera_info_yaml(*info));
    try {
      const CameraModel camera = read_camera_model(cam0 / "camera_info.yaml");
      write_whole_file(cam0 / "camera.cameramodel", camera_model_text(camera));
    } catch (const std::runtime_error& e) {
      problems.push_back(file_.string() + ": " + topics_->camera + ": " + e.what());
    }
    return;
  }
  problems.push_back(file_.string() + ": " + topics_->camera + ": no calibrated camera");
}

AutopilotLog RosBag::navigation() const {
  if (!has_poses()) {
    throw std::runtime_error(file_.string() +
                             ": no poses: expected nav_msgs/Odometry, geometry_msgs/PoseStamped, " +
                             "PoseWithCovarianceStamped or TransformStamped, found " + topics_->list());
  }
  LogMotion motion;
  motion.attitude_from = motion.position_from = topics_->poses;
  motion.gyro_from = topics_->gyro;
  const std::vector<std::string> names =
      topics_->gyro.empty() ? std::vector{topics_->poses} : std::vector{topics_->poses, topics_->gyro};
  rosbag::View view(topics_->bag, rosbag::TopicQuery(names));
  try {
    for (const rosbag::MessageInstance& m : view) {
      if (m.getTopic() == topics_->poses) {
        add_pose(motion, m);
      } else if (const auto imu = m.instantiate<ros1::Imu>()) {
        motion.gyro.push_back({stamp_ns(*imu, m), vector_of(imu->angular_velocity)});
      }
    }
  } catch (const std::exception& e) {
    motion.problems.push_back(file_.string() + ": cut short: " + e.what());
  }
  return log_of_motion("ROS bag", file_.string(), std::move(motion), topics_->list());
}

}  // namespace perch
