#include "perch/simulation/simulation.h"

#include <gmock/gmock.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "perch/simulation/flight_folder.h"
#include "support/near_pose.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// A folder of its own for each test, with a target in it.
class SimulationFiles : public testing::Test {
 protected:
  SimulationFiles() {
    folder_.write("sharp.yaml",
                  "name: sharp\nsize: 1.0\nmodules: 20\nborder: 3\nsquares:\n  A: [10, 10, 5]\n"
                  "  B: [5, 13, 2]\n  C: [5, 9, 2]\n  D: [5, 5, 2]\n  E: [9, 5, 2]\n  F: [13, 5, 2]\n");
  }

  Section section(const std::string& more = "", const std::vector<std::string>& set = {}) const {
    return Section::parse("target: sharp.yaml\n" + more, folder_ / "simulation.yaml", set);
  }
  // Small and short: 8 frames of 160x120.
  Simulation small(const std::string& lens = "LENSMODEL_PINHOLE", const std::string& distortions = "") const {
    return read_simulation(section("camera: {width: 160, height: 120, rate_hz: 7, lens: " + lens +
                                   ", intrinsics: [110, 111, 79, 60" + distortions +
                                   "]}\nflight: {duration: 0.8, hover: 0.2}\nnav: {time_offset: 0.25}\n"));
  }
  static std::string text(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }
  // The numbers of a CSV row by row, its header left out.
  static std::vector<std::vector<double>> rows(const fs::path& file) {
    std::vector<std::vector<double>> all;
    std::istringstream lines(text(file));
    std::string line, cell;
    std::getline(lines, line);
    while (std::getline(lines, line)) {
      std::istringstream cells(line);
      all.emplace_back();
      while (std::getline(cells, cell, ',')) all.back().push_back(std::stod(cell));
    }
    return all;
  }
  static Rigid3 pose(const std::vector<double>& row) {
    return {Eigen::Quaterniond(row[4], row[5], row[6], row[7]), {row[1], row[2], row[3]}};
  }
  void write(const SimulatedFlight& flight, const std::string& name, bool force = false) const {
    FlightFolder folder(folder_ / name, force);
    for (int64_t i = flight.frames(); i-- > 0;) folder.write_frame(flight, i);  // in any order
    folder.write_tables(flight, "seed: 1\n");
    folder.finish();
  }

  TempFolder folder_;
};

TEST_F(SimulationFiles, NeedsNothingButATarget) {
  const Simulation simulation = read_simulation(section());
  EXPECT_EQ(simulation.camera.width(), 640);
  EXPECT_EQ(simulation.target.name, "sharp");
  EXPECT_THROW(read_simulation(Section::parse("seed: 3\n", folder_ / "x.yaml")), ConfigError);
}

