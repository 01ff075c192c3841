#include "perch/estimator/estimator.h"

#include <gmock/gmock.h>

#include <vector>

#include "perch/geometry/euler.h"
#include "support/drawing.h"
#include "support/near_pose.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr int64_t kFrameNs = 33'333'333;

class Estimating : public testing::Test {
 protected:
  Estimating() {
    config.target = sharp_target();
    config.detection.method = DetectionMethod::kPaper;  // its 24 corners can be counted
  }

  Estimator estimator() const { return Estimator(config, camera); }

  Frame frame_of(int number, const cv::Mat& grey) const {
    return {number * kFrameNs, grey, "frame " + std::to_string(number), {}, ""};
  }
  Frame seeing(int number, const Rigid3& camera_from_target) const {
    return frame_of(number, picture_of(config.target, camera, camera_from_target));
  }
  Frame blank(int number) const { return frame_of(number, cv::Mat(480, 640, CV_8UC1, cv::Scalar(60))); }

  // The attitude of a vehicle whose body is the camera, over a level pad, that sees the target so.
  static Estimator::Aid attitude(const Rigid3& camera_from_target) {
    Estimator::Aid aid;
    aid.world_from_body = camera_from_target.rotation.conjugate();
    return aid;
  }

  RunConfig config;
  CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, 640, 480);
};

// The truth is as near as the estimate says: chi-square of 6 degrees of freedom, one in 10,000.
MATCHER_P(IsHonestAbout, truth, "") {
  const double squared = normalised_error_squared(pose_error(arg.mean, truth), arg.covariance);
  *result_listener << "normalised error squared " << squared;
  return squared <= 27.9;
}

TEST_F(Estimating, GivesEachFrameItsRowInTheirOrder) {
  auto e = estimator();
  for (int i = 0; i < 10; ++i) {
    const Rigid3 pose = looking_pose(2.5 - 0.02 * i, 0.3, 1, 0.4 + 0.01 * i, {0.01 * i, 0});
    const bool shown = i % 3 != 2;
    const Estimate estimate = e.process(shown ? seeing(i, pose) : blank(i));
    EXPECT_EQ(estimate.timestamp_ns, i * kFrameNs);
    ASSERT_EQ(estimate.status, shown ? EstimateStatus::kOk : EstimateStatus::kNoTarget) << i;
    EXPECT_TRUE(estimate.problem.empty());
    EXPECT_EQ(estimate.pad_from_body.has_value(), shown);
    EXPECT_EQ(estimate.features, shown ? 24 : 0);
    EXPECT_EQ(estimate.correspondences.size(), shown ? 24u : 0u);
    if (!shown) continue;
    EXPECT_THAT(estimate.camera_from_target, IsHonestAbout(pose));
    EXPECT_THAT(*estimate.pad_from_body, IsHonestAbout(inverse(pose)));
    // Corners to half a pixel of a target of 240 px: a few per cent is what is left to the worst direction.
    EXPECT_THAT(estimate.camera_from_target.mean, IsNearPose(pose, 0.05, 0.05));
  }
}

// The same pad from the same place while the lens zooms in: each frame through the lens of its own zoom.
TEST_F(Estimating, TakesTheModelOfEachFramesZoom) {
  const auto zoomed = [](double zoom) {
    return CameraModel::pinhole(600 * zoom, 600 * zoom, 319.5, 239.5, 640, 480);
  };
  config.zoom_table = ZoomTable({{1, zoomed(1)}, {1.4, zoomed(1.4)}, {2, zoomed(2)}});
  auto e = estimator();
  const Rigid3 pose = looking_pose(5, 0.3, 1, 0.4);
  int number = 0;
  // 1.2 is between those calibrated, a place where the table is good to 0.5 %.
  for (const auto& [zoom, relative] :
       {std::pair(1.0, 0.01), {1.4, 0.01}, {1.2, 0.015}, {2.0, 0.01}, {1.0, 0.01}}) {
    const Frame frame = frame_of(number++, picture_of(config.target, zoomed(zoom), pose));
    Estimator::Aid aid;
    aid.zoom = zoom;
    const Estimate estimate = e.process(frame, aid);
    ASSERT_EQ(estimate.status, EstimateStatus::kOk) << zoom;
    EXPECT_NEAR(estimate.camera_from_target.mean.translation.norm(), 5, 5 * relative) << zoom;
  }
  EXPECT_EQ(e.process(seeing(number, pose)).status, EstimateStatus::kUnreadable);
  Estimator::Aid beyond;
  beyond.zoom = 3;
  EXPECT_THAT(e.process(seeing(number, pose), beyond).problem, testing::HasSubstr("zoom 3"));
}

