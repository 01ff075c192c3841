#include "perch/flight/flight.h"

#include <gmock/gmock.h>

#include <chrono>

#include "support/near_pose.h"
#include "support/shared.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

const std::string kIntrinsics =
    "camera_model: pinhole\nresolution: [640, 480]\nintrinsics: [450, 451, 320, 240]\n"
    "distortion_model: radial-tangential\ndistortion_coefficients: [-0.1, 0.01, 0, 0]\n";
const std::string kMount =
    "T_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1]\n";
const std::string kNavHeader =
    "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z,v_x [m/s],v_y [m/s],v_z [m/s]\n";

// A flight of one camera row, with whatever else the test wants.
struct FlightFolder : TempFolder {
  FlightFolder() {
    write("mav0/cam0/data.csv", "#timestamp [ns],filename\n1,1.png\n");
    write("mav0/cam0/sensor.yaml", kMount + kIntrinsics);
  }
  Flight read() const { return read_flight(path()); }
  // The problems, without the folder.
  std::vector<std::string> problems() const {
    std::vector<std::string> result;
    for (const std::string& problem : read().problems) {
      EXPECT_TRUE(problem.starts_with(path().string() + "/mav0/")) << problem;
      result.push_back(problem.substr(path().string().size() + 6));
    }
    return result;
  }
};

TEST(Flight, HasItsCameraAndMount) {
  const FlightFolder folder;
  const Flight flight = folder.read();
  EXPECT_EQ(flight.folder, folder.path());
  EXPECT_EQ(flight.name, folder.path().filename().string());
  EXPECT_EQ(read_flight(folder.path() / "").name, flight.name);
  ASSERT_TRUE(flight.camera);
  EXPECT_EQ(flight.camera->lens(), "LENSMODEL_OPENCV4");
  ASSERT_TRUE(flight.body_from_camera);
  const Rigid3 quarter{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())),
                       {0.1, 0.2, 0.3}};
  EXPECT_THAT(*flight.body_from_camera, IsNearPose(quarter, 1e-15, 0));
  EXPECT_THAT(flight.nav.samples, IsEmpty());
  EXPECT_THAT(flight.problems, IsEmpty());
}

TEST(Flight, TheCameraModelWinsOverTheSensorFile) {
  const FlightFolder folder;
  folder.write("mav0/cam0/camera.cameramodel",
               "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,2,3], 'imagersize': [4, 5]}");
  EXPECT_EQ(folder.read().camera->lens(), "LENSMODEL_PINHOLE");
  EXPECT_TRUE(folder.read().body_from_camera);
  folder.write("mav0/cam0/camera.cameramodel", "{'lensmodel': 'LENSMODEL_PINHOLE'}");
  EXPECT_EQ(folder.read().camera->lens(), "LENSMODEL_OPENCV4");
  EXPECT_THAT(folder.problems(),
              ElementsAre("cam0/camera.cameramodel:1: intrinsics: expected a list of numbers, "
                          "found nothing"));
}

TEST(Flight, LivesWithoutWhatCannotBeRead) {
  const FlightFolder folder;
  folder.write("mav0/cam0/sensor.yaml", "a: [");
  EXPECT_FALSE(folder.read().camera);
  EXPECT_FALSE(folder.read().body_from_camera);
  EXPECT_EQ(folder.problems().size(), 1U);
  folder.write("mav0/cam0/sensor.yaml", kMount);
  EXPECT_TRUE(folder.read().body_from_camera);
  EXPECT_THAT(folder.problems(), ElementsAre(HasSubstr("cam0/sensor.yaml:1: expected a camera model")));
  std::filesystem::remove(folder / "mav0/cam0/sensor.yaml");
  EXPECT_THAT(folder.problems(), ElementsAre("cam0: neither camera.cameramodel nor sensor.yaml"));
}

