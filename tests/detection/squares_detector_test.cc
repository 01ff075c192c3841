#include "perch/detection/squares_detector.h"

#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <vector>

#include "perch/geometry/euler.h"
#include "support/drawing.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

// 56 degrees wide.
CameraModel camera_of(int width, int height) {
  const double f = 0.94 * width;
  return CameraModel::pinhole(f, f, (width - 1) / 2.0, (height - 1) / 2.0, width, height);
}

// A corner of 90 degrees can be missed by 2.4 px and one of 127, as a square has at 60 degrees of tilt,
// by 3.4 (see corners_test); how good they are on the average is a test of its own.
constexpr double kCornerPx = 2.4, kSlantedCornerPx = 3.4;

class Detecting : public testing::Test {
 protected:
  const Detection& detect(const cv::Mat& grey) { return detector.detect(grey, {}); }

  double squared_errors(const Detection& found, const Rigid3& pose) const {
    double sum = 0;
    for (const auto& c : found.correspondences) {
      sum += (c.pixel - seen_at(camera, pose, target.features[static_cast<size_t>(c.feature)].point))
                 .squaredNorm();
    }
    return sum;
  }

  LandingTarget target = sharp_target();
  SquaresDetector detector{target, {}};
  CameraModel camera = camera_of(640, 480);
  Rigid3 near = looking_pose(2.5, 0.3, 1, 0.4);  // the target is 240 px wide
};

TEST_F(Detecting, FindsAllCornersFromEverySideInPicturesOfEverySize) {
  TestRng rng;
  for (const cv::Size size : {cv::Size(160, 120), cv::Size(320, 240), cv::Size(640, 480), cv::Size(1280, 720),
                              cv::Size(1920, 1080)}) {
    camera = camera_of(size.width, size.height);
    double squares = 0;
    const int poses = size.width > 700 ? 6 : 30;
    for (int i = 0; i < poses; ++i) {
      // From 0.7 of the picture's height down to squares of 8 px, whichever the tilt leaves of them.
      const double tilt = rng.uniform(0, 60) * kRadFromDeg;
      const double nearest = 0.94 * size.width / (0.7 * size.height);
      const double farthest = std::max(nearest, 0.94 * size.width * 0.1 * std::cos(tilt) / 8);
      const Rigid3 pose =
          looking_pose(rng.uniform(nearest, farthest), tilt, rng.uniform(0, 2 * M_PI),
                       rng.uniform(0, 2 * M_PI), {rng.uniform(-0.05, 0.05), rng.uniform(-0.05, 0.05)});
      Drawing drawing;
      drawing.noise = 2;
      const Detection& found = detect(picture_of(target, camera, pose, drawing, &rng));
      ASSERT_LE(worst_corner_px(found, target, camera, pose), kSlantedCornerPx)
          << size << ", pose " << i << " at " << pose.translation.z() << " m, tilt " << tilt * kDegFromRad;
      squares += squared_errors(found, pose);
    }
    // As good as they say, of 288 coordinates and more.
    EXPECT_LE(std::sqrt(squares / (48 * poses)), PaperOptions{}.corner_sigma_px) << size;
  }
}

TEST_F(Detecting, NamesTheFeaturesInTheirOrder) {
  const Detection& found = detect(picture_of(target, camera, near));
  ASSERT_EQ(found.status, DetectionStatus::kFound);
  ASSERT_EQ(found.correspondences.size(), 24u);
  for (int i = 0; i < 24; ++i) {
    EXPECT_EQ(found.correspondences[static_cast<size_t>(i)].feature, i);
    EXPECT_EQ(found.correspondences[static_cast<size_t>(i)].sigma_px, PaperOptions{}.corner_sigma_px);
  }
}

TEST_F(Detecting, PutsTheThresholdWhereThePaperDoes) {
  Drawing drawing;
  drawing.blur_px = 0;
  EXPECT_EQ(detect(picture_of(target, camera, near, drawing)).threshold, 20 + 130);  // 0.65 of 20 .. 220
}

