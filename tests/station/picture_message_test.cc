#include "perch/station/picture_message.h"

#include <gtest/gtest.h>

#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "support/pose_world.h"
#include "support/rng.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

using Json = nlohmann::json;

class PictureMessage : public testing::Test {
 protected:
  PictureMessage() {
    picture_.grey = cv::Mat(480, 640, CV_8UC1);
    for (int i = 0; i < 640 * 480; ++i) picture_.grey.data[i] = static_cast<uint8_t>(rng_.index(256));
    Estimate& e = picture_.estimate;
    e.timestamp_ns = 1234567890123456789;
    e.status = EstimateStatus::kOk;
    e.camera_from_target.mean = {Eigen::Quaterniond(0, 1, 0, 0), {0.1, -0.2, 4}};
    e.camera_from_target.covariance.diagonal() << 1e-4, 4e-4, 1e-2, 1e-4, 1e-4, 1e-4;
    for (size_t i = 0; i < target_.features.size(); ++i) {
      const auto& p = target_.features[i].point;
      const auto pixel =
          camera_.pixel_from_camera(e.camera_from_target.mean * Eigen::Vector3d(p.x(), p.y(), 0));
      e.correspondences.push_back({static_cast<int>(i), *pixel + Eigen::Vector2d(0.25, 0), 0.1});
    }
  }
  Json json_of(const std::vector<uint8_t>& message) const {
    uint32_t length = 0;
    std::memcpy(&length, message.data(), 4);
    return Json::parse(message.begin() + 4, message.begin() + 4 + length);
  }

  TestRng rng_;
  LandingTarget target_ = sharp_target();
  CameraModel camera_ = CameraModel::pinhole(400, 400, 319.5, 239.5, 640, 480);
  SeenPicture picture_;
};

TEST_F(PictureMessage, ShowsTheOutlineInFewPoints) {
  const Json overlay = overlay_json(target_, camera_, picture_.estimate);
  ASSERT_EQ(overlay["outline"].size(), target_.patches.size());
  // A pinhole's straight lines: the four corners and the first again.
  for (const Json& line : overlay["outline"]) EXPECT_EQ(line.size(), 10u);
  // By hand: the outer border's upper right corner (0.5, 0.5, 0) is at (0.6, -0.7, 4).
  EXPECT_NEAR(overlay["outline"][0][0].get<double>(), 319.5 + 400 * 0.6 / 4, 0.051);
  EXPECT_NEAR(overlay["outline"][0][1].get<double>(), 239.5 - 400 * 0.7 / 4, 0.051);
  EXPECT_EQ(overlay["labels"].size(), target_.features.size());
}

TEST_F(PictureMessage, ShowsResidualsAndThePadsUncertainty) {
  Json overlay = overlay_json(target_, camera_, picture_.estimate);
  for (const Json& corner : overlay["edges"]) {
    EXPECT_NEAR(corner[2].get<double>(), 1, 1e-3);
    EXPECT_NEAR(corner[4].get<double>(), 0.25, 1e-3);
  }
  // Half axes of one sigma: 400 / 4 m of 2 cm and 1 cm, and a little of the depth's.
  EXPECT_NEAR(overlay["ellipse"][2].get<double>(), 2.0, 0.1);
  EXPECT_NEAR(overlay["ellipse"][3].get<double>(), 1.0, 0.1);
  picture_.estimate.residuals = {{{10, 20}, {0, 1}, 0.125f}};
  overlay = overlay_json(target_, camera_, picture_.estimate);
  EXPECT_EQ(overlay["edges"], Json::parse("[[10.0,20.0,0.0,1.0,0.125]]"));
}

TEST_F(PictureMessage, IsAsLongAsItSaysAndSmall) {
  const auto message = picture_message(picture_, target_, camera_, {});
  const Json json = json_of(message);
  EXPECT_EQ(json["t"], "1234567890123456789");
  const size_t jpeg_at = message.size() - json["bits"].get<size_t>() - json["jpeg"].get<size_t>();
  const cv::Mat shown = cv::imdecode(
      cv::Mat(1, json["jpeg"].get<int>(), CV_8UC1, const_cast<uint8_t*>(message.data() + jpeg_at)),
      cv::IMREAD_GRAYSCALE);
  EXPECT_EQ(shown.size(), cv::Size(320, 240));
  EXPECT_LE(json["bits"].get<size_t>(), 10000u);  // noise, the worst there is
  picture_.grey = cv::Scalar(100);
  EXPECT_LT(picture_message(picture_, target_, camera_, {}).size(), 10000u);
}

TEST_F(PictureMessage, ShowsTheTargetAloneWhereThatIsAsked) {
  const Json json = json_of(picture_message(picture_, target_, camera_, {.close = true}));
  EXPECT_LT(json["part"][2].get<int>(), 400);
  for (const Json& label : json["labels"]) {
    EXPECT_GT(label[1].get<double>(), json["part"][0].get<double>());
    EXPECT_LT(label[1].get<double>(), json["part"][0].get<double>() + json["part"][2].get<double>());
  }
}

TEST_F(PictureMessage, HasWordsForAFrameWithoutAPicture) {
  picture_.grey.release();
  picture_.estimate = {};
  picture_.estimate.status = EstimateStatus::kUnreadable;
  picture_.estimate.problem = "17.png: torn \xff";
  const Json json = json_of(picture_message(picture_, target_, camera_, {}));
  EXPECT_EQ(json["jpeg"], 0);
  EXPECT_EQ(json["status"], 5);
  EXPECT_TRUE(json["outline"].empty());
}

}  // namespace
}  // namespace perch
