// What is like the target but is not it, at random: none of it may be taken for it. PERCH_SCENES=1000 for
// more of each kind; a failure's picture goes to PERCH_FAILURES, a folder.

#include <gtest/gtest.h>

#include <cstdlib>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "perch/detection/edges_detector.h"
#include "support/drawing.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

constexpr double kModule = 0.05;  // m, as sharp_target has it

const CameraModel& camera() {
  static const CameraModel camera = CameraModel::pinhole(600, 600, 319.5, 239.5, 640, 480);
  return camera;
}

// In modules from the lower left corner, as configs/targets/sharp.yaml.
struct Box {
  double column, row, side;
};
const std::vector<Box> kSharp = {{10, 10, 5}, {5, 13, 2}, {5, 9, 2}, {5, 5, 2}, {9, 5, 2}, {13, 5, 2}};

Quad quad_of(double column, double row, double width, double height) {
  const Eigen::Vector2d from((column - 10) * kModule, (row - 10) * kModule);
  const Eigen::Vector2d to = from + kModule * Eigen::Vector2d(width, height);
  return {to, Eigen::Vector2d(from.x(), to.y()), from, Eigen::Vector2d(to.x(), from.y())};
}

// A black panel in a white border, as wide as the target's.
LandingTarget panel() {
  LandingTarget target;
  target.size = 1;
  target.patches = {{quad_of(0, 0, 20, 20), true}, {quad_of(3, 3, 14, 14), false}};
  return target;
}

LandingTarget panel_of(const std::vector<Box>& squares) {
  LandingTarget target = panel();
  for (const Box& box : squares)
    target.patches.push_back({quad_of(box.column, box.row, box.side, box.side), true});
  return target;
}

// A module apart, in the interior.
bool is_free(const std::vector<Box>& squares, const Box& box, size_t but) {
  if (box.column < 4 || box.row < 4 || box.column + box.side > 16 || box.row + box.side > 16) return false;
  for (size_t i = 0; i < squares.size(); ++i) {
    if (i == but) continue;
    const Box& other = squares[i];
    if (box.column < other.column + other.side + 1 && other.column < box.column + box.side + 1 &&
        box.row < other.row + other.side + 1 && other.row < box.row + box.side + 1) {
      return false;
    }
  }
  return true;
}

// Two squares of the paper's layout are elsewhere. With one it is what something pale that covers one looks
// like.
LandingTarget two_moved(TestRng& rng) {
  std::vector<Box> squares = kSharp;
  for (int moved = 0; moved < 2;) {
    const auto i = static_cast<size_t>(rng.index(6));
    const Box to{4.0 + rng.index(12), 4.0 + rng.index(12), squares[i].side};
    const double off = std::hypot(to.column - squares[i].column, to.row - squares[i].row);
    if (off < 2 || !is_free(squares, to, i) || squares[i].side != kSharp[i].side) continue;
    if (squares[i].column != kSharp[i].column || squares[i].row != kSharp[i].row) continue;
    squares[i] = to;
    ++moved;
  }
  return panel_of(squares);
}

// Two lie half beside their places.
LandingTarget two_beside(TestRng& rng) {
  std::vector<Box> squares = kSharp;
  for (int moved = 0; moved < 2;) {
    const auto i = static_cast<size_t>(rng.index(6));
    const double by = (rng.index(2) == 0 ? 0.5 : -0.5) * kSharp[i].side;
    Box to = kSharp[i];
    (rng.index(2) == 0 ? to.column : to.row) += by;
    if (!is_free(squares, to, i) || squares[i].column != kSharp[i].column || squares[i].row != kSharp[i].row)
      continue;
    squares[i] = to;
    ++moved;
  }
  return panel_of(squares);
}

// Two were never there. One is forgiven: it may be covered by something black.
LandingTarget two_missing(TestRng& rng) {
  std::vector<Box> squares = kSharp;
  for (int k = 0; k < 2; ++k) squares.erase(squares.begin() + rng.index(static_cast<int>(squares.size())));
  return panel_of(squares);
}

// Four to nine squares anywhere.
LandingTarget random_squares(TestRng& rng) {
  std::vector<Box> squares;
  const int count = 4 + rng.index(6);
  for (int tries = 0; tries < 1000 && static_cast<int>(squares.size()) < count; ++tries) {
    const Box box{4.0 + rng.index(12), 4.0 + rng.index(12), rng.index(3) == 0 ? 2.0 + rng.index(4) : 2.0};
    if (is_free(squares, box, squares.size())) squares.push_back(box);
  }
  return panel_of(squares);
}

LandingTarget window(TestRng& rng) {
  const int columns = 2 + rng.index(3), rows = 2 + rng.index(3);
  const double bar = rng.uniform(0.5, 2), width = (14 - bar) / columns - bar,
               height = (14 - bar) / rows - bar;
  LandingTarget target = panel();
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x)
      target.patches.push_back(
          {quad_of(3 + bar + x * (width + bar), 3 + bar + y * (height + bar), width, height), true});
  }
  return target;
}

LandingTarget checkerboard(TestRng& rng) {
  const int count = 4 + rng.index(7);
  const double side = 14.0 / count;
  LandingTarget target = panel();
  for (int y = 0; y < count; ++y) {
    for (int x = y % 2; x < count; x += 2)
      target.patches.push_back({quad_of(3 + x * side, 3 + y * side, side, side), true});
  }
  return target;
}