TEST_F(Detecting, SaysHowLongEachStepTook) {
  std::vector<std::string> stages;
  for (const auto& s : detect(picture_of(target, camera, near)).stages) {
    stages.emplace_back(s.stage);
    EXPECT_GE(s.us, 0);
  }
  EXPECT_EQ(stages, (std::vector<std::string>{"histogram", "segmentation", "corners", "labelling"}));
}

TEST_F(Detecting, RefusesATargetWithoutOneOfItsParts) {
  for (int part = 0; part < 8; ++part) {  // the border, the interior, six squares
    Drawing drawing;
    drawing.skip = {part};
    const Detection& found = detect(picture_of(target, camera, near, drawing));
    EXPECT_EQ(found.status, DetectionStatus::kNoTarget) << part;
    EXPECT_TRUE(found.correspondences.empty());
  }
}

// A line of the target's plane painted over the picture.
void paint_line(cv::Mat& grey, const CameraModel& camera, const Rigid3& pose, const Eigen::Vector2d& a,
                const Eigen::Vector2d& b, int level, int thickness) {
  const Eigen::Vector2d p = seen_at(camera, pose, a), q = seen_at(camera, pose, b);
  cv::line(grey, cv::Point2d(p.x(), p.y()), cv::Point2d(q.x(), q.y()), cv::Scalar(level), thickness);
}

TEST_F(Detecting, RefusesABrokenBorder) {
  cv::Mat grey = picture_of(target, camera, near);
  ASSERT_EQ(detect(grey).status, DetectionStatus::kFound);
  paint_line(grey, camera, near, {0, 0.3}, {0, 0.6}, 40, 5);  // the interior runs out into the ground
  EXPECT_EQ(detect(grey).status, DetectionStatus::kNoTarget);
}

TEST_F(Detecting, RefusesATargetWithMoreOnItThanItsParts) {
  cv::Mat grey = picture_of(target, camera, near);
  paint_line(grey, camera, near, {0.2, -0.1}, {0.25, -0.1}, 220, 5);  // a seventh square
  EXPECT_EQ(detect(grey).status, DetectionStatus::kNoTarget);
  grey = picture_of(target, camera, near);
  paint_line(grey, camera, near, {0.1, 0.1}, {0.15, 0.1}, 20, 5);  // a hole in square A
  EXPECT_EQ(detect(grey).status, DetectionStatus::kNoTarget);
}

TEST_F(Detecting, IgnoresSpecksBelowTheirSize) {
  cv::Mat grey = picture_of(target, camera, near);
  // One sampled row of two pixels, in the black and in the white.
  for (const Eigen::Vector2d& at : {Eigen::Vector2d(0.2, -0.1), Eigen::Vector2d(0.12, 0.12)}) {
    const Eigen::Vector2d p = seen_at(camera, near, at);
    const cv::Rect speck(static_cast<int>(p.x()), static_cast<int>(p.y()), 2, 2);
    grey(speck) = at.y() < 0 ? 220 : 20;
  }
  EXPECT_LE(worst_corner_px(detect(grey), target, camera, near), kCornerPx);
}

TEST_F(Detecting, DoesNotMindOtherThingsAround) {
  cv::Mat grey = picture_of(target, camera, near);
  cv::circle(grey, {40, 40}, 30, cv::Scalar(220), cv::FILLED);
  cv::circle(grey, {40, 40}, 20, cv::Scalar(20), cv::FILLED);
  cv::rectangle(grey, cv::Rect(0, 400, 640, 20), cv::Scalar(200), cv::FILLED);  // from edge to edge
  cv::rectangle(grey, cv::Rect(600, 0, 40, 300), cv::Scalar(180), cv::FILLED);
  EXPECT_LE(worst_corner_px(detect(grey), target, camera, near), kCornerPx);
}

