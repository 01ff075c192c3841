#include "perch/camera/camera_model.h"
#include "perch/config/section.h"
#include "support/near_pose.h"
#include "support/shared.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

// What is said of a file with that text, without the folder.
std::string why_not(const std::string& text) {
  const TempFolder folder;
  const auto file = folder.write("cam", text);
  try {
    read_camera_model(file);
  } catch (const ConfigError& e) {
    const std::string what = e.what();
    EXPECT_TRUE(what.starts_with(folder.path().string() + "/")) << what;
    return what.substr(folder.path().string().size() + 1);
  }
  return "accepted";
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

// As mrcal's Python writes it: comments, trailing commas, and bytes with every bracket there is.
const char* const kMrcal = R"(# generated on 2024-01-01 with  mrcal-calibrate-cameras --it's 'fine'
{
    'lensmodel':  'LENSMODEL_OPENCV4',

    # extrinsics are rt_fromref
    'extrinsics': [ 0., 0., 0., 0., 0., 0.,],

    # fx, fy, cx, cy {
    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652,],
    'valid_intrinsics_region': [
    [ 0, 2159 ],
    [ 0, 0 ], ],
    'imagersize': [ 4000, 2200,],
    'icam_intrinsics': 0,
    'optimization_inputs': b'P)h>@6aW{#-{]:?"[,(*`~;!}',
}
)";

TEST(ReadCameraModel, TakesMrcalsFiles) {
  const TempFolder folder;
  const CameraModel camera = read_camera_model(folder.write("cam.cameramodel", kMrcal));
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV4");
  EXPECT_EQ(camera.width(), 4000);
  EXPECT_EQ(camera.height(), 2200);
  EXPECT_THAT(camera.intrinsics(),
              ElementsAre(1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372,
                          -0.0002547045941, 0.0005275929652));
}

TEST(ReadCameraModel, SaysWhatIsWrongWithMrcalsFiles) {
  EXPECT_EQ(why_not(replaced(kMrcal, "1761.181055", "nan")),
            "cam:9: intrinsics[0]: expected a number, found \"nan\"");
  EXPECT_EQ(why_not(replaced(kMrcal, "1761.181055", "-3")),
            "cam:9: intrinsics: expected focal lengths above 0, not -3 and 1761.25, found a list of 8");
  EXPECT_EQ(
      why_not(replaced(kMrcal, "LENSMODEL_OPENCV4", "LENSMODEL_OPENCV5")),
      "cam:9: intrinsics: expected what fits the lens (LENSMODEL_OPENCV5: expected 9 intrinsics, found 8), "
      "found a list of 8");
  EXPECT_THAT(why_not(replaced(kMrcal, "LENSMODEL_OPENCV4", "LENSMODEL_KANNALA")),
              HasSubstr("LENSMODEL_KANNALA: expected a lens model that mrcal knows"));
  EXPECT_EQ(why_not(replaced(kMrcal, "4000, 2200", "4000")),
            "cam:13: imagersize: expected a list of 2 numbers, found a list of 1");
  EXPECT_EQ(why_not(replaced(kMrcal, "2200", "2200.5")),
            "cam:13: imagersize: expected whole numbers of pixels, found a list of 2");
  EXPECT_EQ(why_not(replaced(kMrcal, "imagersize", "imagesize")),
            "cam:1: imagersize: expected [width, height], found nothing");
  EXPECT_THAT(why_not(replaced(kMrcal, "\n}\n", "\n")), HasSubstr("expected YAML"));
}

const char* const kRos = R"(image_width: 640
image_height: 480
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [438.783367, 0.000000, 305.593336, 0.000000, 437.302876, 243.738352, 0.000000, 0.000000, 1.000000]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [0.999978, 0.002789, -0.006046, -0.002816, 0.999986, -0.004401, 0.006034, 0.004417, 0.999972]
)";

