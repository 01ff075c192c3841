#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>

#include "perch/camera/camera_model.h"
#include "perch/detection/squares_detector.h"
#include "perch/geometry/euler.h"
#include "perch/pose/pose_estimator.h"
#include "support/shared.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

// The rows of a csv file, by the first column.
std::map<std::string, std::vector<std::string>> rows_of(const fs::path& file) {
  std::map<std::string, std::vector<std::string>> rows;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::vector<std::string> cells;
    std::istringstream row(line.substr(0, line.find('\r')));
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    rows[cells[0]] = {cells.begin() + 1, cells.end()};
  }
  return rows;
}

Rigid3 pose_of(const std::vector<std::string>& cells) {
  const auto number = [&](size_t i) { return std::stod(cells[i]); };
  return {Eigen::Quaterniond(number(3), number(4), number(5), number(6)), {number(0), number(1), number(2)}};
}

struct Tally {
  int found = 0, ok = 0, ambiguous = 0, rejected = 0;
  int wrong = 0;  // ok, and far from the truth
  std::vector<std::string> ok_pictures;
};

// A pose that is not the target's at all. What corners of half a pixel do to a pose right otherwise stays far
// below.
bool is_wrong(const Rigid3& estimate, const Rigid3& truth) {
  return !((estimate.translation - truth.translation).norm() < 0.1 * truth.translation.norm() &&
           estimate.rotation.angularDistance(truth.rotation) < 20 * kRadFromDeg);
}

enum Plane { kBlue = 0, kGreen = 1, kRed = 2, kAllOfThem = -1 };

Tally run(const fs::path& flight, const LandingTarget& target, Plane plane = kAllOfThem,
          PaperOptions options = {}) {
  const fs::path cam0 = flight / "mav0" / "cam0";
  SquaresDetector detector(target, options);
  PoseEstimator pose(target, read_camera_model(cam0 / "sensor.yaml"), {});
  const auto truth = rows_of(cam0 / "truth_target_pose.csv");
  Tally tally;
  for (const auto& [time, cells] : rows_of(cam0 / "data.csv")) {
    cv::Mat grey;
    if (plane == kAllOfThem) {
      grey = cv::imread(cam0 / "data" / cells[0], cv::IMREAD_GRAYSCALE);
    } else {
      cv::extractChannel(cv::imread(cam0 / "data" / cells[0], cv::IMREAD_COLOR), grey, plane);
    }
    const Detection& found = detector.detect(grey, {});
    if (found.status != DetectionStatus::kFound) continue;
    ++tally.found;
    const PoseResult result = pose.estimate(found.correspondences);
    tally.rejected += result.status == PoseStatus::kRejected;
    tally.ambiguous += result.status == PoseStatus::kAmbiguous;
    if (result.status != PoseStatus::kOk) continue;
    ++tally.ok;
    tally.ok_pictures.push_back(cells[0]);
    const auto row = truth.find(time);
    if (row == truth.end() || !is_wrong(result.camera_from_target.mean, pose_of(row->second))) continue;
    ++tally.wrong;
    ADD_FAILURE() << flight << ": " << cells[0] << " at "
                  << result.camera_from_target.mean.translation.transpose();
  }
  return tally;
}

// `sharp_target` at 40 mm a module, as the red board is.
LandingTarget red_board() {
  LandingTarget target = sharp_target();
  target.size *= 0.8;
  for (auto& feature : target.features) feature.point *= 0.8;
  auto& layout = std::get<SquaresLayout>(target.layout);
  layout.border *= 0.8;
  for (auto& square : layout.squares) {
    square.lower_left *= 0.8;
    square.side *= 0.8;
  }
  return target;
}

class Recorded : public testing::Test {
 protected:
  void open(const char* name) {
    flight = shared_flight(name);
    if (flight.empty()) GTEST_SKIP() << name << " is not there: set PERCH_SHARED";
  }
  fs::path flight;
};

// What stays out, and why: platform0's border merges with the white board behind it, so its region holds more
// than it should; badimage is smeared until its squares have no corners; and in red the board's interior is
// nearly as bright as its border. In grey the tiles around platform2 rise above the threshold.
TEST_F(Recorded, RealPhotosComeOutWhereThePapersMethodCanFindThem) {
  ASSERT_NO_FATAL_FAILURE(open("real_photos"));
  if (IsSkipped()) return;
  using Names = std::vector<std::string>;
  EXPECT_EQ(run(flight, red_board(), kBlue).ok_pictures, (Names{"platform1_v3.jpg", "platform2_v2.jpg"}));
  EXPECT_EQ(run(flight, red_board(), kGreen).ok_pictures, (Names{"platform1_v3.jpg"}));
  EXPECT_EQ(run(flight, red_board(), kAllOfThem).ok_pictures, (Names{"platform1_v3.jpg"}));
  EXPECT_EQ(run(flight, red_board(), kRed).ok_pictures, Names{});
}

TEST_F(Recorded, RealPhotosComeOutAtPaleWallsAndFloorsWhenTheInteriorIsEnough) {
  ASSERT_NO_FATAL_FAILURE(open("real_photos"));
  if (IsSkipped()) return;
  PaperOptions options;
  options.count_region = false;
  using Names = std::vector<std::string>;
  const Names three{"platform0.jpg", "platform1_v3.jpg", "platform2_v2.jpg"};
  EXPECT_EQ(run(flight, red_board(), kBlue, options).ok_pictures, three);
  EXPECT_EQ(run(flight, red_board(), kGreen, options).ok_pictures, three);
  EXPECT_EQ(run(flight, red_board(), kAllOfThem, options).ok_pictures, three);
  EXPECT_EQ(run(flight, red_board(), kRed, options).ok_pictures, (Names{"platform0.jpg"}));
}

TEST_F(Recorded, NothingIsFoundWhereThereIsNoTarget) {
  ASSERT_NO_FATAL_FAILURE(open("dev_negative"));
  if (IsSkipped()) return;
  PaperOptions lenient;
  lenient.count_region = false;
  EXPECT_EQ(run(flight, sharp_target()).found, 0);
  EXPECT_EQ(run(flight, nested_target()).found, 0);
  EXPECT_EQ(run(flight, sharp_target(), kAllOfThem, lenient).found, 0);
}

// Lower bounds: what was found when this was written, less a few.
TEST_F(Recorded, ADescentIsFoundFromNineMetresDown) {
  ASSERT_NO_FATAL_FAILURE(open("dev_descent"));
  if (IsSkipped()) return;
  const Tally tally = run(flight, sharp_target());
  EXPECT_GE(tally.found, 87);  // of 90
  EXPECT_EQ(tally.rejected, 0);
}

// A third: where a shadow's edge crosses the target, one threshold cannot serve both sides of it.
TEST_F(Recorded, AHardDescentGivesNoWrongPose) {
  ASSERT_NO_FATAL_FAILURE(open("dev_hard"));
  if (IsSkipped()) return;
  EXPECT_GE(run(flight, sharp_target()).ok, 13);  // of 40
}

// From 0.95 m down by the inner target, until its shadow covers that too.
TEST_F(Recorded, ANestedTargetIsFollowedToTheGround) {
  ASSERT_NO_FATAL_FAILURE(open("dev_close_nested"));
  if (IsSkipped()) return;
  EXPECT_GE(run(flight, nested_target()).found, 33);  // of 40
}

}  // namespace
}  // namespace perch