TEST_F(Detecting, TakesTheLargestOfSeveralTargets) {
  for (const double side : {-1, 1}) {
    const Rigid3 large = looking_pose(4.5, 0.3, 1, 0.4, {side, 0});
    const Rigid3 small = looking_pose(6, 0.3, 1, 2.4, {-side, 0.4 * side});
    cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(40));
    draw_target(grey, target, camera, large);
    draw_target(grey, target, camera, small);
    EXPECT_LE(worst_corner_px(detect(grey), target, camera, large), kCornerPx) << side;
  }
}

TEST_F(Detecting, SeesPastARegionThatOnlyCountsLikeATarget) {
  // Six discs on a black one in a white ring, larger than the target: the paper would take it.
  cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(40));
  cv::circle(grey, {180, 240}, 170, cv::Scalar(220), cv::FILLED);
  cv::circle(grey, {180, 240}, 140, cv::Scalar(20), cv::FILLED);
  for (const auto& square : std::get<SquaresLayout>(target.layout).squares) {
    const Eigen::Vector2d c = square.lower_left + Eigen::Vector2d::Constant(square.side / 2);
    cv::circle(grey, cv::Point2d(180 + 250 * c.x(), 240 - 250 * c.y()), static_cast<int>(120 * square.side),
               cv::Scalar(220), cv::FILLED);
  }
  EXPECT_EQ(detect(grey).status, DetectionStatus::kNoTarget);
  const Rigid3 pose = looking_pose(4, 0.2, 0, 0, {1.2, 0});
  draw_target(grey, target, camera, pose);
  EXPECT_LE(worst_corner_px(detect(grey), target, camera, pose), kCornerPx);
}

TEST_F(Detecting, MeasuresSlantingSquares) {
  // Seen from low, also along its diagonal, where a square's box is mostly its neighbours'.
  int found = 0;
  for (int degrees = 0; degrees < 360; degrees += 5) {
    const Rigid3 pose = looking_pose(1.6, 70 * kRadFromDeg, degrees * kRadFromDeg, 0);
    const double worst = worst_corner_px(detect(picture_of(target, camera, pose)), target, camera, pose);
    // Tips of 40 degrees lose more of their length than others, as 1 / sin 20 deg says.
    if (worst < 4.2) ++found;
  }
  EXPECT_EQ(found, 72);
}

TEST_F(Detecting, FindsATargetThatFillsThePicture) {
  // Head-on, the border's outer edges 0.4 px inside the picture's.
  camera = CameraModel::pinhole(479.2, 479.2, 239.5, 239.5, 480, 480);
  const Rigid3 pose = looking_pose(1, 0, 0, 0);
  EXPECT_LE(worst_corner_px(detect(picture_of(target, camera, pose)), target, camera, pose), kCornerPx);
}

TEST_F(Detecting, FindsATargetWhoseBorderLeavesThePictureButNotOneWhoseInteriorDoes) {
  // Head-on at 2 m: 5 cm are 15 px, the interior's edge is at 105 px from the centre, the border's at 150 px.
  const double metre_px = 0.94 * 640 / 2;
  const auto moved_right = [&](double edge_in_px) {  // the interior's right edge so far inside the picture
    return looking_pose(2, 0, 0, 0, {(319.5 - edge_in_px) / metre_px - 0.35, 0});
  };
  const Rigid3 border_cut = moved_right(5);
  EXPECT_LE(worst_corner_px(detect(picture_of(target, camera, border_cut)), target, camera, border_cut),
            kCornerPx);
  EXPECT_EQ(detect(picture_of(target, camera, moved_right(-5))).status, DetectionStatus::kNoTarget);
}

TEST_F(Detecting, FindsNothingWhereNothingIs) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(2, 1), cv::Size(1, 50), cv::Size(640, 480)}) {
    for (const int level : {0, 128, 255}) {
      EXPECT_EQ(detect(cv::Mat(size, CV_8UC1, cv::Scalar(level))).status, DetectionStatus::kNoTarget) << size;
    }
  }
  const Detection& of_nothing = detect(cv::Mat());
  EXPECT_EQ(of_nothing.status, DetectionStatus::kNoTarget);
  EXPECT_EQ(of_nothing.threshold, -1);
  EXPECT_TRUE(of_nothing.stages.empty());
  // Three pixels of target.
  EXPECT_EQ(detect(picture_of(target, camera, looking_pose(200, 0, 0, 0))).status,
            DetectionStatus::kNoTarget);
}

