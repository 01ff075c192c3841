#include <cmath>
#include <opencv2/imgproc.hpp>

#include "perch/detection/squares_detector.h"
#include "support/count_allocations.h"
#include "support/drawing.h"
#include "support/random_picture.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(150, 150, 80, 60, 160, 120);
  return camera;
}

cv::Mat random_view(TestRng& rng, const LandingTarget& target) {
  const Rigid3 pose = looking_pose(rng.uniform(1, 4), rng.uniform(0, 1), rng.uniform(0, 6.3),
                                   rng.uniform(0, 6.3), {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)});
  Drawing drawing;
  drawing.noise = rng.uniform(0, 20);
  drawing.blur_px = rng.uniform(0, 2);
  return picture_of(target, camera(), pose, drawing, &rng);
}

// Whatever was in the picture, what comes out is either nothing or 24 finite corners near it.
void expect_sound(const Detection& found, const cv::Mat& grey) {
  if (found.status == DetectionStatus::kFound) {
    ASSERT_EQ(found.correspondences.size(), 24u);
    for (const auto& c : found.correspondences) {
      ASSERT_TRUE(c.pixel.x() >= -2 && c.pixel.x() <= grey.cols + 1) << c.pixel.transpose();
      ASSERT_TRUE(c.pixel.y() >= -2 && c.pixel.y() <= grey.rows + 1) << c.pixel.transpose();
    }
  } else {
    ASSERT_EQ(found.status, DetectionStatus::kNoTarget);
    ASSERT_TRUE(found.correspondences.empty());
  }
}

// A picture with something wrong in it: cut, smeared over, salted, inverted, half of another.
cv::Mat corrupted(TestRng& rng, cv::Mat grey, const LandingTarget& target) {
  for (int faults = 1 + rng.index(3); faults > 0; --faults) {
    const cv::Rect part(rng.index(grey.cols), rng.index(grey.rows), 1, 1);
    cv::Rect area(part.x, part.y, 1 + rng.index(grey.cols - part.x), 1 + rng.index(grey.rows - part.y));
    switch (rng.index(6)) {
      case 0:
        grey = grey(area);
        break;
      case 1:
        grey(area) = rng.index(256);
        break;
      case 2:
        random_picture(rng, area.width, area.height).copyTo(grey(area));
        break;
      case 3:
        grey = 255 - grey;
        break;
      case 4:
        cv::line(grey, part.tl(), {rng.index(grey.cols), rng.index(grey.rows)}, cv::Scalar(rng.index(256)),
                 1 + rng.index(6));
        break;
      default:
        cv::resize(random_view(rng, target), grey(area), area.size());
        break;
    }
  }
  return grey;
}

TEST(SquaresRobustness, SurvivesNoiseOfEveryKindAndSize) {
  TestRng rng;
  SquaresDetector sharp(sharp_target(), {}), nested(nested_target(), {});
  for (int i = 0; i < 1500; ++i) {
    const int width = 1 + rng.index(90), height = 1 + rng.index(90);
    cv::Mat grey = random_picture(rng, width, height);
    if (i % 2 == 0) cv::GaussianBlur(grey, grey, {}, rng.uniform(0.5, 4));
    if (i % 3 == 0) cv::normalize(grey, grey, 0, 255, cv::NORM_MINMAX);
    expect_sound(sharp.detect(grey, {}), grey);
    expect_sound(nested.detect(grey, {}), grey);
  }
}

TEST(SquaresRobustness, SurvivesCorruptedPicturesOfTargets) {
  TestRng rng;
  const LandingTarget target = sharp_target(), nested_one = nested_target();
  PaperOptions every_row;
  every_row.segmentation_row_step = 1;
  every_row.min_component_px = 1;
  SquaresDetector sharp(target, {}), nested(nested_one, {}), fine(target, every_row);
  int found = 0;
  for (int i = 0; i < 600; ++i) {
    const cv::Mat grey = corrupted(rng, random_view(rng, i % 2 == 0 ? target : nested_one), target);
    expect_sound(sharp.detect(grey, {}), grey);
    expect_sound(nested.detect(grey, {}), grey);
    expect_sound(fine.detect(grey, {}), grey);
    if (nested.detect(grey, {}).status == DetectionStatus::kFound) ++found;
  }
  EXPECT_GE(found, 30);  // the faults leave enough to go all the way
}

TEST(SquaresRobustness, TheSamePictureGivesTheSameResultWhateverCameBefore) {
  TestRng rng;
  const LandingTarget target = sharp_target();
  SquaresDetector used(target, {});
  for (int i = 0; i < 100; ++i) {
    const cv::Mat grey = random_view(rng, target);
    SquaresDetector fresh(target, {});
    const Detection& expected = fresh.detect(grey, {});
    const Detection& found = used.detect(grey, {});
    ASSERT_EQ(found.status, expected.status);
    ASSERT_EQ(found.threshold, expected.threshold);
    ASSERT_EQ(found.correspondences.size(), expected.correspondences.size());
    for (size_t k = 0; k < found.correspondences.size(); ++k) {
      EXPECT_EQ(found.correspondences[k].feature, expected.correspondences[k].feature);
      EXPECT_EQ(found.correspondences[k].pixel, expected.correspondences[k].pixel);
    }
  }
}

TEST(SquaresRobustness, AllocatesNothingOnceItsBuffersHaveGrown) {
  TestRng rng;
  const LandingTarget target = sharp_target(), nested_one = nested_target();
  SquaresDetector sharp(target, {}), nested(nested_one, {});
  std::vector<cv::Mat> pictures;
  for (int i = 0; i < 20; ++i) pictures.push_back(random_view(rng, i % 2 == 0 ? target : nested_one));
  int found = 0;
  const auto all = [&] {
    for (const auto& grey : pictures) {
      if (sharp.detect(grey, {}).status == DetectionStatus::kFound) ++found;
      if (nested.detect(grey, {}).status == DetectionStatus::kFound) ++found;
    }
  };
  all();
  const int before = allocations;
  if (before == 0) GTEST_SKIP() << "nothing is counted in this build";
  all();
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GE(found, 20);
}

}  // namespace
}  // namespace perch