// Bits of a tag in its black border.
LandingTarget tag(TestRng& rng) {
  LandingTarget target = panel();
  const double side = 14.0 / 8;
  for (int y = 1; y < 7; ++y) {
    for (int x = 1; x < 7; ++x) {
      if (rng.index(2) == 0)
        target.patches.push_back({quad_of(3 + x * side, 3 + y * side, side, side), true});
    }
  }
  return target;
}

LandingTarget letter_h(TestRng& rng) {
  LandingTarget target = panel();
  const double stroke = rng.uniform(1.5, 3);
  target.patches.push_back({quad_of(5, 5, stroke, 10), true});
  target.patches.push_back({quad_of(15 - stroke, 5, stroke, 10), true});
  target.patches.push_back({quad_of(5, 10 - stroke / 2, 10, stroke), true});
  return target;
}

struct Kind {
  const char* name;
  std::function<LandingTarget(TestRng&)> make;
};
const Kind kKinds[] = {{"TwoSquaresMoved", two_moved},
                       {"TwoSquaresBeside", two_beside},
                       {"TwoSquaresMissing", two_missing},
                       {"RandomSquares", random_squares},
                       {"Window", window},
                       {"Checkerboard", checkerboard},
                       {"Tag", tag},
                       {"H", letter_h}};

// From a small square of 3 px to one of 30, at up to 60 degrees.
Rigid3 random_pose(TestRng& rng) {
  const double distance = 2 * std::pow(10.0, rng.uniform(0, 1)), reach = 0.25 * distance;
  return looking_pose(distance, rng.uniform(0, 1), rng.uniform(0, 6.3), rng.uniform(0, 6.3),
                      {rng.uniform(-reach, reach), rng.uniform(-reach, reach)});
}

Drawing random_drawing(TestRng& rng) {
  Drawing drawing;
  drawing.ground = 20 + rng.index(200);
  drawing.black = 10 + rng.index(50);
  drawing.white = 150 + rng.index(100);
  drawing.noise = rng.uniform(0, 8);
  drawing.blur_px = rng.uniform(0.3, 1.2);
  return drawing;
}

int scenes() {
  const char* more = std::getenv("PERCH_SCENES");
  return more ? std::atoi(more) : 25;
}

void keep(const cv::Mat& grey, const std::string& name) {
  if (const char* folder = std::getenv("PERCH_FAILURES")) cv::imwrite(folder + ("/" + name + ".png"), grey);
}

class EdgesLookalikes : public testing::TestWithParam<Kind> {};

TEST_P(EdgesLookalikes, AreNoTarget) {
  EdgesDetector detector(sharp_target(), camera(), {});
  int wrong = 0;
  for (int i = 0; i < scenes(); ++i) {
    TestRng rng(static_cast<unsigned>(i));
    const LandingTarget lookalike = GetParam().make(rng);
    const Rigid3 pose = random_pose(rng);
    const cv::Mat grey = picture_of(lookalike, camera(), pose, random_drawing(rng), &rng);
    if (detector.detect(grey, {}).status != DetectionStatus::kFound) continue;
    ++wrong;
    std::printf("%s %d is taken for the target, %.1f m away\n", GetParam().name, i, pose.translation.norm());
    keep(grey, GetParam().name + std::to_string(i));
  }
  EXPECT_EQ(wrong, 0);
}

INSTANTIATE_TEST_SUITE_P(Kinds, EdgesLookalikes, testing::ValuesIn(kKinds),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(EdgesDetector, SaysThatOneOfTwoTargetsIsAsGoodAsTheOther) {
  const LandingTarget target = sharp_target();
  EdgesDetector detector(target, camera(), {});
  int found = 0, ambiguous = 0;
  for (int i = 0; i < scenes(); ++i) {
    TestRng rng(static_cast<unsigned>(i));
    const Drawing drawing = random_drawing(rng);
    const double distance = rng.uniform(4, 8);
    const auto at = [&](double x) {
      return looking_pose(distance, rng.uniform(0, 0.6), rng.uniform(0, 6.3), rng.uniform(0, 6.3), {x, 0});
    };
    cv::Mat grey(480, 640, CV_8UC1, cv::Scalar(drawing.ground));
    draw_target(grey, target, camera(), at(-0.2 * distance), drawing);
    draw_target(grey, target, camera(), at(0.2 * distance), drawing);
    cv::GaussianBlur(grey, grey, {}, drawing.blur_px);
    const DetectionStatus status = detector.detect(grey, {}).status;
    found += status == DetectionStatus::kFound;
    ambiguous += status == DetectionStatus::kAmbiguous;
    if (status == DetectionStatus::kFound) keep(grey, "two" + std::to_string(i));
  }
  EXPECT_EQ(found, 0);
  EXPECT_GE(ambiguous, 0.9 * scenes());
}

// The same kind of picture with nothing wrong in it is found: else the above says nothing.
TEST(EdgesDetector, FindsTheTargetItselfAsTheLookalikesAreShown) {
  const LandingTarget target = sharp_target();
  EdgesDetector detector(target, camera(), {});
  int found = 0, whole = 0;
  for (int i = 0; i < scenes(); ++i) {
    TestRng rng(static_cast<unsigned>(i));
    const Rigid3 pose = random_pose(rng);
    const cv::Mat grey = picture_of(panel_of(kSharp), camera(), pose, random_drawing(rng), &rng);
    // Below 5 px measuring edges is not what a target needs.
    if (pose.translation.norm() > 10) continue;
    ++whole;
    found += detector.detect(grey, {}).status == DetectionStatus::kFound;
  }
  EXPECT_GE(found, 0.9 * whole);
}

}  // namespace
}  // namespace perch
