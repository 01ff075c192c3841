#include "perch/import/ros_bag.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "perch/camera/camera_model.h"
#include "perch/camera/image_source.h"
#include "perch/geometry/euler.h"
#include "support/bag_writer.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int64_t kStart = 1'700'000'000'000'000'000;

void no_progress(double) {}

cv::Mat ramp(int type) {
  cv::Mat picture(20, 30, type);
  for (size_t i = 0; i < picture.total() * picture.elemSize(); ++i)
    picture.data[i] = static_cast<uint8_t>(i * 7);
  return picture;
}

NavSample sample_at(int64_t time_ns) {
  const double t = static_cast<double>(time_ns - kStart) * 1e-9;
  return {time_ns, {rotation_from_ypr({0.3 * t + 1, 0.1, -0.2}), {2 * t, 1, 5 - t}}, {2, 0, -1}};
}

std::string error_of(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::runtime_error& e) {
    return e.what();
  }
  return "";
}

TEST(RosBag, PicturesComeAsTheyWereWithTheirStampsAndCamera) {
  const TempFolder folder;
  const fs::path file = folder / "a.bag";
  const cv::Mat grey = ramp(CV_8UC1), colour = ramp(CV_8UC3);
  cv::Mat rgb;
  cv::cvtColor(colour, rgb, cv::COLOR_BGR2RGB);
  {
    BagWriter bag(file);
    bag.camera_info("/front/camera_info", kStart, {30, 20}, {25, 26, 14.5, 9.5}, {-0.1, 0.02, 0.001, 0, 0},
                    "plumb_bob");
    bag.camera_info("/rear/camera_info", kStart, {30, 20}, {99, 99, 14.5, 9.5}, {}, "plumb_bob");
    bag.image("/front/image_raw", kStart, grey, "mono8");
    bag.image("/front/image_raw", kStart + 1, colour, "bgr8");
    bag.image("/front/image_raw", kStart + 2, rgb, "rgb8");
    bag.image("/front/image_raw", kStart + 3, grey, "32FC1");
    bag.close();
  }
  std::vector<std::string> problems;
  const RosBag bag(file, {});
  EXPECT_TRUE(bag.has_pictures());
  EXPECT_FALSE(bag.has_poses());
  const fs::path cam0 = folder / "flight/mav0/cam0";
  bag.write_pictures(cam0, problems, no_progress);
  EXPECT_THAT(problems,
              ElementsAre(HasSubstr("/front/image_raw: 1 pictures skipped, the first: encoding \"32FC1\"")));
  EXPECT_EQ(read_file(cam0 / "data.csv"),
            "#timestamp [ns],filename\n1700000000000000000,1700000000000000000.png\n"
            "1700000000000000001,1700000000000000001.png\n"
            "1700000000000000002,1700000000000000002.png\n");
  EXPECT_EQ(
      cv::norm(cv::imread((cam0 / "data/1700000000000000000.png").string(), cv::IMREAD_UNCHANGED), grey), 0);
  for (const char* name : {"data/1700000000000000001.png", "data/1700000000000000002.png"}) {
    EXPECT_EQ(cv::norm(cv::imread((cam0 / name).string(), cv::IMREAD_UNCHANGED), colour), 0) << name;
  }
  const CameraModel camera = read_camera_model(cam0 / "camera.cameramodel");
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV5");
  EXPECT_THAT(camera.intrinsics(), ElementsAre(25, 26, 14.5, 9.5, -0.1, 0.02, 0.001, 0, 0));
}

