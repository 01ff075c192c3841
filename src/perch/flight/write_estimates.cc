#include <cmath>
#include <cstdlib>
#include <string_view>

#include "perch/config/atomic_file.h"
#include "perch/flight/csv_number.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/estimates_names.h"

namespace perch {

namespace {

std::string joined(const std::vector<std::string>& columns) {
  std::string line;
  for (const std::string& column : columns) line += (line.empty() ? "" : ",") + column;
  return line + "\n";
}

void append_microseconds(std::string& csv, double value) {
  csv += ',';
  append_number(csv, value, std::chars_format::fixed, 1);
}

void append_pose(std::string& csv, const Rigid3& pose) {
  const Eigen::Quaterniond q = positive_w(pose.rotation);
  for (const double value : pose.translation) append_field(csv, value);
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) append_field(csv, value);
}

}  // namespace

std::string estimates_header() { return joined(estimate_columns()); }
std::string states_header() { return joined(state_columns()); }

void append_estimate(const Estimate& estimate, std::string& csv) {
  append_number(csv, estimate.timestamp_ns);
  csv += ',';
  csv += name_of(kStatusNames, estimate.status);
  const bool has_pose = estimate.status == EstimateStatus::kOk;
  if (has_pose) {
    append_pose(csv, estimate.camera_from_target.mean);
    const PoseCovariance& covariance = estimate.camera_from_target.covariance;
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) append_field(csv, covariance(row, column));
    }
  } else {
    csv.append(7 + 21, ',');
  }
  // Without a pose these say why there is none, or nothing: a 0 would look like a perfect fit.
  const auto append_measured = [&](double value) {
    has_pose || value != 0 ? append_field(csv, value) : csv.push_back(',');
  };
  append_measured(estimate.reprojection_rms_px);
  csv += ',';
  append_number(csv, estimate.features);
  append_measured(estimate.ambiguity);
  for (const double us : {estimate.detect_us, estimate.pose_us, estimate.total_us})
    append_microseconds(csv, us);
  csv += '\n';
}

void append_state(const VehicleState& state, std::string& csv) {
  append_number(csv, state.timestamp_ns);
  append_pose(csv, state.pad_from_body);
  for (const double value : state.body_velocity_in_pad) append_field(csv, value);
  for (const double value : state.body_angular_velocity_in_pad) append_field(csv, value);
  for (int i = 0; i < 12; ++i) append_field(csv, std::sqrt(state.covariance(i, i)));
  csv += ',';
  csv += name_of(kSourceNames, state.source);
  csv += '\n';
}

void append_tum(int64_t timestamp_ns, const Rigid3& pad_from_body, std::string& tum) {
  // A double of seconds since 1970 is good to 240 ns only.
  const auto [seconds, nanoseconds] = std::lldiv(timestamp_ns, 1'000'000'000);
  if (timestamp_ns < 0) tum += '-';
  append_number(tum, std::llabs(seconds));
  const std::string decimals = std::to_string(std::llabs(nanoseconds));
  tum += '.' + std::string(9 - decimals.size(), '0') + decimals;
  const Eigen::Quaterniond q = positive_w(pad_from_body.rotation);
  const Eigen::Vector3d& p = pad_from_body.translation;
  for (const double value : {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()}) {
    tum += ' ';
    append_number(tum, value);
  }
  tum += '\n';
}

void write_estimates(const std::filesystem::path& file, std::span<const Estimate> estimates) {
  std::string text = estimates_header();
  for (const Estimate& estimate : estimates) append_estimate(estimate, text);
  write_whole_file(file, text);
}

void write_states(const std::filesystem::path& file, std::span<const Estimate> estimates) {
  std::string text = states_header();
  for (const Estimate& estimate : estimates) {
    if (estimate.state) append_state(*estimate.state, text);
  }
  write_whole_file(file, text);
}

void write_pad_from_body(const std::filesystem::path& file, std::span<const Estimate> estimates) {
  std::string text;
  for (const Estimate& estimate : estimates) {
    if (estimate.pad_from_body) append_tum(estimate.timestamp_ns, estimate.pad_from_body->mean, text);
  }
  write_whole_file(file, text);
}

}  // namespace perch
