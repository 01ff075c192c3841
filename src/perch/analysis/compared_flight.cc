#include "perch/analysis/compared_flight.h"

#include <algorithm>
#include <array>
#include <optional>
#include <unordered_map>

#include "perch/camera/csv.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

struct Error {
  double position = 0, over_range = 0, angles = 0;  // squares
};

struct RunFrame {
  int64_t timestamp_ns = 0;
  bool ok = false;
  double us = 0;
  std::optional<Error> error;
};

std::unordered_map<int64_t, Error> read_errors(const fs::path& file) {
  CsvReader csv(file);
  const auto columns = csv.columns(std::array<ColumnName, 8>{
      "timestamp [ns]", "x [m]", "y [m]", "z [m]", "yaw [rad]", "pitch [rad]", "roll [rad]", "range [m]"});
  std::unordered_map<int64_t, Error> errors;
  while (csv.next()) {
    const auto fields = csv.fields();
    // A number that is missing is no error of zero: such a frame is not compared.
    std::array<double, 8> squares{};
    const auto time = columns[0] < fields.size() ? parse_integer(fields[columns[0]]) : std::nullopt;
    bool whole = time.has_value();
    for (size_t i = 1; i < columns.size() && whole; ++i) {
      const auto value = columns[i] < fields.size() ? parse_finite(fields[columns[i]]) : std::nullopt;
      whole = value.has_value();
      if (whole) squares[i] = *value * *value;
    }
    if (!whole) continue;
    const double position = squares[1] + squares[2] + squares[3], range = squares[7];
    errors.try_emplace(
        *time, Error{position, range > 0 ? position / range : 0, squares[4] + squares[5] + squares[6]});
  }
  return errors;
}

std::vector<RunFrame> read_frames(const fs::path& folder) {
  const auto errors = read_errors(folder / "errors.csv");
  CsvReader csv(folder / "estimates.csv");
  const auto columns = csv.columns(std::array<ColumnName, 3>{"timestamp [ns]", "status", "total [us]"});
  std::vector<RunFrame> frames;
  while (csv.next()) {
    const auto fields = csv.fields();
    if (std::ranges::any_of(columns, [&](size_t column) { return column >= fields.size(); })) continue;
    const auto time = parse_integer(fields[columns[0]]);
    if (!time) continue;
    const auto error = errors.find(*time);
    frames.push_back({*time, fields[columns[1]] == "ok", parse_finite(fields[columns[2]]).value_or(0),
                      error == errors.end() ? std::nullopt : std::optional(error->second)});
  }
  return frames;
}

void add(const RunFrame& a, const RunFrame& b, ComparedFrames& sum) {
  ++sum.frames;
  const bool both = a.error && b.error;
  sum.both += both;
  const std::array<const RunFrame*, 2> frames = {&a, &b};
  for (size_t i = 0; i < 2; ++i) {
    sum.ok[i] += frames[i]->ok;
    sum.us[i] += frames[i]->us;
    if (!both) continue;
    sum.position[i] += frames[i]->error->position;
    sum.over_range[i] += frames[i]->error->over_range;
    sum.angles[i] += frames[i]->error->angles;
  }
}

}  // namespace

std::vector<ComparedFrames> compare_flight(const fs::path& a, const fs::path& b) {
  constexpr double kSampleNs = 1e9;
  const std::vector<RunFrame> ours = read_frames(b);
  std::unordered_map<int64_t, RunFrame> theirs;
  for (const RunFrame& frame : read_frames(a)) theirs.emplace(frame.timestamp_ns, frame);
  std::vector<ComparedFrames> samples;
  double sample_start = 0;
  for (const RunFrame& frame : ours) {
    const auto found = theirs.find(frame.timestamp_ns);
    if (found == theirs.end()) continue;
    const auto time = static_cast<double>(frame.timestamp_ns);
    // Also where a clock went back.
    if (samples.empty() || !(time >= sample_start && time < sample_start + kSampleNs)) {
      samples.emplace_back();
      sample_start = time;
    }
    add(found->second, frame, samples.back());
  }
  return samples;
}

}  // namespace perch