TEST(RosBag, DeepBigEndianPaddedAndBayerPicturesAreRead) {
  const TempFolder folder;
  cv::Mat wide = ramp(CV_8UC1);
  cv::Mat deep(20, 30, CV_16UC1);
  for (int i = 0; i < 600; ++i) deep.at<uint16_t>(i / 30, i % 30) = static_cast<uint16_t>(i * 100);
  {
    BagWriter bag(folder / "a.bag");
    bag.image("/i", kStart, deep, "mono16");
    // Red everywhere: the first pixel of each block of 2 by 2 is bright.
    cv::Mat bayer = cv::Mat::zeros(20, 30, CV_8UC1);
    for (int y = 0; y < 20; y += 2)
      for (int x = 0; x < 30; x += 2) bayer.at<uchar>(y, x) = 200;
    bag.image("/i", kStart + 1, bayer, "bayer_rggb8");
    bag.close();
  }
  std::vector<std::string> problems;
  RosBag(folder / "a.bag", {}).write_pictures(folder / "cam0", problems, no_progress);
  EXPECT_THAT(problems, IsEmpty());
  EXPECT_EQ(
      cv::norm(cv::imread((folder / "cam0/data/1700000000000000000.png").string(), cv::IMREAD_UNCHANGED),
               deep),
      0);
  const cv::Mat red =
      cv::imread((folder / "cam0/data/1700000000000000001.png").string(), cv::IMREAD_UNCHANGED);
  EXPECT_EQ(red.at<cv::Vec3b>(10, 10), cv::Vec3b(0, 0, 200));
}

TEST(RosBag, CompressedPicturesKeepTheirBytes) {
  const TempFolder folder;
  std::vector<uint8_t> jpeg, png;
  cv::imencode(".jpg", ramp(CV_8UC3), jpeg);
  cv::imencode(".png", ramp(CV_8UC1), png);
  {
    BagWriter bag(folder / "a.bag");
    bag.compressed("/c/image/compressed", kStart, jpeg, "bgr8; jpeg compressed bgr8");
    bag.compressed("/c/image/compressed", kStart + 1, png, "png");
    bag.compressed("/c/image/compressed", kStart + 2, {1, 2, 3, 4, 5, 6, 7, 8}, "h264");
    bag.camera_info("/c/camera_info", kStart, {30, 20}, {25, 26, 14.5, 9.5}, {}, "plumb_bob");
    bag.close();
  }
  std::vector<std::string> problems;
  RosBag(folder / "a.bag", {}).write_pictures(folder / "cam0", problems, no_progress);
  EXPECT_THAT(problems, ElementsAre(HasSubstr("format \"h264\" is neither JPEG nor PNG")));
  EXPECT_EQ(read_file(folder / "cam0/data/1700000000000000000.jpg"), std::string(jpeg.begin(), jpeg.end()));
  EXPECT_EQ(read_file(folder / "cam0/data/1700000000000000001.png"), std::string(png.begin(), png.end()));
  EXPECT_EQ(read_camera_model(folder / "cam0/camera.cameramodel").lens(), "LENSMODEL_PINHOLE");
}

TEST(RosBag, PosesOfEveryKindAreWorldFromBody) {
  using Write = void (BagWriter::*)(const std::string&, const NavSample&);
  for (const Write write : {&BagWriter::odometry, &BagWriter::pose, &BagWriter::transform}) {
    const TempFolder folder;
    {
      BagWriter bag(folder / "a.bag");
      for (int i = 0; i < 50; ++i) {
        (bag.*write)("/pose", sample_at(kStart + i * 20'000'000LL));
        bag.imu("/imu", kStart + i * 20'000'000LL + 5, {0.1, 0.2, 0.3 * i});
      }
      bag.close();
    }
    const AutopilotLog log = RosBag(folder / "a.bag", {}).navigation();
    EXPECT_EQ(log.kind, "ROS bag");
    ASSERT_EQ(log.nav.samples.size(), 50u);
    for (const NavSample& sample : log.nav.samples) {
      const NavSample truth = sample_at(sample.timestamp_ns);
      EXPECT_LE(sample.world_from_body.rotation.angularDistance(truth.world_from_body.rotation), 1e-15);
      EXPECT_EQ(sample.world_from_body.translation, truth.world_from_body.translation);
      // Told, or the slope of the positions, which is even; rounding of 2 m over 20 ms.
      EXPECT_LE((sample.body_velocity_in_world - truth.body_velocity_in_world).norm(), 1e-12);
    }
    ASSERT_EQ(log.gyro.size(), 50u);
    EXPECT_EQ(log.gyro[10].timestamp_ns, kStart + 200'000'005);
    EXPECT_EQ(log.gyro[10].angular_velocity_in_body, Eigen::Vector3d(0.1, 0.2, 3));
  }
}