TEST_F(Estimating, SaysWhichPictureIsUnreadableAndWhy) {
  auto e = estimator();
  Frame broken = blank(1);
  broken.grey.release();
  broken.problem = "flight/cam0/data/17.png: truncated";
  const Estimate truncated = e.process(broken);
  EXPECT_EQ(truncated.status, EstimateStatus::kUnreadable);
  EXPECT_EQ(truncated.problem, "flight/cam0/data/17.png: truncated");

  const Estimate wrong_size = e.process(frame_of(2, cv::Mat(240, 320, CV_8UC1, cv::Scalar(0))));
  EXPECT_EQ(wrong_size.status, EstimateStatus::kUnreadable);
  EXPECT_EQ(wrong_size.timestamp_ns, 2 * kFrameNs);
  EXPECT_EQ(wrong_size.problem,
            "frame 2: expected a picture of the camera model's 640x480 pixels, found 320x240");

  const Estimate empty = e.process(frame_of(3, cv::Mat()));
  EXPECT_EQ(empty.status, EstimateStatus::kUnreadable);
  EXPECT_EQ(empty.problem, "frame 3: expected a picture of the camera model's 640x480 pixels, found 0x0");
  EXPECT_FALSE(empty.state);
}

TEST_F(Estimating, RefusesAPictureThatIsNotGrey) {
  // An image source gives CV_8UC1; anything else is a mistake of ours or a new source's, and no reason to
  // read beyond a row.
  auto e = estimator();
  for (const int type : {CV_8UC3, CV_16UC1}) {
    const Estimate estimate = e.process(frame_of(1, cv::Mat(480, 640, type, cv::Scalar(0))));
    EXPECT_EQ(estimate.status, EstimateStatus::kUnreadable);
    EXPECT_EQ(estimate.problem, "frame 1: expected 8 bits of grey a pixel");
  }
}

TEST_F(Estimating, GivesTheSameFramesTheSameEstimatesBitForBit) {
  TestRng rng;
  std::vector<Frame> frames;
  for (int i = 0; i < 25; ++i) {
    Drawing drawing;
    drawing.noise = 4;
    const Rigid3 pose = looking_pose(8 - 0.25 * i, 0.2, 1, 0.4 + 0.02 * i, {0.3 - 0.02 * i, 0.1});
    frames.push_back(i % 7 == 3 ? blank(i)
                                : frame_of(i, picture_of(config.target, camera, pose, drawing, &rng)));
  }
  auto a = estimator();
  auto b = estimator();
  for (const auto& frame : frames) {
    const Estimate p = a.process(frame), q = b.process(frame);
    ASSERT_EQ(p.status, q.status);
    EXPECT_EQ(p.camera_from_target.mean.translation, q.camera_from_target.mean.translation);
    EXPECT_EQ(p.camera_from_target.mean.rotation.coeffs(), q.camera_from_target.mean.rotation.coeffs());
    EXPECT_EQ(p.camera_from_target.covariance, q.camera_from_target.covariance);
    EXPECT_EQ(p.reprojection_rms_px, q.reprojection_rms_px);
    EXPECT_EQ(p.ambiguity, q.ambiguity);
    ASSERT_EQ(p.state.has_value(), q.state.has_value());
    if (!p.state) continue;
    EXPECT_EQ(p.state->source, q.state->source);
    EXPECT_EQ(p.state->pad_from_body.translation, q.state->pad_from_body.translation);
    EXPECT_EQ(p.state->body_velocity_in_pad, q.state->body_velocity_in_pad);
    EXPECT_EQ(p.state->covariance, q.state->covariance);
  }
}

// From far, 12 degrees of tilt look like 12 degrees the other way.
class Ambiguous : public Estimating {
 protected:
  static constexpr double kDistance = 12, kTilt = 0.2, kAbout = 0.7, kYaw = 0.4;
  Rigid3 truth = looking_pose(kDistance, kTilt, kAbout, kYaw);
  Rigid3 mirrored = looking_pose(kDistance, -kTilt, kAbout, kYaw);
};

// Nearer to the one than to the other, and not far from it: half of the 23 degrees between them.
MATCHER_P(LeansAs, expected, "") {
  const Eigen::Vector3d a = arg.rotation * Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d b = expected.rotation * Eigen::Vector3d::UnitZ();
  const double angle = std::atan2(a.cross(b).norm(), a.dot(b));
  *result_listener << "its normal is off by " << angle << " rad";
  return angle < 0.2;
}

TEST_F(Ambiguous, IsSaidToBeSoWhenNothingDecides) {
  const Estimate estimate = estimator().process(seeing(0, truth));
  EXPECT_EQ(estimate.status, EstimateStatus::kAmbiguous);
  EXPECT_GT(estimate.ambiguity, 0.1);
  EXPECT_FALSE(estimate.pad_from_body);
  EXPECT_FALSE(estimate.state);
}