TEST(ReadCameraModel, TakesRosCameraInfo) {
  const TempFolder folder;
  const CameraModel camera = read_camera_model(folder.write("ros.yaml", kRos));
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV5");
  EXPECT_EQ(camera.width(), 640);
  EXPECT_EQ(camera.height(), 480);
  EXPECT_THAT(camera.intrinsics(), ElementsAre(438.783367, 437.302876, 305.593336, 243.738352, -0.361976,
                                               0.110510, 0.001014, 0.000505, 0));
  const CameraModel message = read_camera_model(folder.write(
      "message.yaml",
      "height: 480\nwidth: 640\ndistortion_model: rational_polynomial\nD: [1, 2, 3, 4, 5, 6, 7, 8]\n"
      "K: [400, 0, 320, 0, 401, 240, 0, 0, 1]\n"));
  EXPECT_EQ(message.lens(), "LENSMODEL_OPENCV8");
  EXPECT_THAT(message.intrinsics(), ElementsAre(400, 401, 320, 240, 1, 2, 3, 4, 5, 6, 7, 8));
}

TEST(ReadCameraModel, NoCoefficientsAreThePinhole) {
  const TempFolder folder;
  const std::string text = replaced(replaced(kRos, "cols: 5", "cols: 0"),
                                    "[-0.361976, 0.110510, 0.001014, 0.000505, 0.000000]", "[]");
  EXPECT_EQ(read_camera_model(folder.write("ros.yaml", text)).lens(), "LENSMODEL_PINHOLE");
}

TEST(ReadCameraModel, SaysWhatIsWrongWithRosFiles) {
  EXPECT_EQ(why_not(replaced(kRos, "plumb_bob", "equidistant")),
            "cam:8: distortion_model: expected plumb_bob or rational_polynomial; mrcal has no fisheye model, "
            "calibrate with mrcal's splined model instead, found \"equidistant\"");
  EXPECT_EQ(why_not(replaced(kRos, "plumb_bob", "rational_polynomial")),
            "cam:9: distortion_coefficients: expected 0 or 8 or 12 coefficients, not 5, found a mapping");
  EXPECT_EQ(why_not(replaced(kRos, "438.783367, 0.000000", "438.783367, 1.5")),
            "cam:4: camera_matrix: expected [fx, 0, cx, 0, fy, cy, 0, 0, 1], found a mapping");
  EXPECT_EQ(why_not(replaced(kRos, "437.302876", "0")),
            "cam:4: camera_matrix: expected focal lengths above 0, not 438.783 and 0, found a mapping");
  EXPECT_EQ(why_not(replaced(kRos, "438.783367, 0.000000, 305", "305")),
            "cam:7: camera_matrix.data: expected a list of 9 numbers, found a list of 7");
  EXPECT_EQ(why_not(replaced(kRos, "cols: 5", "cols: 4")),
            "cam:12: distortion_coefficients.data: expected 1 x 4 numbers, found a list of 5");
  EXPECT_EQ(why_not(replaced(kRos, "0.110510", ".nan")),
            "cam:12: distortion_coefficients.data[1]: expected a number, found \".nan\"");
  EXPECT_EQ(why_not(replaced(kRos, "image_width: 640", "image_width: -640")),
            "cam:1: image_width: expected a whole number between 1 and 1000000, found \"-640\"");
  EXPECT_EQ(why_not(replaced(kRos, "image_height", "image_hight")),
            "cam:1: image_height: expected a number of pixels, found nothing");
}

// As cv::FileStorage of OpenCV 4 writes it.
const char* const kOpencv = R"(%YAML:1.0
---
calibration_time: "Thu 01 Jan 2024"
image_width: 640
image_height: 480
flags: 0
fisheye_model: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3591573396163199e+02, 0., 3.4228315473308373e+02, 0.,
       5.3591573396163199e+02, 2.3557082909788173e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -2.6637260909660682e-01, -3.8588898922304653e-02,
       1.7831947042852964e-03, -2.8122100441115472e-04,
       2.3839153080878486e-01 ]
)";

TEST(ReadCameraModel, TakesOpencvsFileStorage) {
  const TempFolder folder;
  const CameraModel camera = read_camera_model(folder.write("cv.yml", kOpencv));
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV5");
  EXPECT_EQ(camera.intrinsics()[3], 2.3557082909788173e+02);
  EXPECT_EQ(camera.intrinsics()[8], 2.3839153080878486e-01);
}