TEST(Flight, RefusesAMountThatIsNoRotation) {
  const FlightFolder folder;
  const auto problem_of = [&](const std::string& data) {
    folder.write("mav0/cam0/sensor.yaml", kIntrinsics + "T_BS:\n  data: [" + data + "]\n");
    EXPECT_FALSE(folder.read().body_from_camera) << data;
    EXPECT_TRUE(folder.read().camera);
    const auto problems = folder.problems();
    return problems.empty() ? "" : problems[0];
  };
  EXPECT_THAT(problem_of("1, 0, 0, 0, 0, 1.01, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"),
              HasSubstr("sensor.yaml:6: T_BS: expected a rotation, orthonormal to 0.001 (off by 0.0201"));
  EXPECT_THAT(problem_of("1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1"), HasSubstr("not a mirror"));
  EXPECT_THAT(problem_of("1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 1"),
              HasSubstr("0 0 0 1 as the last row"));
  EXPECT_THAT(problem_of("1, 0, 0, .nan, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"),
              HasSubstr("T_BS.data[3]: expected a number, found \".nan\""));
  EXPECT_THAT(problem_of("1, 0, 0, 0, 1, 0, 0, 0, 1"), HasSubstr("T_BS.data: expected a list of 16 numbers"));
  // Four digits are what people write.
  folder.write(
      "mav0/cam0/sensor.yaml",
      kIntrinsics + "T_BS:\n  data: [0.7071, -0.7071, 0, 0, 0.7071, 0.7071, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n");
  const Rigid3 eighth{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 4, Eigen::Vector3d::UnitZ())), {0, 0, 0}};
  EXPECT_THAT(*folder.read().body_from_camera, IsNearPose(eighth, 1e-15, 0));
}

TEST(Flight, NavIsReadWithUnitsChecked) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv",
               kNavHeader + "1000,1,2,3,-2,0,0,0,4,5,6\r\n2000,1,2,3,0,0,1,0,4,5,6\r\n");
  const Flight flight = folder.read();
  ASSERT_EQ(flight.nav.samples.size(), 2U);
  EXPECT_EQ(flight.nav.samples[0].timestamp_ns, 1000);
  EXPECT_EQ(flight.nav.samples[0].world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(flight.nav.samples[0].world_from_body.rotation.w(), 1);
  EXPECT_EQ(flight.nav.samples[1].world_from_body.rotation.y(), 1);
  EXPECT_EQ(flight.nav.samples[0].body_velocity_in_world, Eigen::Vector3d(4, 5, 6));
  EXPECT_THAT(flight.problems, IsEmpty());

  folder.write("mav0/nav0/data.csv",
               "#timestamp [ns],p_x [mm],p_y [mm],p_z [mm],q_w,q_x,q_y,q_z\n1,1,2,3,1,0,0,0\n");
  EXPECT_THAT(folder.read().nav.samples, IsEmpty());
  EXPECT_THAT(folder.problems(), ElementsAre("nav0/data.csv:1: expected the column p_x [m], found p_x [mm]"));
}

TEST(Flight, SkipsNavRowsThatCannotBeUsed) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader +
                                         "900,1,2,3,1,0,0,0,4,5,6\n"
                                         "1000,1,2,3,1,0,0,0,4,5,6\n"
                                         "1100,nan,2,3,1,0,0,0,4,5,6\n"
                                         "1200,1,2,3,0,0,0,0,4,5,6\n"
                                         "1300,1,2,3,1,0,0\n"
                                         "1000,1,2,3,1,0,0,0,4,5,6\n"
                                         "500,1,2,3,1,0,0,0,4,5,6\n"
                                         "x,1,2,3,1,0,0,0,4,5,6\n"
                                         "1400,9,2,3,1,0,0,0,4,5,6\n");
  EXPECT_EQ(folder.read().nav.samples.size(), 3U);
  EXPECT_THAT(
      folder.problems(),
      ElementsAre("nav0/data.csv:4: p_x [m]: expected a number, found \"nan\", row skipped",
                  "nav0/data.csv:5: q_w q_x q_y q_z: expected a rotation, found a quaternion of length "
                  "0.000000, row skipped",
                  "nav0/data.csv:6: q_z: expected a number, found \"\", row skipped",
                  "nav0/data.csv:9: timestamp: expected whole nanoseconds, found \"x\", row skipped",
                  "nav0/data.csv:7: the clock goes back or stands still at 1000, row skipped",
                  "nav0/data.csv:8: the clock goes back or stands still at 500, row skipped"));
}

