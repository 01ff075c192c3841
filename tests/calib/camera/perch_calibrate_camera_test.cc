// The program as a user calls it.

#include <gmock/gmock.h>

#include <filesystem>

#include "perch/camera/camera_model.h"
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
      {"--board 9x6 a.png", "spacing"},
      {"--board nine --spacing 0.02 a.png", "expected inner corners such as 9x6"},
      {"--board 9x6 --spacing 0.02", "expected pictures, or --live"},
      {"--board 9x6 --spacing 0.02 --live sim:x.yaml a.png", "expected pictures, or --live"},
      {"--board 9x6 --spacing 0.02 --json s.json a.png", "--output"},
      {"--board 9x6 --spacing 0.02 --output o --zoom 2 a.png", "--zoom-table"},
      {"--board 9x6 --spacing 0.02 --output o --ranges 1,far a.png", "--ranges"},
      {"--board 9x6 --spacing 0.02 --output o --require beauty=1 a.png", "beauty"},
      {"--target nowhere.yaml --output o a.png", "nowhere.yaml"},
  };
  for (const auto& [arguments, message] : wrong) {
    const Outcome outcome = run(folder, arguments);
    EXPECT_EQ(outcome.code, 2) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr(message)) << arguments;
  }
  for (const char* arguments : {"--board 9x6 --spacing 0.02 a.png", "--board 9x6 --spacing 0.02 none.png"}) {
    const Outcome outcome = run(folder, arguments);
    EXPECT_EQ(outcome.code, 1) << arguments;
    EXPECT_THAT(outcome.err, HasSubstr("perch-calibrate-camera: ")) << arguments;
  }
}

TEST(PerchCalibrateCamera, CalibratesFromRealPhotographs) {
  const std::filesystem::path data = "/usr/share/doc/opencv-doc/examples/data";
  if (!std::filesystem::exists(data / "left01.jpg")) GTEST_SKIP() << "no opencv-doc";
  const TempFolder folder;
  for (const int k : {1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14}) {
    const std::string name = std::string("left") + (k < 10 ? "0" : "") + std::to_string(k) + ".jpg";
    std::filesystem::copy_file(data / name, folder / name);
  }
  const Outcome outcome = run(folder,
                              "--board 9x6 --spacing 0.025 --lens LENSMODEL_OPENCV5 --output cam.cameramodel "
                              "--json cam.json --zoom 1 --zoom-table zoom.yaml --show shown 'left*.jpg'");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("13 pictures of 640x480 with 702 corners"));
  const CameraModel model = read_camera_model(folder / "cam.cameramodel");
  // mrcal-calibrate-cameras: 533.9; one deviation of it is about 1.
  EXPECT_NEAR(model.intrinsics()[0], 534, 4);
  EXPECT_TRUE(std::filesystem::exists(folder / "perch-corners.json"));
  EXPECT_TRUE(std::filesystem::exists(folder / "shown/0_left01.jpg.png"));
  EXPECT_THAT(read_file(folder / "zoom.yaml"), HasSubstr("{zoom: 1, model: \"cam.cameramodel\"}"));
  // One threshold that thirteen photographs cannot meet.
  const Outcome strict = run(folder,
                             "--board 9x6 --spacing 0.025 --lens LENSMODEL_OPENCV5 --output cam.cameramodel "
                             "--require uncertainty_px=0.001 'left*.jpg'");
  EXPECT_EQ(strict.code, 1);
  EXPECT_THAT(strict.err, HasSubstr("not met: "));
}

}  // namespace
}  // namespace perch