TEST(RosBag, SaysWhatIsMissingAndWhatIsThere) {
  const TempFolder folder;
  {
    BagWriter bag(folder / "a.bag");
    bag.image("/left", kStart, ramp(CV_8UC1), "mono8");
    bag.image("/right", kStart, ramp(CV_8UC1), "mono8");
    bag.close();
    BagWriter imu(folder / "imu.bag");
    imu.imu("/imu", kStart, {0, 0, 0});
    imu.close();
  }
  const fs::path file = folder / "a.bag";
  EXPECT_THAT(error_of([&] { RosBag(file, {}); }),
              HasSubstr("a.bag: several topics with pictures: /left, /right; --topic says which to take"));
  EXPECT_THAT(error_of([&] { RosBag(file, {"/up"}); }),
              HasSubstr("a.bag: no topic /up, found /left (sensor_msgs/Image), /right (sensor_msgs/Image)"));
  EXPECT_THAT(error_of([&] { RosBag(file, {"/left"}).navigation(); }),
              AllOf(HasSubstr("a.bag: no poses: expected nav_msgs/Odometry"),
                    HasSubstr("found /left (sensor_msgs/Image)")));
  std::vector<std::string> problems;
  EXPECT_THAT(
      error_of([&] { RosBag(folder / "imu.bag", {}).write_pictures(folder / "x", problems, no_progress); }),
      HasSubstr("imu.bag: no pictures: expected sensor_msgs/Image or CompressedImage, found /imu "
                "(sensor_msgs/Imu)"));
  EXPECT_THAT(error_of([&] { RosBag(folder.write("text.bag", "hello"), {}); }),
              HasSubstr("text.bag: no bag"));
  EXPECT_THAT(error_of([&] { RosBag(folder / "none.bag", {}); }), HasSubstr("none.bag: no bag"));
}

// The library is not ours, but what it does with a broken bag is our program's to bear.
TEST(RosBag, BrokenBagsAreErrorsAndNoCrashes) {
  const TempFolder folder;
  {
    BagWriter bag(folder / "a.bag");
    for (int i = 0; i < 20; ++i) {
      bag.image("/left", kStart + i, ramp(CV_8UC1), "mono8");
      bag.odometry("/pose", sample_at(kStart + i * 20'000'000LL));
    }
    bag.close();
  }
  const std::string whole = read_file(folder / "a.bag");
  TestRng rng;
  int opened = 0;
  for (int i = 0; i < 120; ++i) {
    std::string broken = whole;
    if (i % 3 == 0) broken.resize(static_cast<size_t>(rng.index(static_cast<int>(whole.size()))));
    if (i % 3 != 0) {
      for (int k = 0; k < 1 + i % 5; ++k)
        broken[static_cast<size_t>(rng.index(static_cast<int>(whole.size())))] ^=
            static_cast<char>(1 << rng.index(8));
    }
    const fs::path file = folder.write("b.bag", broken);
    fs::remove_all(folder / "cam0");
    const std::string error = error_of([&] {
      std::vector<std::string> problems;
      const RosBag bag(file, {});
      ++opened;
      bag.write_pictures(folder / "cam0", problems, no_progress);
      bag.navigation();
    });
    if (!error.empty()) {
      EXPECT_THAT(error, HasSubstr("b.bag: ")) << i;
    }
  }
  EXPECT_GT(opened, 20);
}

}  // namespace
}  // namespace perch
