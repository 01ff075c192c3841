#include <cmath>
#include <opencv2/imgproc.hpp>

#include "perch/detection/edges_detector.h"
#include "support/count_allocations.h"
#include "support/drawing.h"
#include "support/random_picture.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(300, 300, 159.5, 119.5, 320, 240);
  return camera;
}

struct View {
  cv::Mat grey;
  Rigid3 pose;
};

// Targets, every third one under something that hides all of it, so that the whole picture is searched in
// every way there is.
std::vector<View> views(const LandingTarget& target) {
  TestRng rng;
  std::vector<View> made;
  for (int i = 0; i < 15; ++i) {
    const Rigid3 pose = looking_pose(rng.uniform(1.5, 5), rng.uniform(0, 1), rng.uniform(0, 6.3),
                                     rng.uniform(0, 6.3), {rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)});
    Drawing drawing;
    drawing.noise = rng.uniform(0, 10);
    drawing.blur_px = rng.uniform(0.3, 1.5);
    made.push_back({picture_of(target, camera(), pose, drawing, &rng), pose});
    if (i % 3 == 0) random_picture(rng, 320, 240).copyTo(made.back().grey);
  }
  return made;
}

TEST(EdgesRobustness, AllocatesNothingOnceItsBuffersHaveGrown) {
  const LandingTarget target = sharp_target();
  EdgesDetector detector(target, camera(), {});
  const auto shown = views(target);
  PoseCovariance covariance = PoseCovariance::Zero();
  covariance.diagonal() << Eigen::Vector3d::Constant(1e-4), Eigen::Vector3d::Constant(1e-4);
  int found = 0;
  const auto all = [&] {
    for (const View& view : shown) {
      found += detector.detect(view.grey, {}).status == DetectionStatus::kFound;
      // Looked for about there; and measured there at once, as its blur is known.
      for (const double blur_px : {0.0, 0.75}) {
        const Prediction prediction{{view.pose, covariance}, blur_px};
        found += detector.detect(view.grey, prediction).status == DetectionStatus::kFound;
      }
    }
  };
  all();
  const int before = allocations;
  if (before == 0) GTEST_SKIP() << "nothing is counted in this build";
  all();
  EXPECT_EQ(allocations - before, 0);
  EXPECT_GE(found, 45);
}

TEST(EdgesRobustness, TheSamePictureGivesTheSameResultWhateverCameBefore) {
  const LandingTarget target = sharp_target();
  EdgesDetector used(target, camera(), {});
  for (const View& view : views(target)) {
    EdgesDetector fresh(target, camera(), {});
    const Detection& expected = fresh.detect(view.grey, {});
    const Detection& found = used.detect(view.grey, {});
    ASSERT_EQ(found.status, expected.status);
    ASSERT_EQ(found.correspondences.size(), expected.correspondences.size());
    for (size_t k = 0; k < found.correspondences.size(); ++k)
      EXPECT_EQ(found.correspondences[k].pixel, expected.correspondences[k].pixel);
  }
}

}  // namespace
}  // namespace perch
