#include "perch/import/autopilot_log.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "perch/camera/clock_order.h"
#include "perch/import/log_tables.h"
#include "perch/import/navigation_of_log.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

std::vector<uint8_t> read_bytes(const fs::path& file, size_t most) {
  std::ifstream stream(file, std::ios::binary | std::ios::ate);
  std::error_code ignored;
  if (!stream || fs::is_directory(file, ignored))
    throw std::runtime_error(file.string() + ": cannot be read");
  std::vector<uint8_t> bytes(
      std::min(static_cast<size_t>(std::max<std::streamoff>(stream.tellg(), 0)), most));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (!stream) throw std::runtime_error(file.string() + ": cannot be read");
  return bytes;
}

// Those whose times increase: a flipped bit can put a row anywhere.
template <typename Sample>
void put_in_order(std::vector<Sample>& samples, const std::string& what, std::vector<std::string>& problems) {
  std::vector<int64_t> times;
  for (const Sample& sample : samples) times.push_back(sample.timestamp_ns);
  const std::vector<bool> keep = keep_increasing(times);
  size_t kept = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (keep[i] && times[i] >= 0) samples[kept++] = samples[i];
  }
  if (kept < samples.size()) {
    problems.push_back(what + ": the clock goes back or stands still at " +
                       std::to_string(samples.size() - kept) + " of " + std::to_string(samples.size()) +
                       " rows, skipped");
  }
  samples.resize(kept);
}

// One that no vehicle turns with, and NaN.
bool is_wrong(const GyroSample& sample) { return !(sample.angular_velocity_in_body.norm() < 100); }
// Farther than any flight goes: read_nav refuses it, too.
bool is_wrong(const PositionSample& sample) { return !(sample.body_in_world.cwiseAbs().maxCoeff() < 1e8); }

std::string list_of(std::vector<std::string> names) {
  std::sort(names.begin(), names.end());
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "" : ", ") + name;
  return text.empty() ? "none" : text;
}

