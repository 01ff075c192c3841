#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <string>

#include "perch/camera/camera_model.h"
#include "perch/camera/image_source.h"
#include "perch/detection/edges_detector.h"
#include "perch/pose/pose_estimator.h"
#include "support/shared.h"

namespace perch {
namespace {

// How far a quad's side lies from where a person sees it, at most: the board's places below are read off by
// eye.
constexpr double kByEye = 6;  // px

struct Photo {
  const char* name;
  // Where the middles of squares A and D are, px.
  Eigen::Vector2d a, d;
};
const Photo kPhotos[] = {{"platform0.jpg", {302.5, 130}, {217, 217.5}},
                         {"platform1_v3.jpg", {432, 180.5}, {275, 346.5}},
                         {"platform2_v2.jpg", {395, 227}, {475, 309}}};

struct Outcome {
  PoseStatus status = PoseStatus::kRejected;
  bool found = false;
  double rms_px = 0, worst_px = 0;
};

// The best that any focal length near the camera's gives: nobody calibrated it.
Outcome run(const LandingTarget& target, const CameraModel& rough, const cv::Mat& grey, const Photo* photo) {
  Outcome best;
  best.rms_px = INFINITY;
  for (double scale = 0.85; scale < 1.2; scale += 0.05) {
    std::vector<double> intrinsics = rough.intrinsics();
    intrinsics[0] *= scale;
    intrinsics[1] *= scale;
    const CameraModel camera(rough.lens(), intrinsics, rough.width(), rough.height());
    EdgesDetector detector(target, camera, {});
    const Detection& detection = detector.detect(grey, {});
    if (detection.status != DetectionStatus::kFound) continue;
    const PoseResult pose = PoseEstimator(target, camera, {}).estimate(detection);
    const bool is_better = pose.status == PoseStatus::kOk && pose.reprojection_rms_px < best.rms_px;
    best.found = true;
    if (!is_better) continue;
    best.status = pose.status;
    best.rms_px = pose.reprojection_rms_px;
    if (!photo) continue;
    const auto middle = [&](size_t square) {
      const auto& f = target.features;
      const Eigen::Vector2d q = 0.5 * (f[4 * square].point + f[4 * square + 2].point);
      return camera.pixel_from_camera(pose.camera_from_target.mean * Eigen::Vector3d(q.x(), q.y(), 0))
          .value();
    };
    best.worst_px = std::max((middle(0) - photo->a).norm(), (middle(3) - photo->d).norm());
  }
  return best;
}

class RealPhotos : public testing::TestWithParam<Channel> {
 protected:
  void SetUp() override {
    if (shared_flight("real_photos").empty()) GTEST_SKIP() << "real_photos is not there: set PERCH_SHARED";
    target_ = read_target(shared_flight("real_photos") / "target.yaml");
    cam0_ = shared_flight("real_photos") / "mav0" / "cam0";
  }
  Outcome photo(const char* name, const Photo* photo) const {
    Frame frame;
    read_picture(cam0_ / "data" / name, GetParam(), frame);
    EXPECT_TRUE(frame.problem.empty()) << frame.problem;
    return run(target_, read_camera_model(cam0_ / "sensor.yaml"), frame.grey, photo);
  }

  LandingTarget target_;
  std::filesystem::path cam0_;
};

// The border that merges with a pale wall, the one cut by the picture's edge and pale tiles do not matter:
// the interior is enough. In red, where the interior is nearly as bright as the border, they need not be
// found.
TEST_P(RealPhotos, AreFoundWhereAPersonSeesTheBoard) {
  for (const Photo& p : kPhotos) {
    const Outcome r = photo(p.name, &p);
    if (GetParam() == Channel::kRed && r.status != PoseStatus::kOk) continue;
    ASSERT_EQ(r.status, PoseStatus::kOk) << p.name;
    std::printf("%s: %.3f px, %.1f px from the eye's\n", p.name, r.rms_px, r.worst_px);
    EXPECT_LT(r.rms_px, 0.6) << p.name;
    EXPECT_LT(r.worst_px, kByEye) << p.name;
  }
}

// Smeared until each edge is there twice, several pixels apart: nobody could measure it, and it is no pose.
TEST_P(RealPhotos, GiveNoPoseWhereThePictureIsSmeared) {
  const Outcome r = photo("badimage.jpg", nullptr);
  EXPECT_NE(r.status, PoseStatus::kOk) << r.rms_px << " px";
}

std::string channel_name(const testing::TestParamInfo<Channel>& test) {
  const char* names[] = {"grey", "red", "green", "blue"};
  return names[static_cast<size_t>(test.param)];
}

INSTANTIATE_TEST_SUITE_P(Channels, RealPhotos,
                         testing::Values(Channel::kGrey, Channel::kRed, Channel::kGreen, Channel::kBlue),
                         channel_name);

}  // namespace
}  // namespace perch