TEST_F(Detecting, ReadsPicturesOfUnusualShape) {
  const Rigid3 pose = looking_pose(7, 0.2, 1, 0.5, {3, 0});
  camera = CameraModel::pinhole(1000, 1000, 4000, 100, 8192, 201);
  EXPECT_LE(worst_corner_px(detect(picture_of(target, camera, pose)), target, camera, pose), kCornerPx);
  // Part of a larger picture, with more beside it.
  const cv::Mat whole = picture_of(target, camera, pose);
  const cv::Rect part(4203, 11, 463, 180);
  camera = CameraModel::pinhole(1000, 1000, 4000 - part.x, 100 - part.y, part.width, part.height);
  EXPECT_LE(worst_corner_px(detect(whole(part)), target, camera, pose), kCornerPx);
}

TEST_F(Detecting, ReachesDownToSquaresOfFourPixels) {
  // With every second row sampled, all of them at 3.5 px and one target in ten lost at 3; blur takes its part
  // of the white.
  TestRng rng;
  double squares = 0;
  constexpr int kPoses = 50;
  for (int i = 0; i < kPoses; ++i) {
    const Rigid3 pose = looking_pose(0.94 * 640 * 0.1 / 4, 0, 0, rng.uniform(0, 2 * M_PI),
                                     {rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1)});
    const Detection& found = detect(picture_of(target, camera, pose));
    ASSERT_EQ(found.status, DetectionStatus::kFound) << i;
    squares += squared_errors(found, pose);
  }
  // A square of 12 pixels may show its corners anywhere: 1.5 times what the others are good to.
  EXPECT_LE(std::sqrt(squares / (48 * kPoses)), 1.5 * PaperOptions{}.corner_sigma_px);
}

class DetectingNested : public Detecting {
 protected:
  DetectingNested() : detector(nested_target(), {}) { target = nested_target(); }
  SquaresDetector detector;
};

TEST_F(DetectingNested, MeasuresTheOuterSquaresFromFarAndNear) {
  TestRng rng;
  // From where the inner target is 3 px wide, nothing or a speck, to where its squares can be told, and where
  // the border's edges leave the picture.
  for (const double distance : {9.0, 7.5, 7.0, 6.0, 5.0, 4.5, 4.0, 3.5, 3.0, 2.5, 2.0, 1.7}) {
    for (int i = 0; i < 4; ++i) {
      const Rigid3 pose = looking_pose(distance, rng.uniform(0, 0.4), rng.uniform(0, 6), i * 0.8);
      const Detection& found = detector.detect(picture_of(target, camera, pose), {});
      ASSERT_EQ(found.status, DetectionStatus::kFound) << distance << " m, pose " << i;
      EXPECT_EQ(found.correspondences[0].feature, 0);
      EXPECT_LE(worst_corner_px(found, target, camera, pose), kCornerPx) << distance << " m, pose " << i;
    }
  }
}

TEST_F(DetectingNested, MeasuresTheInnerSquaresWhereTheOuterOnesAreNotAllThere) {
  // Above the inner target, which lies at 0.125, 0.125.
  for (const double distance : {0.6, 0.5, 0.4, 0.3, 0.25}) {
    const Rigid3 pose = looking_pose(distance, 0.1, 1, 0, {-0.125, 0.125});
    const Detection& found = detector.detect(picture_of(target, camera, pose), {});
    ASSERT_EQ(found.status, DetectionStatus::kFound) << distance;
    EXPECT_EQ(found.correspondences[0].feature, 24);
    EXPECT_LE(worst_corner_px(found, target, camera, pose), kCornerPx) << distance;
  }
}

