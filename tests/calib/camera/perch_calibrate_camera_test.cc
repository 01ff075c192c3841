// The program as a user calls it.

#include <gmock/gmock.h>

#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "perch/camera/camera_model.h"
#include "perch/simulation/picture.h"
#include "support/drawing.h"
#include "support/printed_boards.h"
#include "support/run_program.h"

namespace perch {
namespace {

using testing::HasSubstr;

Outcome run(const TempFolder& folder, const std::string& arguments) {
  return run_program_in(folder, PERCH_CALIBRATE_CAMERA, arguments);
}

TEST(PerchCalibrateCamera, RefusesWhatItCannotDo) {
  const TempFolder folder;
  folder.write("a.png", "no picture");
  const std::pair<const char*, const char*> wrong[] = {
      {"a.png", "either --board or --target"},
      {"--board nine --spacing 0.02 a.png", "expected inner corners such as 9x6"},
      {"--board 9x6 --spacing 0.02 --live sim:x.yaml a.png", "expected pictures, or --live"},
      {"--board 9x6 --spacing 0.02 --json s.json a.png", "--output"},
      {"--board 9x6 --spacing 0.02 --output o --require beauty=1 a.png", "beauty"},
      {"--target nowhere.yaml --output o a.png", "nowhere.yaml"},
  };
  for (const auto& [arguments, message] : wrong) {
    const Outcome outcome = run(folder, arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(message)) << arguments;
  }
  const Outcome no_picture = run(folder, "--board 9x6 --spacing 0.02 a.png");
  EXPECT_EQ(no_picture.code, 1);
  EXPECT_THAT(no_picture.err, HasSubstr("perch-calibrate-camera: "));
}

TEST(PerchCalibrateCamera, CalibratesFromRealPhotographs) {
  const std::filesystem::path data = "/usr/share/doc/opencv-doc/examples/data";
  if (!std::filesystem::exists(data / "left01.jpg")) GTEST_SKIP() << "no opencv-doc";
  const TempFolder folder;
  for (const int k : {1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14}) {
    const std::string name = std::string("left") + (k < 10 ? "0" : "") + std::to_string(k) + ".jpg";
    std::filesystem::copy_file(data / name, folder / name);
  }
  const Outcome outcome =
      run(folder,
          "--board 9x6 --spacing 0.025 --lens LENSMODEL_OPENCV5 --output cam.cameramodel "
          "--json cam.json --report cam.html --zoom 1 --zoom-table zoom.yaml --show shown "
          "--require sigma_px=0.3,uncertainty_px=0.001 'left*.jpg'");
  // One threshold that thirteen photographs cannot meet; all is written nevertheless.
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("not met: uncertainty"));
  EXPECT_THAT(outcome.err, testing::Not(HasSubstr("not met: noise")));
  EXPECT_TRUE(std::filesystem::exists(folder / "cam.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "cam.html"));
  EXPECT_THAT(outcome.out, HasSubstr("13 pictures of 640x480 with 702 corners"));
  const CameraModel model = read_camera_model(folder / "cam.cameramodel");
  // mrcal-calibrate-cameras: 533.9; one deviation of it is about 1.
  EXPECT_NEAR(model.intrinsics()[0], 534, 4);
  EXPECT_TRUE(std::filesystem::exists(folder / "perch-corners.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "shown/0_left01.jpg.png"));
  EXPECT_THAT(read_file(folder / "zoom.yaml"), HasSubstr("{zoom: 1, model: \"cam.cameramodel\"}"));
}

// Forty pictures of a recording; the uncertainty asked for is there after some of them.
TEST(PerchCalibrateCamera, LiveEndsWhenTheUncertaintyAskedForIsReached) {
  const TempFolder folder;
  const BoardGrid grid = parse_board("7x5", 0.03).grid;
  const CameraModel camera = CameraModel::pinhole(300, 300, 159.5, 119.5, 320, 240);
  const Renderer renderer(camera, printed_chessboard(grid));
  std::string rows = "#timestamp [ns],filename\n";
  std::filesystem::create_directories(folder / "flight/mav0/cam0/data");
  for (int k = 0; k < 40; ++k) {
    const double a = 2.4 * k;
    const Rigid3 pose = looking_pose(0.34 + 0.03 * (k % 4), 0.15 * (1 + k % 4), a, 0.1,
                                     {0.05 * std::cos(1.7 * a), 0.03 * std::sin(1.7 * a)});
    const std::string name = std::to_string(k) + ".png";
    cv::imwrite((folder / "flight/mav0/cam0/data" / name).string(),
                Sensor().picture(renderer.radiance(pose), static_cast<uint64_t>(k)));
    rows += std::to_string(1'000'000'000LL + 100'000'000LL * k) + "," + name + "\n";
  }
  folder.write("flight/mav0/cam0/data.csv", rows);
  const Outcome outcome = run(folder,
                              "--board 7x5 --spacing 0.03 --live flight:flight --until 3 --page live.html "
                              "--keep kept --lens LENSMODEL_OPENCV4 --output cam.cameramodel");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("The uncertainty asked for is reached."));
  EXPECT_THAT(read_file(folder / "live.html"), HasSubstr("pictures, uncertainty"));
  EXPECT_TRUE(std::filesystem::exists(folder / "kept/board_000.png"));
  // 3 % of the focal length: 3 px at the rim, as asked for, and more.
  EXPECT_NEAR(read_camera_model(folder / "cam.cameramodel").intrinsics()[0], 300, 10);
}

}  // namespace
}  // namespace perch
