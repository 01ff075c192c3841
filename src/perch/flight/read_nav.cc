#include "perch/flight/read_nav.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "perch/camera/clock_order.h"
#include "perch/camera/csv.h"

namespace perch {

namespace {

constexpr std::array<ColumnName, 11> kNavColumns{
    "timestamp [ns]", "p_x [m]",   "p_y [m]",  "p_z [m]", "q_w", "q_x", "q_y", "q_z",
    "v_x [m/s]",      "v_y [m/s]", "v_z [m/s]"};
constexpr std::array<ColumnName, 11> kEurocColumns{
    "timestamp [ns]",    "p_RS_R_x [m]",      "p_RS_R_y [m]",     "p_RS_R_z [m]",
    "q_RS_w []",         "q_RS_x []",         "q_RS_y []",        "q_RS_z []",
    "v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]"};
constexpr std::array<ColumnName, 4> kGimbalColumns{"timestamp [ns]", "pan [rad]", "tilt [rad]", "zoom []"};

// A position beyond is none: the earth's own radius, of an earth-centred world, is 6.4e6 m. One such row
// would be all that a flight's errors show.
constexpr double kMostNumber = 1e8;

constexpr size_t kPoseColumns = 8;  // the velocities, which may be missing, come after them
// The attitude, which may be missing as a whole, comes after these.
constexpr size_t kPositionColumns = 4;

bool is_blank(const CsvReader& csv, std::span<const size_t> columns) {
  const auto fields = csv.fields();
  return std::ranges::all_of(columns, [&](size_t c) { return c < fields.size() && fields[c].empty(); });
}

// The row's time and numbers (NaN where there is none from `required` on), or why it has none.
std::string read_row(const CsvReader& csv, std::span<const ColumnName> names, std::span<const size_t> columns,
                     size_t required, int64_t& time, std::span<double> numbers) {
  const auto fields = csv.fields();
  const auto field = [&](size_t i) {
    return columns[i] < fields.size() ? fields[columns[i]] : std::string_view{};
  };
  const auto found = [&](size_t i) { return ", found " + quoted(field(i)) + ", row skipped"; };
  const auto integer = parse_integer(field(0));
  if (!integer) return "timestamp: expected whole nanoseconds" + found(0);
  time = *integer;
  for (size_t i = 1; i < columns.size(); ++i) {
    const auto number = parse_finite(field(i));
    if (!number && i < required) return std::string(names[i]) + ": expected a number" + found(i);
    if (number && std::abs(*number) > kMostNumber && i < required) {
      return std::string(names[i]) + ": expected a number within 1e8" + found(i);
    }
    numbers[i - 1] = number.value_or(std::numeric_limits<double>::quiet_NaN());
  }
  return "";
}

// Fills velocities that the file has not: the slope of the positions around.
size_t fill_velocities(std::vector<NavSample>& samples) {
  size_t filled = 0;
  for (size_t i = 0; i < samples.size(); ++i) {
    if (samples[i].body_velocity_in_world.allFinite()) continue;
    ++filled;
    const NavSample& before = samples[i > 0 ? i - 1 : i];
    const NavSample& after = samples[i + 1 < samples.size() ? i + 1 : i];
    const double dt =
        (static_cast<double>(after.timestamp_ns) - static_cast<double>(before.timestamp_ns)) * 1e-9;
    if (dt > 0) {
      samples[i].body_velocity_in_world =
          (after.world_from_body.translation - before.world_from_body.translation) / dt;
    } else {
      samples[i].body_velocity_in_world.setZero();
    }
  }
  return filled;
}

}  // namespace

NavTrack read_nav(const std::filesystem::path& file, std::vector<std::string>& problems, LastLine last_line) {
  CsvReader csv(file, last_line);
  const bool euroc = csv.has_column(kEurocColumns[1]);
  std::span<const ColumnName> names = euroc ? kEurocColumns : kNavColumns;
  const bool has_header = csv.has_column(names[1]);
  if (has_header && !csv.has_column(names[kPoseColumns])) names = names.first(kPoseColumns);
  const std::vector<size_t> columns = csv.columns(names);

  std::vector<NavSample> samples;
  std::vector<std::string> places;
  while (csv.next()) {
    NavSample sample;
    std::array<double, 10> n;
    n.fill(std::numeric_limits<double>::quiet_NaN());
    const bool no_attitude =
        is_blank(csv, std::span(columns).subspan(kPositionColumns, kPoseColumns - kPositionColumns));
    const std::string problem =
        read_row(csv, names, columns, no_attitude ? kPositionColumns : kPoseColumns, sample.timestamp_ns, n);
    if (!problem.empty()) {
      problems.push_back(csv.place() + ": " + problem);
      continue;
    }
    const Eigen::Quaterniond rotation(n[3], n[4], n[5], n[6]);
    if (!no_attitude && !(rotation.norm() > 1e-3 && rotation.norm() < 1e3)) {
      problems.push_back(csv.place() +
                         ": q_w q_x q_y q_z: expected a rotation, found a quaternion of length " +
                         std::to_string(rotation.norm()) + ", row skipped");
      continue;
    }
    sample.world_from_body = {positive_w(rotation.normalized()), {n[0], n[1], n[2]}};
    sample.body_velocity_in_world = {n[7], n[8], n[9]};
    samples.push_back(sample);
    places.push_back(csv.place());
  }
  csv.note_torn(problems);
  if (const auto without =
          std::ranges::count_if(samples, [](const NavSample& s) { return !s.knows_attitude(); })) {
    problems.push_back(file.string() + ": " + std::to_string(without) +
                       " rows without an attitude, of use for positions alone");
  }
  NavTrack track{in_time_order(std::move(samples), places, problems)};
  if (const size_t filled = fill_velocities(track.samples)) {
    problems.push_back(file.string() + ": " + std::to_string(filled) +
                       " rows without a velocity, taken from the positions");
  }
  return track;
}

std::vector<GimbalSample> read_gimbal(const std::filesystem::path& file, std::vector<std::string>& problems,
                                      LastLine last_line) {
  CsvReader csv(file, last_line);
  const std::vector<size_t> columns = csv.columns(kGimbalColumns);
  std::vector<GimbalSample> samples;
  std::vector<std::string> places;
  while (csv.next()) {
    GimbalSample sample;
    std::array<double, 3> n{};
    constexpr size_t kRequired = 3;  // not all heads tell a zoom
    const std::string problem = read_row(csv, kGimbalColumns, columns, kRequired, sample.timestamp_ns, n);
    if (!problem.empty()) {
      problems.push_back(csv.place() + ": " + problem);
      continue;
    }
    sample.pan = n[0], sample.tilt = n[1];
    if (std::isfinite(n[2])) sample.zoom = n[2];
    samples.push_back(sample);
    places.push_back(csv.place());
  }
  csv.note_torn(problems);
  return in_time_order(std::move(samples), places, problems);
}

}  // namespace perch