TEST(ReadCameraModel, SaysWhatIsWrongWithOpencvsFiles) {
  EXPECT_THAT(why_not(replaced(kOpencv, "fisheye_model: 0", "fisheye_model: 1")),
              HasSubstr("cam:7: fisheye_model: expected 0; mrcal has no fisheye model"));
  EXPECT_EQ(why_not(replaced(kOpencv, "5.3591573396163199e+02, 0., 3", ".Nan, 0., 3")),
            "cam:12: camera_matrix.data[0]: expected a number, found \".Nan\"");
  EXPECT_THAT(why_not(replaced(kOpencv, "distortion_coefficients", "distortion")),
              HasSubstr("distortion_coefficients: expected a matrix, found nothing"));
}

const char* const kAsl = R"(sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [752, 480]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]
)";

TEST(ReadCameraModel, TakesAslSensors) {
  const TempFolder folder;
  const CameraModel camera = read_camera_model(folder.write("sensor.yaml", kAsl));
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV4");
  EXPECT_EQ(camera.width(), 752);
  EXPECT_THAT(camera.intrinsics(), ElementsAre(458.654, 457.296, 367.215, 248.375, -0.28340811, 0.07395907,
                                               0.00019359, 1.76187114e-05));
  const std::string none = replaced(replaced(kAsl, "radial-tangential", "none"),
                                    "[-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]", "[]");
  EXPECT_EQ(read_camera_model(folder.write("none.yaml", none)).lens(), "LENSMODEL_PINHOLE");
}

TEST(ReadCameraModel, SaysWhatIsWrongWithAslSensors) {
  EXPECT_THAT(
      why_not(replaced(kAsl, "radial-tangential", "equidistant")),
      HasSubstr("cam:10: distortion_model: expected radial-tangential or none; mrcal has no fisheye"));
  EXPECT_THAT(why_not(replaced(kAsl, "radial-tangential", "none")),
              HasSubstr("cam:11: distortion_coefficients: expected none or zeros"));
  EXPECT_THAT(why_not(replaced(kAsl, "pinhole", "omni")), HasSubstr("cam:8: camera_model: expected pinhole"));
  EXPECT_EQ(why_not(replaced(kAsl, ", 248.375]", "]")),
            "cam:9: intrinsics: expected a list of 4 numbers, found a list of 3");
  EXPECT_EQ(why_not(replaced(kAsl, "458.654", "-458.654")),
            "cam:9: intrinsics: expected focal lengths above 0, not -458.654 and 457.296, found a list of 4");
  EXPECT_EQ(why_not(replaced(kAsl, "1.76187114e-05]", "1.76187114e-05, 0.1]")),
            "cam:11: distortion_coefficients: expected 4 coefficients, not 5, found a list of 5");
}

TEST(ReadCameraModel, SaysWhenAFileIsNoCameraModel) {
  EXPECT_THAT(why_not("hello: world\n"),
              HasSubstr("cam:1: expected a camera model, found neither lensmodel"));
  EXPECT_THAT(why_not(""), HasSubstr("expected a camera model, found neither"));
  EXPECT_THAT(why_not("just a text\n"), HasSubstr("cam:1: expected a mapping"));
  EXPECT_THAT(why_not("\x89PNG\r\n\x1a\n"), testing::Not("accepted"));
  const TempFolder folder;
  EXPECT_THAT([&] { read_camera_model(folder / "absent.yaml"); },
              testing::ThrowsMessage<ConfigError>(
                  EndsWith("absent.yaml: expected a camera model, found no file that can be read")));
  EXPECT_THROW(read_camera_model(folder.path()), ConfigError);
}

TEST(ReadCameraModel, TakesTheCamerasOfTheDevelopmentFlights) {
  const auto flight = shared_flight("dev_descent");
  if (flight.empty()) GTEST_SKIP() << "no development flights here";
  const CameraModel camera = read_camera_model(flight / "mav0/cam0/sensor.yaml");
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV4");
  EXPECT_EQ(camera.intrinsics()[0], 452.9);
}

}  // namespace
}  // namespace perch