TEST(Flight, APositionWithoutAnAttitudeIsARow) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader +
                                         "1000,1,2,3,,,,,4,5,6\n"
                                         "2000,1,2,3,1,0,0,0,4,5,6\n"
                                         "3000,1,2,3,1,,,,4,5,6\n"
                                         "4000,1,,3,,,,,4,5,6\n");
  const Flight flight = folder.read();
  ASSERT_EQ(flight.nav.samples.size(), 2U);
  EXPECT_FALSE(flight.nav.samples[0].knows_attitude());
  EXPECT_TRUE(flight.nav.samples[1].knows_attitude());
  EXPECT_EQ(flight.nav.samples[0].world_from_body.translation, Eigen::Vector3d(1, 2, 3));
  // Between the two a position is known and an attitude is not.
  const auto between = flight.nav.at(1500);
  ASSERT_TRUE(between);
  EXPECT_FALSE(between->knows_attitude());
  EXPECT_NEAR((between->world_from_body.translation - Eigen::Vector3d(1, 2, 3)).norm(), 0, 1e-5);
  EXPECT_THAT(folder.problems(),
              ElementsAre("nav0/data.csv:4: q_x: expected a number, found \"\", row skipped",
                          "nav0/data.csv:5: p_y [m]: expected a number, found \"\", row skipped",
                          "nav0/data.csv: 1 rows without an attitude, of use for positions alone"));
}

TEST(Flight, MissingVelocitiesComeFromThePositions) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv",
               "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z\n"
               "0,0,0,0,1,0,0,0\n100000000,1,0,0,1,0,0,0\n200000000,3,0,0,1,0,0,0\n");
  const auto samples = folder.read().nav.samples;
  ASSERT_EQ(samples.size(), 3U);
  EXPECT_NEAR(samples[0].body_velocity_in_world.x(), 10, 1e-12);
  EXPECT_NEAR(samples[1].body_velocity_in_world.x(), 15, 1e-12);
  EXPECT_NEAR(samples[2].body_velocity_in_world.x(), 20, 1e-12);
  EXPECT_THAT(folder.problems(),
              ElementsAre("nav0/data.csv: 3 rows without a velocity, taken from the positions"));
}

TEST(Flight, EurocsTruthStandsInForNav) {
  const FlightFolder folder;
  folder.write(
      "mav0/state_groundtruth_estimate0/data.csv",
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
      "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1]\n"
      "1403636580838555648,4.688319,-1.786938,0.783338,0.534108,-0.153029,-0.827383,-0.082152,-0.027876,"
      "0.033207,0.800006,-0.003172\n");
  const auto samples = folder.read().nav.samples;
  ASSERT_EQ(samples.size(), 1U);
  EXPECT_EQ(samples[0].timestamp_ns, 1403636580838555648);
  EXPECT_EQ(samples[0].body_velocity_in_world.z(), 0.800006);
  EXPECT_TRUE(folder.read().nav_is_truth);
  EXPECT_THAT(folder.read().truth.samples, IsEmpty());
}

TEST(Flight, TruthLiesBesideNav) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader + "7,1,2,3,1,0,0,0,0,0,0\n");
  folder.write("mav0/state_groundtruth_estimate0/data.csv",
               "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
               "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1]\n8,4,5,6,1,0,0,0,0,0,0\n");
  const Flight flight = folder.read();
  EXPECT_FALSE(flight.nav_is_truth);
  ASSERT_EQ(flight.nav.samples.size(), 1U);
  EXPECT_EQ(flight.nav.samples[0].timestamp_ns, 7);
  ASSERT_EQ(flight.truth.samples.size(), 1U);
  EXPECT_EQ(flight.truth.samples[0].world_from_body.translation, Eigen::Vector3d(4, 5, 6));
}