TEST_F(Ambiguous, IsDecidedByGravity) {
  const Frame frame = seeing(0, truth);
  const Estimate right = estimator().process(frame, attitude(truth));
  ASSERT_EQ(right.status, EstimateStatus::kOk);
  EXPECT_THAT(right.camera_from_target.mean, LeansAs(truth));
  // Whichever it says: the picture has no voice here.
  const Estimate left = estimator().process(frame, attitude(mirrored));
  ASSERT_EQ(left.status, EstimateStatus::kOk);
  EXPECT_THAT(left.camera_from_target.mean, LeansAs(mirrored));
}

TEST_F(Ambiguous, IsDecidedByTheFramesBefore) {
  auto e = estimator();
  int i = 0;
  for (; i < 5; ++i) ASSERT_EQ(e.process(seeing(i, truth), attitude(truth)).status, EstimateStatus::kOk);
  const Estimate estimate = e.process(seeing(i, truth));
  ASSERT_EQ(estimate.status, EstimateStatus::kOk);
  EXPECT_THAT(estimate.camera_from_target.mean, LeansAs(truth));
}

TEST_F(Estimating, NoHintTurnsARejectedPoseIntoAnEstimate) {
  // Another board that can be labelled like ours: its square A is smaller by a third, which puts corners of a
  // 240 px target 10 px off.
  LandingTarget other = sharp_target();
  other.patches[2].corners = square_corners({0.04, 0.04}, 0.17);
  const Rigid3 pose = looking_pose(2.5, 0.3, 1, 0.4);
  const Frame wrong = frame_of(3, picture_of(other, camera, pose));
  const Estimate alone = estimator().process(wrong);
  ASSERT_EQ(alone.correspondences.size(), 24u);
  EXPECT_EQ(alone.status, EstimateStatus::kRejected);
  EXPECT_FALSE(alone.pad_from_body);

  auto e = estimator();
  for (int i = 0; i < 3; ++i)
    ASSERT_EQ(e.process(seeing(i, pose), attitude(pose)).status, EstimateStatus::kOk);
  const Estimate hinted = e.process(wrong, attitude(pose));
  EXPECT_EQ(hinted.status, EstimateStatus::kRejected);
  EXPECT_FALSE(hinted.pad_from_body);
}

TEST_F(Estimating, GivesStatesFromTheFirstDetectionOn) {
  auto e = estimator();
  const Rigid3 pose = looking_pose(2.5, 0.3, 1, 0.4);
  int i = 0;
  for (; i < 3; ++i) EXPECT_FALSE(e.process(blank(i)).state) << i;
  const Estimate first = e.process(seeing(i++, pose));
  ASSERT_TRUE(first.state);
  EXPECT_EQ(first.state->source, StateSource::kVision);
  EXPECT_EQ(first.state->timestamp_ns, first.timestamp_ns);
  EXPECT_THAT(first.state->pad_from_body, IsNearPose(first.pad_from_body->mean, 1e-12, 1e-12));
  const Estimate next = e.process(blank(i++));
  ASSERT_TRUE(next.state);
  EXPECT_EQ(next.state->source, StateSource::kPredicted);
  // Unreadable frames have states too: time goes on.
  Frame broken = blank(i++);
  broken.problem = "truncated";
  ASSERT_TRUE(e.process(broken).state);
  // More than a second without a pose.
  const Estimate late = e.process(blank(i + 40));
  ASSERT_TRUE(late.state);
  EXPECT_EQ(late.state->source, StateSource::kLost);
}

TEST_F(Estimating, TimesItsStepsAndTheWhole) {
  const Estimate estimate = estimator().process(seeing(0, looking_pose(2.5, 0.3, 1, 0.4)));
  std::vector<std::string> stages;
  double sum = 0;
  for (const auto& s : estimate.stages) {
    stages.emplace_back(s.stage);
    sum += s.us;
  }
  EXPECT_EQ(stages, (std::vector<std::string>{"histogram", "segmentation", "corners", "labelling", "pose",
                                              "frames", "tracking"}));
  EXPECT_GT(estimate.detect_us, 0);
  EXPECT_GT(estimate.pose_us, 0);
  EXPECT_GE(estimate.total_us, estimate.detect_us + estimate.pose_us);
  EXPECT_GE(estimate.total_us, sum);
}

TEST(EstimateStatus, HasTheNamesOfTheFile) {
  EXPECT_STREQ(to_string(EstimateStatus::kOk), "ok");
  EXPECT_STREQ(to_string(EstimateStatus::kNoTarget), "no_target");
  EXPECT_STREQ(to_string(EstimateStatus::kPartial), "partial");
  EXPECT_STREQ(to_string(EstimateStatus::kAmbiguous), "ambiguous");
  EXPECT_STREQ(to_string(EstimateStatus::kRejected), "rejected");
  EXPECT_STREQ(to_string(EstimateStatus::kUnreadable), "unreadable");
}

}  // namespace
}  // namespace perch
