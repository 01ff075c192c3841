#include "perch/flight/aids_file.h"

#include <gmock/gmock.h>

#include <bit>
#include <limits>

#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::IsEmpty;

// Bit for bit, and so that a NaN is itself; signs of zero count.
bool same(double a, double b) {
  return std::bit_cast<uint64_t>(a) == std::bit_cast<uint64_t>(b) || (a != a && b != b);
}
bool same(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return same(a.x(), b.x()) && same(a.y(), b.y()) && same(a.z(), b.z());
}
bool same(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return same(a.w(), b.w()) && same(Eigen::Vector3d(a.vec()), Eigen::Vector3d(b.vec()));
}
bool same(const HeadAngles& a, const HeadAngles& b) {
  return same(a.pan, b.pan) && same(a.tilt, b.tilt) && same(a.pan_sigma, b.pan_sigma) &&
         same(a.tilt_sigma, b.tilt_sigma) && same(a.roll, b.roll);
}
template <typename T>
bool same(const std::optional<T>& a, const std::optional<T>& b) {
  return a.has_value() == b.has_value() && (!a || same(*a, *b));
}
bool same(const AutopilotSample& a, const AutopilotSample& b) {
  return a.timestamp_ns == b.timestamp_ns && same(a.world_from_body, b.world_from_body) &&
         same(a.body_velocity_in_world, b.body_velocity_in_world) &&
         same(a.angular_velocity_in_body, b.angular_velocity_in_body) &&
         same(a.attitude_sigma, b.attitude_sigma) && same(a.velocity_sigma, b.velocity_sigma) &&
         same(a.angular_velocity_sigma, b.angular_velocity_sigma);
}
bool same(const Estimator::Aid& a, const Estimator::Aid& b) {
  if (a.autopilot.size() != b.autopilot.size()) return false;
  for (size_t i = 0; i < a.autopilot.size(); ++i) {
    if (!same(a.autopilot[i], b.autopilot[i])) return false;
  }
  return same(a.angles, b.angles) && same(a.world_from_body, b.world_from_body) && same(a.zoom, b.zoom);
}

// Any double there is: all exponents, both zeros, what is not finite.
double any_number(TestRng& rng) {
  const double value = std::bit_cast<double>(rng.bits());
  return value != value ? std::numeric_limits<double>::quiet_NaN() : value;
}
Eigen::Vector3d any_vector(TestRng& rng) { return {any_number(rng), any_number(rng), any_number(rng)}; }
Eigen::Quaterniond any_quaternion(TestRng& rng) {
  return {any_number(rng), any_number(rng), any_number(rng), any_number(rng)};
}

Estimator::Aid any_aid(TestRng& rng) {
  const auto perhaps = [&] { return rng.bits() % 3 != 0; };
  Estimator::Aid aid;
  if (perhaps())
    aid.angles =
        HeadAngles{any_number(rng), any_number(rng), any_number(rng), any_number(rng), any_number(rng)};
  if (perhaps()) aid.world_from_body = any_quaternion(rng);
  if (perhaps()) aid.zoom = any_number(rng);
  aid.autopilot.resize(rng.bits() % 4);
  for (AutopilotSample& sample : aid.autopilot) {
    sample.timestamp_ns = static_cast<int64_t>(rng.bits());
    if (perhaps()) sample.world_from_body = any_quaternion(rng);
    if (perhaps()) sample.body_velocity_in_world = any_vector(rng);
    if (perhaps()) sample.angular_velocity_in_body = any_vector(rng);
    sample.attitude_sigma = any_number(rng);
    sample.velocity_sigma = any_number(rng);
    sample.angular_velocity_sigma = any_number(rng);
  }
  return aid;
}

TEST(AidsFile, ReadsBackWhatWasGivenBitForBit) {
  TestRng rng;
  std::string csv = aids_header();
  std::vector<FrameAid> frames;
  for (int i = 0; i < 500; ++i) {
    frames.push_back({static_cast<int64_t>(rng.bits()), any_aid(rng)});
    append_aid(frames.back().timestamp_ns, frames.back().aid, csv);
  }
  const TempFolder folder;
  std::vector<std::string> problems;
  const auto read = read_aids(folder.write("aids.csv", csv), problems);
  EXPECT_THAT(problems, IsEmpty());
  ASSERT_EQ(read.size(), frames.size());
  for (size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(read[i].timestamp_ns, frames[i].timestamp_ns);
    EXPECT_TRUE(same(read[i].aid, frames[i].aid)) << i;
  }
}

TEST(AidsFile, EveryRowHasAllColumns) {
  TestRng rng;
  std::string csv = aids_header();
  for (int i = 0; i < 50; ++i) append_aid(i, any_aid(rng), csv);
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);)
    EXPECT_EQ(std::count(line.begin(), line.end(), ','), 21) << line;
}

TEST(AidsFile, CutOffAnywhereItKeepsTheFramesBefore) {
  TestRng rng;
  std::string csv = aids_header();
  std::vector<size_t> ends;
  for (int i = 0; i < 4; ++i) {
    Estimator::Aid aid = any_aid(rng);
    aid.autopilot.resize(2);
    append_aid(i, aid, csv);
    ends.push_back(csv.size());
  }
  const TempFolder folder;
  for (size_t size = aids_header().size(); size < csv.size(); ++size) {
    std::vector<std::string> problems;
    const auto file = folder.write("aids.csv", csv.substr(0, size));
    const auto frames = read_aids(file, problems);
    const auto whole = std::count_if(ends.begin(), ends.end(), [&](size_t end) { return end <= size; });
    ASSERT_EQ(frames.size(), static_cast<size_t>(whole)) << size;
    EXPECT_EQ(problems.size(), csv[size - 1] == '\n' ? 0u : 1u) << size;
  }
}

// A recording of before there was a zoom has one column less.
TEST(AidsFile, ReadsARecordingWithoutAZoom) {
  Estimator::Aid aid;
  aid.angles = HeadAngles{0.1, 0.2};
  aid.zoom = 0.5;
  std::string row, csv = aids_header();
  append_aid(7, aid, row);
  csv.erase(csv.rfind(",zoom []"), 8);
  csv += row.substr(0, row.rfind(',')) + "\n";
  const TempFolder folder;
  std::vector<std::string> problems;
  const auto frames = read_aids(folder.write("aids.csv", csv), problems);
  EXPECT_THAT(problems, IsEmpty());
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_TRUE(same(frames[0].aid.angles, aid.angles));
  EXPECT_FALSE(frames[0].aid.zoom);
}

TEST(AidsFile, ABrokenRowCostsItsFrameOnly) {
  Estimator::Aid aid;
  aid.autopilot.resize(1);
  std::string csv = aids_header();
  append_aid(1, {}, csv);
  const size_t second = csv.size();
  append_aid(2, aid, csv);
  append_aid(3, aid, csv);
  csv.replace(second, 1, "x");
  const TempFolder folder;
  std::vector<std::string> problems;
  const auto frames = read_aids(folder.write("aids.csv", csv), problems);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(frames[1].timestamp_ns, 3);
  EXPECT_EQ(frames[1].aid.autopilot.size(), 1u);
  EXPECT_THAT(
      problems,
      ElementsAre(EndsWith("aids.csv:3: timestamp [ns]: expected a whole number, found \"x\", row skipped"),
                  EndsWith("aids.csv:4: said: expected 0 as rows before it could be used, found \"1\", "
                           "row skipped")));
}

}  // namespace
}  // namespace perch