TEST(Flight, AnEmptyNavIsNotReplacedByTruth) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader);
  folder.write("mav0/state_groundtruth_estimate0/data.csv", kNavHeader + "8,4,5,6,1,0,0,0,0,0,0\n");
  EXPECT_THAT(folder.read().nav.samples, IsEmpty());
  EXPECT_FALSE(folder.read().nav_is_truth);
}

TEST(Flight, RefusesPlacesThatNoVehicleHas) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader +
                                         "1,1e300,0,0,1,0,0,0,0,0,0\n"
                                         "2,0,-2e8,0,1,0,0,0,0,0,0\n"
                                         "4,0,0,6.4e6,1,0,0,0.02,0,0,0\n");
  EXPECT_EQ(folder.read().nav.samples.size(), 1U);
  EXPECT_THAT(
      folder.problems(),
      ElementsAre("nav0/data.csv:2: p_x [m]: expected a number within 1e8, found \"1e300\", row skipped",
                  "nav0/data.csv:3: p_y [m]: expected a number within 1e8, found \"-2e8\", row skipped"));
}

TEST(Flight, QuotesOfBytesWhatALineHolds) {
  const FlightFolder folder;
  folder.write("mav0/nav0/data.csv", kNavHeader + std::string("\x01\xff\"") + std::string(500, 'x') + ",0\n");
  EXPECT_THAT(folder.problems(),
              ElementsAre("nav0/data.csv:2: timestamp: expected whole nanoseconds, found \"???" +
                          std::string(37, 'x') + "...\", row skipped"));
}

TEST(Flight, GimbalAnglesAreInRadians) {
  const FlightFolder folder;
  folder.write("mav0/gimbal0/data.csv",
               "#timestamp [ns],pan [rad],tilt [rad],zoom []\n5,0.1,-0.2,3\n6,nan,0,1\n7,0.1,-0.2,\n");
  const auto gimbal = folder.read().gimbal;
  ASSERT_EQ(gimbal.size(), 2U);
  EXPECT_FALSE(gimbal[1].zoom);
  EXPECT_EQ(gimbal[0].timestamp_ns, 5);
  EXPECT_EQ(gimbal[0].pan, 0.1);
  EXPECT_EQ(gimbal[0].tilt, -0.2);
  EXPECT_EQ(gimbal[0].zoom, 3);
  EXPECT_THAT(folder.problems(),
              ElementsAre("gimbal0/data.csv:3: pan [rad]: expected a number, found \"nan\", row skipped"));
  folder.write("mav0/gimbal0/data.csv", "#timestamp [ns],pan [deg],tilt [deg],zoom []\n5,0.1,-0.2,3\n");
  EXPECT_THAT(folder.problems(),
              ElementsAre("gimbal0/data.csv:1: expected the column pan [rad], found pan [deg]"));
}

TEST(Flight, SaysWhenAFolderIsNone) {
  const TempFolder folder;
  EXPECT_THAT([&] { read_flight(folder.path()); },
              ThrowsMessage<std::runtime_error>(EndsWith("no flight: expected mav0/cam0/data.csv in it")));
}

TEST(Flight, TakesTheDevelopmentFlights) {
  for (const char* name :
       {"dev_descent", "dev_hard", "dev_negative", "dev_close_nested", "real_mocap", "real_photos"}) {
    const auto folder = shared_flight(name);
    if (folder.empty()) GTEST_SKIP() << "no development flights here";
    const Flight flight = read_flight(folder);
    EXPECT_TRUE(flight.camera) << name;
    EXPECT_TRUE(flight.body_from_camera) << name;
    EXPECT_EQ(flight.nav.samples.empty(), flight.name == "real_photos") << name;
    EXPECT_THAT(flight.problems, IsEmpty()) << name;
  }
}

}  // namespace
}  // namespace perch
