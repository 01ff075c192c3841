// The estimate of every frame of the development flights, kept in recorded_poses_METHOD.txt: any change shows
// as a diff. Not whether they are right, which others test, but that they are what they were.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <iomanip>
#include <map>
#include <sstream>

#include "perch/camera/image_source.h"
#include "perch/flight/flight.h"
#include "perch/geometry/so3.h"
#include "support/shared.h"
#include "support/whole_frame.h"

namespace perch {
namespace {

struct RecordedFlight {
  const char* name;
  const char* target;
};
constexpr RecordedFlight kFlights[] = {{"dev_descent", "sharp"},
                                       {"dev_hard", "sharp"},
                                       {"dev_close_nested", "nested"},
                                       {"dev_negative", "sharp"}};

// A row: flight, number of the frame, status, and with `ok` camera_from_target as position in m and rotation
// vector in rad.
struct Row {
  std::string key;  // "dev_hard 017"
  std::string status;
  std::vector<double> pose;  // six numbers or none

  std::string line() const {
    std::ostringstream text;
    text << key << ' ' << status << std::fixed << std::setprecision(5);
    for (const double number : pose) text << ' ' << number;
    return text.str();
  }
};

// What another compiler or library does to the last bits of a solver that stops at small steps stays below;
// half of the fifth digit is rounding. Above it shows all that matters: a corner that comes out one pixel
// further moves a pose by millimetres, and the truth itself is known to 0.005 px, 0.01 mm a metre away.
constexpr double kTolerance = 1e-4;  // m, rad

bool same(const Row& a, const Row& b) {
  if (a.key != b.key || a.status != b.status || a.pose.size() != b.pose.size()) return false;
  if (a.pose.empty()) return true;
  const auto part = [](const Row& row, size_t i) {
    return Eigen::Vector3d(row.pose[i], row.pose[i + 1], row.pose[i + 2]);
  };
  // Half a turn has two vectors: rotations are compared, not their numbers.
  const auto turn = [&](const Row& row) { return Eigen::Quaterniond(so3_exp(part(row, 3))); };
  return (part(a, 0) - part(b, 0)).norm() <= kTolerance && turn(a).angularDistance(turn(b)) <= kTolerance;
}

Row row_of(const std::string& flight, int number, const Estimate& estimate) {
  std::ostringstream key;
  key << flight << ' ' << std::setfill('0') << std::setw(3) << number;
  Row row{key.str(), to_string(estimate.status), {}};
  if (estimate.status != EstimateStatus::kOk) return row;
  const Rigid3& pose = estimate.camera_from_target.mean;
  const Eigen::Vector3d p = pose.translation, r = so3_log(pose.rotation);
  row.pose = {p.x(), p.y(), p.z(), r.x(), r.y(), r.z()};
  return row;
}

// As perch-batch does it, with the pad where the flights have it.
std::vector<Row> estimate(const RecordedFlight& recorded, const std::string& method) {
  const Flight flight = read_flight(shared_flight(recorded.name));
  RunConfig config = run_config_of(method, recorded.target);
  config.frames.body_from_base = flight.body_from_camera;
  config.frames.world_from_pad =
      Rigid3{Eigen::Quaterniond(0.5591929, 0, 0, -0.8290376).normalized(), Eigen::Vector3d(-6.2, 21.7, 1.35)};
  Estimator estimator(config, flight.camera.value());
  const auto source = open_image_source("flight:" + flight.folder.string());
  std::vector<Row> rows;
  for (Frame frame; source->next(frame);) {
    Estimator::Aid aid;
    if (const auto nav = flight.nav.at(navigation_time_ns(config.frames, frame.timestamp_ns)))
      aid.world_from_body = nav->world_from_body.rotation;
    rows.push_back(row_of(recorded.name, static_cast<int>(rows.size()), estimator.process(frame, aid)));
  }
  return rows;
}

std::vector<Row> read_rows(const std::filesystem::path& file) {
  std::vector<Row> rows;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    std::istringstream text(line);
    std::string flight, number;
    Row row;
    text >> flight >> number >> row.status;
    row.key = flight + ' ' + number;
    for (double value; text >> value;) row.pose.push_back(value);
    rows.push_back(row);
  }
  return rows;
}

void write_rows(const std::filesystem::path& file, const std::vector<Row>& rows) {
  std::ofstream out(file);
  for (const Row& row : rows) out << row.line() << '\n';
}

// The lines of a diff: what was, and what is.
std::string difference(const std::vector<Row>& before, const std::vector<Row>& now) {
  std::map<std::string, std::pair<const Row*, const Row*>> pairs;
  for (const Row& row : before) pairs[row.key].first = &row;
  for (const Row& row : now) pairs[row.key].second = &row;
  std::string lines;
  for (const auto& [key, pair] : pairs) {
    const auto [was, is] = pair;
    if (was && is && same(*was, *is)) continue;
    if (was) lines += "- " + was->line() + '\n';
    if (is) lines += "+ " + is->line() + '\n';
  }
  return lines;
}

class RecordedPoses : public testing::TestWithParam<std::string> {};

TEST_P(RecordedPoses, AreWhatTheyWere) {
  for (const auto& flight : kFlights) {
    if (shared_flight(flight.name).empty()) GTEST_SKIP() << flight.name << " is not there: set PERCH_SHARED";
  }
  std::vector<Row> now;
  for (const auto& flight : kFlights) {
    const auto rows = estimate(flight, GetParam());
    now.insert(now.end(), rows.begin(), rows.end());
  }
  const auto file =
      std::filesystem::path(PERCH_SOURCE_DIR) / "tests/estimator" / ("recorded_poses_" + GetParam() + ".txt");
  if (std::getenv("PERCH_UPDATE")) write_rows(file, now);
  const std::string lines = difference(read_rows(file), now);
  EXPECT_TRUE(lines.empty()) << lines
                             << "If this is meant: PERCH_UPDATE=1 ctest -R estimator/recorded_poses, "
                             << "and git diff tells what changed.";
}

INSTANTIATE_TEST_SUITE_P(Methods, RecordedPoses, testing::ValuesIn(kMethods),
                         [](const auto& test) { return test.param; });

}  // namespace
}  // namespace perch