TEST_F(SimulationFiles, RefusesWhatItDoesNotKnow) {
  const auto complaint = [&](const std::string& more) -> std::string {
    try {
      read_simulation(section(more));
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_THAT(complaint("camera: {hight: 480}\n"), HasSubstr("simulation.yaml:2: camera.hight"));
  EXPECT_THAT(complaint("flight: {start_height: -1}\n"), HasSubstr("flight.start_height"));
  EXPECT_THAT(complaint("camera: {lens: LENSMODEL_NONE}\n"), HasSubstr("simulation.yaml:2: camera"));
  EXPECT_THAT(complaint("scene: {shadow: {factor: 2}}\n"), HasSubstr("scene.shadow.factor"));
  EXPECT_EQ(complaint("scene: {shadow: {factor: 0.2}}\n"), "");
}

TEST_F(SimulationFiles, ResolvedConfigurationFliesTheSameFlight) {
  Section root = section("flight: {start_bearing_deg: 77}\n");
  const Simulation one = read_simulation(root);
  const Simulation other = read_simulation(Section::parse(root.resolved(), folder_ / "again.yaml"));
  EXPECT_NEAR(one.flight.start_bearing, 77 * M_PI / 180, 4 * kEpsilon);
  EXPECT_NEAR(one.flight.yaw_drift, DescentOptions{}.yaw_drift, kEpsilon);
  // Degrees and radians are converted once more: rounding.
  EXPECT_NEAR(one.flight.start_bearing, other.flight.start_bearing, 4 * kEpsilon);
  EXPECT_NEAR(one.flight.yaw_drift, other.flight.yaw_drift, 4 * kEpsilon);
  EXPECT_THAT(one.body_from_camera, IsNearPose(other.body_from_camera, 8 * kEpsilon, 8 * kEpsilon));
}

TEST_F(SimulationFiles, KeepsTheSquaresInView) {
  Simulation simulation = read_simulation(section());
  const CameraModel& camera = simulation.camera;
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    simulation.seed = seed;
    const SimulatedFlight flight(simulation);
    int seen = 0;
    for (int64_t i = 0; i < flight.frames(); ++i) {
      bool whole = true;
      for (const Feature& feature : simulation.target.features) {
        const Eigen::Vector3d corner(feature.point.x(), feature.point.y(), 0);
        const auto pixel = camera.pixel_from_camera(flight.camera_from_target(i) * corner);
        whole = whole && pixel && pixel->x() > 0 && pixel->x() < 639 && pixel->y() > 0 && pixel->y() < 479;
      }
      seen += whole;
    }
    EXPECT_GT(seen, 0.9 * static_cast<double>(flight.frames())) << seed;
  }
}

TEST_F(SimulationFiles, TruthAgreesWithItsParts) {
  const Simulation simulation = small();
  const SimulatedFlight flight(simulation);
  write(flight, "flight");
  const fs::path mav = folder_ / "flight" / "mav0";
  const auto poses = rows(mav / "cam0" / "truth_target_pose.csv");
  const auto states = rows(mav / "state_groundtruth_estimate0" / "data.csv");
  ASSERT_EQ(poses.size(), 8u);
  ASSERT_EQ(states.size(), 8u);
  // What a reader takes T_BS for.
  Section sensor = Section::load(mav / "cam0" / "sensor.yaml");
  Section extrinsics = sensor.section("T_BS");
  std::vector<double> t;
  extrinsics.read("data", t, 16);
  Eigen::Matrix3d R;
  R << t[0], t[1], t[2], t[4], t[5], t[6], t[8], t[9], t[10];
  const Rigid3 body_from_camera{Eigen::Quaterniond(R), {t[3], t[7], t[11]}};
  const fs::path configuration = folder_ / "flight" / "perch.yaml";
  Section run = Section::load(configuration);
  Section frames = run.section("frames");
  Rigid3 world_from_pad, body_from_base;
  frames.read("world_from_pad", world_from_pad);
  frames.read("body_from_base", body_from_base);
  EXPECT_THAT(body_from_base, IsNearPose(body_from_camera, 1e-9, 1e-9));
  for (size_t i = 0; i < poses.size(); ++i) {
    EXPECT_EQ(states[i][0], poses[i][0]);
    const Rigid3 camera_from_target = inverse(pose(states[i]) * body_from_camera) * world_from_pad;
    EXPECT_THAT(pose(poses[i]), IsNearPose(camera_from_target, 1e-9, 1e-9));
  }
}

TEST_F(SimulationFiles, OnADeckEveryTruthSeesThePadMove) {
  Simulation simulation = small();
  simulation.deck.emplace();
  const SimulatedFlight flight(simulation), ashore(small());
  write(flight, "flight");
  const fs::path mav = folder_ / "flight" / "mav0";
  const auto poses = rows(mav / "cam0" / "truth_target_pose.csv");
  const auto states = rows(mav / "state_groundtruth_estimate0" / "data.csv");
  const auto pads = rows(mav / "pad0" / "data.csv");
  const auto bodies = rows(mav / "truth_pad_from_body.csv");
  ASSERT_EQ(pads.size(), 8u);
  ASSERT_EQ(bodies.size(), 8u);
  for (size_t i = 0; i < pads.size(); ++i) {
    const auto frame = static_cast<int64_t>(i);
    const Rigid3 body = inverse(pose(pads[i])) * pose(states[i]);
    EXPECT_THAT(pose(bodies[i]), IsNearPose(body, 1e-12, 1e-12));
    EXPECT_THAT(pose(poses[i]), IsNearPose(inverse(body * simulation.body_from_camera), 1e-12, 1e-12));
    // The vehicle does what it does ashore.
    EXPECT_THAT(pose(states[i]), IsNearPose(ashore.vehicle(frame).world_from_body, 1e-12, 1e-12));
    EXPECT_GT((pose(pads[i]).translation - simulation.world_from_pad.translation).norm(), 1e-3);
  }
  // Navigation has no place of the pad to be compared with.
  Section run = Section::load(folder_ / "flight" / "perch.yaml");
  EXPECT_FALSE(run.section("frames").has("world_from_pad"));
}

TEST_F(SimulationFiles, VelocityOverTheDeckIsHowThePlaceOverItChanges) {
  Simulation simulation = small();
  simulation.rate_hz = 100;
  simulation.deck.emplace();
  const SimulatedFlight flight(simulation);
  for (int64_t i = 1; i + 1 < flight.frames(); ++i) {
    const Eigen::Vector3d step =
        (flight.pad_from_body(i + 1).translation - flight.pad_from_body(i - 1).translation) / 0.02;
    // A central difference is off by T^2 / 6 of the third derivative: of this steep descent of 9 m/s some
    // 700 m/s^3, 0.012 m/s; a term left out, of the deck's 0.3 m/s or of its turning, would be more.
    EXPECT_LE((flight.body_velocity_in_pad(i) - step).norm(), 0.012) << i;
  }
}

TEST_F(SimulationFiles, ADeckIsThereWhenItIsNamed) {
  EXPECT_FALSE(read_simulation(section()).deck);
  const auto deck = read_simulation(section("deck: {heave: 1.5, roll_deg: 7}\n")).deck;
  ASSERT_TRUE(deck);
  EXPECT_EQ(deck->heave, 1.5);
  EXPECT_NEAR(deck->roll, 7 * M_PI / 180, 4 * kEpsilon);
  EXPECT_EQ(deck->pitch, DeckOptions{}.pitch);
  EXPECT_THROW(read_simulation(section("deck: {height: 1}\n")), ConfigError);
}

TEST_F(SimulationFiles, WritesAWholeFlight) {
  const SimulatedFlight flight(small("LENSMODEL_OPENCV5", ", -0.1, 0.01, 0, 0, 0"));
  write(flight, "flight");
  const fs::path mav = folder_ / "flight" / "mav0";
  std::istringstream frames(text(mav / "cam0" / "data.csv"));
  std::string line;
  std::getline(frames, line);
  EXPECT_EQ(line, "#timestamp [ns],filename");
  int count = 0;
  while (std::getline(frames, line)) {
    const std::string name = line.substr(line.find(',') + 1);
    const cv::Mat picture = cv::imread((mav / "cam0" / "data" / name).string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(picture.type(), CV_8UC1) << name;
    EXPECT_EQ(cv::norm(picture, flight.picture(count), cv::NORM_INF), 0);
    ++count;
  }
  EXPECT_EQ(count, 8);
  const CameraModel camera = read_camera_model(mav / "cam0" / "camera.cameramodel");
  EXPECT_EQ(camera.lens(), "LENSMODEL_OPENCV5");
  EXPECT_EQ(camera.intrinsics(), flight.simulation().camera.intrinsics());
  EXPECT_EQ(text(folder_ / "flight" / "target.yaml"), text(folder_ / "sharp.yaml"));
  EXPECT_THAT(text(folder_ / "flight" / "perch.yaml"), HasSubstr("time_offset: 0.25"));
  EXPECT_EQ(rows(mav / "nav0" / "data.csv").size(), flight.navigation().size());
  EXPECT_FALSE(fs::exists(folder_ / "flight.part"));
}

TEST_F(SimulationFiles, SensorYamlAloneDescribesASimpleLens) {
  const SimulatedFlight flight(small("LENSMODEL_OPENCV4", ", -0.13, 0.019, -0.0005, 0.0003"));
  write(flight, "flight");
  const fs::path folder = folder_ / "flight" / "mav0" / "cam0";
  EXPECT_FALSE(fs::exists(folder / "camera.cameramodel"));
  EXPECT_EQ(read_camera_model(folder / "sensor.yaml").intrinsics(), flight.simulation().camera.intrinsics());
}

TEST_F(SimulationFiles, SameSeedSameBytes) {
  Simulation simulation = small();
  const SimulatedFlight one(simulation), again(simulation);
  simulation.seed = 2;
  const SimulatedFlight other(simulation);
  EXPECT_EQ(cv::norm(one.picture(3), again.picture(3), cv::NORM_INF), 0);
  EXPECT_GT(cv::norm(one.picture(3), other.picture(3), cv::NORM_INF), 0);
  EXPECT_EQ(one.navigation()[7].world_from_body.translation,
            again.navigation()[7].world_from_body.translation);
  EXPECT_NE(one.navigation()[7].world_from_body.translation,
            other.navigation()[7].world_from_body.translation);
}

TEST_F(SimulationFiles, NeverOverwritesWhatItDidNotWrite) {
  const SimulatedFlight flight(small());
  fs::create_directories(folder_ / "thesis");
  std::ofstream(folder_ / "thesis" / "chapter1.tex") << "years of work";
  EXPECT_THROW(FlightFolder(folder_ / "thesis", true), std::runtime_error);
  EXPECT_EQ(text(folder_ / "thesis" / "chapter1.tex"), "years of work");

  write(flight, "flight");
  EXPECT_THROW(FlightFolder(folder_ / "flight", false), std::runtime_error);
  EXPECT_TRUE(fs::exists(folder_ / "flight" / "perch.yaml"));
  EXPECT_NO_THROW(write(flight, "flight", true));
  fs::create_directories(folder_ / "empty");
  EXPECT_NO_THROW(write(flight, "empty/"));
}

TEST_F(SimulationFiles, LeavesNothingWhenInterrupted) {
  const SimulatedFlight flight(small());
  {
    FlightFolder folder(folder_ / "flight", false);
    folder.write_frame(flight, 0);
  }
  EXPECT_FALSE(fs::exists(folder_ / "flight"));
  EXPECT_FALSE(fs::exists(folder_ / "flight.part"));
}

}  // namespace
}  // namespace perch