int64_t median(std::vector<int64_t> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

bool is_autopilot_log(const fs::path& file) {
  const auto bytes = read_bytes(file, 16);
  return is_ulog(bytes) || is_dataflash(bytes);
}

NavTrack join(const std::vector<AttitudeSample>& attitudes, const std::vector<PositionSample>& positions) {
  constexpr auto kMaxGapNs = static_cast<int64_t>(NavTrack::kMaxGap * 1e9);
  std::vector<int64_t> times;
  if (attitudes.size() > positions.size()) {
    for (const auto& sample : attitudes) times.push_back(sample.timestamp_ns);
  } else {
    for (const auto& sample : positions) times.push_back(sample.timestamp_ns);
  }
  NavTrack track;
  size_t a = 0, p = 0;
  for (const int64_t time : times) {
    while (a + 1 < attitudes.size() && attitudes[a + 1].timestamp_ns <= time) ++a;
    while (p + 1 < positions.size() && positions[p + 1].timestamp_ns <= time) ++p;
    // The sample at or after it; the same one at its very time.
    const auto& a0 = attitudes[a];
    const auto& a1 = attitudes[std::min(a + (a0.timestamp_ns < time), attitudes.size() - 1)];
    const auto& p0 = positions[p];
    const auto& p1 = positions[std::min(p + (p0.timestamp_ns < time), positions.size() - 1)];
    if (a0.timestamp_ns > time || a1.timestamp_ns < time || a1.timestamp_ns - a0.timestamp_ns > kMaxGapNs)
      continue;
    if (p0.timestamp_ns > time || p1.timestamp_ns < time || p1.timestamp_ns - p0.timestamp_ns > kMaxGapNs)
      continue;
    NavSample sample;
    sample.timestamp_ns = time;
    const auto part = [&](int64_t begin, int64_t end) {
      return end > begin ? static_cast<double>(time - begin) / static_cast<double>(end - begin) : 0.0;
    };
    sample.world_from_body.rotation =
        positive_w(a0.world_from_body.slerp(part(a0.timestamp_ns, a1.timestamp_ns), a1.world_from_body));
    const double s = part(p0.timestamp_ns, p1.timestamp_ns);
    const double T = static_cast<double>(p1.timestamp_ns - p0.timestamp_ns) * 1e-9;
    const Eigen::Vector3d v0 = *p0.body_velocity_in_world, v1 = *p1.body_velocity_in_world;
    const Eigen::Vector3d way = p1.body_in_world - p0.body_in_world;
    // Hermite's cubic and its slope; velocities linearly where the cubic's would be 0 / 0.
    sample.world_from_body.translation =
        p0.body_in_world + s * s * (3 - 2 * s) * way + T * s * (1 - s) * ((1 - s) * v0 - s * v1);
    sample.body_velocity_in_world = (1 - s) * v0 + s * v1;
    track.samples.push_back(sample);
  }
  return track;
}

namespace {

// The slope of the positions around, where the autopilot told no velocity.
void fill_velocities(std::vector<PositionSample>& positions) {
  for (size_t i = 0; i < positions.size(); ++i) {
    if (positions[i].body_velocity_in_world) continue;
    const auto& before = positions[i > 0 ? i - 1 : i];
    const auto& after = positions[i + 1 < positions.size() ? i + 1 : i];
    const double T = static_cast<double>(after.timestamp_ns - before.timestamp_ns) * 1e-9;
    positions[i].body_velocity_in_world =
        T > 0 ? Eigen::Vector3d((after.body_in_world - before.body_in_world) / T) : Eigen::Vector3d::Zero();
  }
}

}  // namespace

AutopilotLog log_of_motion(const std::string& kind, const std::string& name, LogMotion motion,
                           const std::string& found) {
  AutopilotLog result;
  result.kind = kind;
  result.problems = std::move(motion.problems);
  std::erase_if(motion.positions, [](const auto& sample) { return is_wrong(sample); });
  std::erase_if(motion.gyro, [](const auto& sample) { return is_wrong(sample); });
  put_in_order(motion.attitudes, name + ": " + motion.attitude_from, result.problems);
  put_in_order(motion.positions, name + ": " + motion.position_from, result.problems);
  put_in_order(motion.gyro, name + ": " + motion.gyro_from, result.problems);
  if (motion.attitudes.empty())
    throw std::runtime_error(name + ": no attitude: expected " + motion.attitude_from + ", found " + found);
  if (motion.positions.empty())
    throw std::runtime_error(name + ": no position: expected " + motion.position_from + ", found " + found);
  fill_velocities(motion.positions);
  result.nav = join(motion.attitudes, motion.positions);
  if (result.nav.samples.empty()) {
    throw std::runtime_error(name + ": attitudes and positions have no time in common");
  }
  result.gyro = std::move(motion.gyro);
  result.attitude_from = motion.attitude_from;
  result.position_from = motion.position_from;
  result.gyro_from = result.gyro.empty() ? "" : motion.gyro_from;
  if (!motion.unix_minus_boot_ns.empty()) {
    const int64_t shift = median(std::move(motion.unix_minus_boot_ns));
    result.unix_minus_boot_ns = shift;
    for (auto& sample : result.nav.samples) sample.timestamp_ns += shift;
    for (auto& sample : result.gyro) sample.timestamp_ns += shift;
  }
  return result;
}

AutopilotLog read_autopilot_log(const fs::path& file) {
  const std::string name = file.string();
  const std::vector<uint8_t> bytes = read_bytes(file, std::numeric_limits<size_t>::max());
  if (!is_ulog(bytes) && !is_dataflash(bytes))
    throw std::runtime_error(name + ": neither a PX4 ULog nor an ArduPilot DataFlash log");
  const LogTables tables = is_ulog(bytes) ? parse_ulog(bytes, name, ulog_topics())
                                          : parse_dataflash(bytes, name, dataflash_messages());
  LogMotion motion = is_ulog(bytes) ? motion_of_ulog(tables, name) : motion_of_dataflash(tables);
  motion.problems.insert(motion.problems.begin(), tables.problems.begin(), tables.problems.end());
  return log_of_motion(is_ulog(bytes) ? "PX4 ULog" : "ArduPilot DataFlash", name, std::move(motion),
                       list_of(tables.names));
}

}  // namespace perch