TEST_F(DetectingNested, DoesNotTakeTheInnerTargetForTheOuterWhenItsRingIsBroken) {
  for (const double distance : {2.0, 1.8, 1.3, 1.1, 0.9, 0.7, 0.5, 0.4, 0.3}) {
    // In the picture's middle, and so far aside that the outer target's interior leaves the picture.
    for (const double aside : {0.0, 0.35}) {
      const Rigid3 pose = looking_pose(distance, 0.1, 1, 0, {aside * distance - 0.125, 0.125});
      cv::Mat grey = picture_of(target, camera, pose);
      paint_line(grey, camera, pose, {0.04, 0.125}, {-0.02, 0.125}, 20,
                 5);  // a shadow from the hole outwards
      const Detection& found = detector.detect(grey, {});
      if (found.status != DetectionStatus::kFound) continue;
      EXPECT_LE(worst_corner_px(found, target, camera, pose), kSlantedCornerPx) << distance << ", " << aside;
    }
  }
}

TEST_F(DetectingNested, TellsADarkMatOnAPaleFloorFromTheHole) {
  // The mat as large as the hole would be, larger, and on a white sheet that is no ring.
  for (const double mat : {1.23, 1.5}) {
    for (const double sheet : {0.0, 2.6}) {
      for (const double distance : {9.0, 7.5, 6.0, 4.0, 3.0}) {
        const Rigid3 pose = looking_pose(distance, 0.2, 1, 0.5);
        LandingTarget laid_out = target;
        const auto patch = [&](double side, bool white) {
          return Patch{square_corners(Eigen::Vector2d::Constant(-side / 2), side), white};
        };
        laid_out.patches.insert(laid_out.patches.begin(), patch(mat, false));
        if (sheet > 0) laid_out.patches.insert(laid_out.patches.begin(), patch(sheet, true));
        Drawing drawing;
        drawing.ground = sheet > 0 ? 40 : 190;
        const Detection& found = detector.detect(picture_of(laid_out, camera, pose, drawing), {});
        EXPECT_LE(worst_corner_px(found, target, camera, pose), kCornerPx) << mat << ", " << distance;
      }
    }
  }
}

TEST_F(DetectingNested, NeverMistakesOneTargetForTheOther) {
  TestRng rng;
  camera = camera_of(320, 240);
  int outer = 0, inner = 0;
  for (int i = 0; i < 150; ++i) {
    // All the way down, anywhere in and half out of the picture, on ground as dark as the paper asks or pale.
    const double distance = 0.2 * std::pow(40, rng.uniform(0, 1));
    // No more tilt than leaves all of the target before the camera.
    const double tilt = rng.uniform(0, 0.8 * std::min(distance, 1.0));
    const Rigid3 pose =
        looking_pose(distance, tilt, rng.uniform(0, 6.3), rng.uniform(0, 6.3),
                     0.4 * distance * Eigen::Vector2d(rng.uniform(-1, 1), rng.uniform(-1, 1)));
    Drawing drawing;
    drawing.noise = 3;
    drawing.ground = rng.index(2) == 0 ? 40 : 190;
    drawing.blur_px = rng.uniform(0.4, 1.5);
    const Detection& found = detector.detect(picture_of(target, camera, pose, drawing, &rng), {});
    if (found.status != DetectionStatus::kFound) continue;
    ++(found.correspondences[0].feature == 0 ? outer : inner);
    // Squares blurred as wide as they are lose their corners: not so much that it would be the wrong target.
    EXPECT_LE(worst_corner_px(found, target, camera, pose), 6) << "pose " << i << " at " << distance << " m";
  }
  EXPECT_GE(outer, 15);
  EXPECT_GE(inner, 8);
}

TEST(SquaresDetector, RefusesATargetItCannotLabel) {
  LandingTarget board = sharp_target();
  board.layout = AprilTagBoard{};
  EXPECT_THROW(SquaresDetector(board, {}), std::invalid_argument);
  LandingTarget five = sharp_target();
  std::get<SquaresLayout>(five.layout).squares.pop_back();  // F: D has one pair left
  EXPECT_THROW(SquaresDetector(five, {}), std::invalid_argument);
}

}  // namespace
}  // namespace perch
