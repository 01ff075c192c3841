// From corners to the verdict, on boards whose lens, bend and noise are known.

#include "calib/camera/calibration.h"

#include <gmock/gmock.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "calib/camera/calibration_json.h"
#include "calib/camera/calibration_report.h"
#include "calib/camera/camera_model_file.h"
#include "calib/camera/coverage.h"
#include "calib/camera/verdict.h"
#include "support/sharp_target.h"
#include "support/temp_folder.h"
#include "synthetic_boards.h"

namespace perch {
namespace {

using testing::Contains;
using testing::HasSubstr;

CalibrationOptions only(const std::string& lens) {
  CalibrationOptions options;
  options.lens_models = {lens};
  options.ranges = {2};
  return options;
}

Candidate once(const BoardViews& views, const std::string& lens) {
  return calibrate_once(views, lens, only(lens));
}

// How far a lens is off the truth in the middle of the picture, px: over places where boards have been.
double off_by(const CameraModel& truth, const CameraModel& found) {
  const ModelDifference difference = model_difference(truth, found, 9, 7, std::vector<double>(63, 1));
  double worst = 0;
  for (int row = 2; row < 5; ++row) {
    for (int column = 2; column < 7; ++column) worst = std::max(worst, difference.length.at(column, row));
  }
  return worst;
}

class LensModels : public testing::TestWithParam<const char*> {};

// Noise of 0.1 px of 1200 corners; a spline has some hundred unknowns, so 0.5 px is what all stay below.
TEST_P(LensModels, EachFindsALensThatItCanBe) {
  TestRng rng;
  const CameraModel camera = opencv4_camera();
  const BoardViews views = synthetic_boards(camera, {.noise_px = 0.1, .views = 25}, rng);
  const Candidate found = once(views, GetParam());
  EXPECT_TRUE(found.usable()) << found.failure;
  EXPECT_NEAR(found.fit.sigma_px, 0.1, 0.02);
  EXPECT_LT(off_by(camera, found.fit.model()), 0.5);
}
INSTANTIATE_TEST_SUITE_P(All, LensModels,
                         testing::Values("LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5", "LENSMODEL_OPENCV8",
                                         "LENSMODEL_OPENCV12", "LENSMODEL_CAHVOR",
                                         "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=8_Ny=6_fov_x_deg=90"));

// 130 degrees, and what a spline says of itself against how far it is off, in the middle and at the rim of
// the picture, where it knows less.
TEST(Calibration, ASplineKnowsHowFarAWideLensIsOffAtItsRim) {
  constexpr int kColumns = 15, kRows = 11, kSeeds = 3;
  const double f = 320 / (2 * std::tan(130 * kRadFromDeg / 4));
  const CameraModel camera("LENSMODEL_STEREOGRAPHIC", {f, f, 319.5, 239.5}, 640, 480);
  TestRng rng;
  struct Part {
    double off = 0, predicted = 0, count = 0;  // squares, px^2
    double ratio() const { return std::sqrt(off / predicted); }
  } middle, rim;
  for (int seed = 0; seed < kSeeds; ++seed) {
    const BoardViews views = synthetic_boards(
        camera, {.noise_px = 0.1, .views = 40, .nearest = 0.2, .farthest = 0.4, .keep_partial = true}, rng);
    const Candidate found = once(views, "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=10_Ny=8_fov_x_deg=150");
    EXPECT_LT(off_by(camera, found.fit.model()), 0.5);
    const auto covered = covered_places(views, kColumns, kRows);
    const SensorMap map = uncertainty_map(found.fit, found.covariance, kAtInfinity, kColumns, kRows);
    std::vector<double> weight;
    for (size_t i = 0; i < covered.size(); ++i)
      weight.push_back(covered[i] ? 1 / (map.values[i] * map.values[i]) : 0);
    const ModelDifference off = model_difference(camera, found.fit.model(), kColumns, kRows, weight);
    for (int row = 0; row < kRows; ++row) {
      for (int column = 0; column < kColumns; ++column) {
        if (!covered[static_cast<size_t>(row * kColumns + column)]) continue;
        const bool outer = row < 2 || row > kRows - 3 || column < 2 || column > kColumns - 3;
        Part& part = outer ? rim : middle;
        part.off += std::pow(off.length.at(column, row), 2);
        part.predicted += std::pow(map.at(column, row), 2);
        part.count += 1;
      }
    }
  }
  for (const auto& [name, part] : {std::pair("middle", middle), std::pair("rim", rim)}) {
    std::cout << name << ": " << std::sqrt(part.off / part.count) << " px off, "
              << std::sqrt(part.predicted / part.count) << " px predicted\n";
  }
  EXPECT_GT(rim.predicted / rim.count, 1.5 * middle.predicted / middle.count);
  // The worst direction is predicted, both are off; and three lenses scatter.
  for (const Part& part : {middle, rim}) {
    EXPECT_GT(part.ratio(), 0.4);
    EXPECT_LT(part.ratio(), 1.6);
  }
}

TEST(Calibration, FindsThePictureWhoseCornersAreWrong) {
  TestRng rng;
  BoardViews views = synthetic_boards(opencv4_camera(), {}, rng);
  for (BoardCorner& corner : views.views[7].corners)
    corner.pixel += 3 * Eigen::Vector2d(rng.normal(), rng.normal());
  const Calibration calibration = calibrate_camera(views, only("LENSMODEL_OPENCV4"));
  const Verdict verdict = judge(views, calibration, sharp_target());
  ASSERT_EQ(verdict.suspects.size(), 1u);
  EXPECT_EQ(verdict.suspects[0].view, 7u);
}

TEST(Calibration, SaysThatParallelBoardsDoNotTellTheFocalLength) {
  TestRng rng;
  BoardViews views = synthetic_boards(opencv4_camera(), {.views = 1, .tilt_deg = 0, .spread = 0}, rng);
  const BoardView first = views.views[0];
  for (int k = 1; k < 10; ++k) {  // the same plane, moved sideways
    views.views.push_back(first);
    views.views.back().picture += std::to_string(k);
    for (BoardCorner& corner : views.views.back().corners)
      corner.pixel += Eigen::Vector2d(0.2 * rng.normal() + k, 0.2 * rng.normal());
  }
  // Either there is no solution, or it comes with that sentence.
  std::string said;
  try {
    for (const std::string& missing : what_is_missing(views, once(views, "LENSMODEL_OPENCV4").fit))
      said += missing;
  } catch (const CalibrationError& e) {
    said = e.what();
  }
  EXPECT_THAT(said, HasSubstr("the focal length cannot be told from the distance"));
}

TEST(Calibration, RefusesOnePicture) {
  TestRng rng;
  const BoardViews views = synthetic_boards(opencv4_camera(), {.views = 1}, rng);
  try {
    calibrate_camera(views, only("LENSMODEL_OPENCV4"));
    FAIL();
  } catch (const CalibrationError& e) {
    EXPECT_THAT(e.what(), HasSubstr("expected 3 pictures of the board at least, found 1"));
    EXPECT_THAT(e.what(), HasSubstr("focal length and distance undecided"));
  }
}

// Each picture moves by its own v while its rows are read, 1 px or so of the height.
BoardViews rolled(BoardViews views, double shift_px, TestRng& rng) {
  for (BoardView& view : views.views) {
    const Eigen::Vector2d v(shift_px * rng.normal(), shift_px * rng.normal());
    for (BoardCorner& corner : view.corners) corner.pixel += corner.pixel.y() / views.height * v;
  }
  return views;
}

TEST(Calibration, RemarksOnARollingShutter) {
  TestRng rng;
  const BoardViews still = synthetic_boards(opencv4_camera(), {.noise_px = 0.05}, rng);
  const auto warnings = [](const BoardViews& views) {
    const Calibration calibration = calibrate_camera(views, only("LENSMODEL_OPENCV4"));
    return judge(views, calibration, sharp_target()).warnings;
  };
  EXPECT_THAT(warnings(still), testing::Not(Contains(HasSubstr("rolling shutter"))));
  EXPECT_THAT(warnings(rolled(still, 1, rng)), Contains(HasSubstr("rolling shutter")));
}

// 4 % wider than high squares: no lens and no pose takes that up.
TEST(Calibration, WarnsOfABoardOfAnotherShape) {
  TestRng rng;
  SyntheticBoards boards{.noise_px = 0.05};
  boards.stretch = 1.04;
  const BoardViews views = synthetic_boards(opencv4_camera(), boards, rng);
  const Calibration calibration = calibrate_camera(views, only("LENSMODEL_OPENCV4"));
  const Verdict verdict = judge(views, calibration, sharp_target());
  EXPECT_FALSE(verdict.gates[3].met) << calibration.fit().sigma_px;
}

TEST(Calibration, TakesBoardsWithMissingCorners) {
  TestRng rng;
  const CameraModel camera = opencv4_camera();
  BoardViews views = synthetic_boards(camera, {}, rng);
  for (BoardView& view : views.views)
    std::erase_if(view.corners, [&](const BoardCorner&) { return rng.uniform(0, 1) < 0.35; });
  const Candidate found = once(views, "LENSMODEL_OPENCV4");
  EXPECT_NEAR(found.fit.sigma_px, 0.2, 0.02);
  EXPECT_LT(off_by(camera, found.fit.model()), 1);
}

// What is written is read back to the last digit, with the covariance; summary and page hold the verdict.
TEST(Calibration, ItsFilesSayWhatWasFound) {
  TestRng rng;
  const BoardViews views = synthetic_boards(opencv4_camera(), {}, rng);
  const Calibration calibration = calibrate_camera(views, only("LENSMODEL_OPENCV4"));
  const Verdict verdict = judge(views, calibration, sharp_target());
  EXPECT_GT(verdict.coverage, 0.5);
  ASSERT_EQ(verdict.landing.size(), 1u);
  EXPECT_GT(verdict.landing[0].mean_m, 0);
  const TempFolder folder;
  write_camera_model(folder / "cam.cameramodel", views, calibration.best());
  const CameraModel read = read_camera_model(folder / "cam.cameramodel");
  EXPECT_EQ(read.intrinsics(), calibration.fit().intrinsics);
  ASSERT_EQ(read.intrinsics_covariance().rows(), 8);
  EXPECT_TRUE(read.intrinsics_covariance().isApprox(calibration.best().covariance.intrinsics(), 1e-12));
  const auto json = nlohmann::json::parse(calibration_json_text(views, calibration, verdict));
  EXPECT_EQ(json["chosen"]["lens"], "LENSMODEL_OPENCV4");
  EXPECT_EQ(json["views"].size(), 20u);
  EXPECT_NEAR(json["landing"][0]["mean_m"].get<double>(), verdict.landing[0].mean_m, 1e-12);
  const std::string page = calibration_report_html(views, calibration, verdict, "cam<1>.cameramodel");
  EXPECT_THAT(page, HasSubstr("cam&lt;1&gt;.cameramodel"));
  EXPECT_THAT(page, testing::Not(HasSubstr("<script")));
  EXPECT_THAT(page, testing::Not(HasSubstr("nan")));
}

TEST(Requirements, AreHeldAgainstTheCalibration) {
  TestRng rng;
  const BoardViews views = synthetic_boards(opencv4_camera(), {}, rng);
  const Calibration calibration = calibrate_camera(views, only("LENSMODEL_OPENCV4"));
  const Verdict verdict = judge(views, calibration, sharp_target());
  const auto met = [&](const std::string& text) {
    return check(verdict, calibration, parse_requirements(text)).at(0).met;
  };
  EXPECT_TRUE(met("sigma_px=0.3"));
  EXPECT_FALSE(met("sigma_px=0.1"));
  EXPECT_TRUE(met("coverage=0.3"));
  EXPECT_FALSE(met("coverage=1"));
  for (const char* wrong : {"beauty=1", "sigma_px", "sigma_px=", "sigma_px=x", "sigma_px=-1", "sigma_px=nan"})
    EXPECT_THROW(parse_requirements(wrong), CalibrationError) << wrong;
}

// Answers of N seeds are spread as the covariance says. PERCH_CALIBRATION_SEEDS=100 takes more.
TEST(Calibration, ItsSigmaIsTheSpreadOfItsAnswers) {
  const char* seeds = std::getenv("PERCH_CALIBRATION_SEEDS");
  const int count = seeds ? std::max(40, std::atoi(seeds)) : 40;
  TestRng rng;
  const CameraModel camera = opencv4_camera();
  Eigen::Array<double, 8, 1> squares = Eigen::Array<double, 8, 1>::Zero();
  int within = 0;
  for (int seed = 0; seed < count; ++seed) {
    const Candidate found = once(synthetic_boards(camera, {}, rng), "LENSMODEL_OPENCV4");
    for (Eigen::Index i = 0; i < 8; ++i) {
      const auto k = static_cast<size_t>(i);
      const double in_sigmas =
          (found.fit.intrinsics[k] - camera.intrinsics()[k]) / std::sqrt(found.covariance.matrix(i, i));
      squares[i] += in_sigmas * in_sigmas;
      within += std::abs(in_sigmas) < 3;
    }
  }
  const Eigen::Array<double, 8, 1> ratio = (squares / count).sqrt();
  std::cout << count << " seeds: found over predicted, by parameter: " << ratio.transpose() << ", mean "
            << ratio.mean() << "; " << within << " of " << 8 * count << " within 3 sigma\n";
  // 0.3 % of a normal distribution are beyond 3 sigma; parameters of one solve go there together.
  EXPECT_GE(within, 8 * count - std::max(4, 8 * count / 100));
  // A deviation of 40 scatters by 11 %, the worst of eight by twice that and more; the mean of 8 that hang
  // together by threes by 7 %.
  EXPECT_NEAR(ratio.mean(), 1, 0.2);
  EXPECT_LT((ratio - 1).abs().maxCoeff(), 0.45);
}

}  // namespace
}  // namespace perch
