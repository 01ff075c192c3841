#include <optional>
#include <span>
#include <stdexcept>
#include <string_view>

#include "perch/camera/csv.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/estimates_names.h"

namespace perch {

namespace {

// Reads the row's fields one after the other, in the order of the columns.
class Row {
 public:
  Row(const CsvReader& csv, const std::vector<std::string>& names, const std::vector<size_t>& columns)
      : fields_(csv.fields()), names_(names), columns_(columns) {}

  std::string_view text() {
    const size_t column = columns_[next_++];
    return column < fields_.size() ? fields_[column] : std::string_view{};
  }
  int64_t integer() { return checked(parse_integer(text()), "a whole number"); }
  double number() { return checked(parse_double(text()), "a number"); }
  double number_or_zero() { return empty() ? (++next_, 0.0) : number(); }
  template <typename Enum, size_t n>
  Enum choice(const std::pair<Enum, std::string_view> (&names)[n]) {
    return checked(value_of(names, text()), "one of the names of docs/FORMATS.md");
  }
  Rigid3 pose() {
    Rigid3 pose;
    for (double& value : pose.translation) value = number();
    pose.rotation.w() = number();
    for (double& value : pose.rotation.vec()) value = number();
    return pose;
  }
  void skip(size_t count) { next_ += count; }

 private:
  bool empty() const { return columns_[next_] >= fields_.size() || fields_[columns_[next_]].empty(); }
  template <typename T>
  T checked(std::optional<T> value, const char* expected) {
    if (value) return *value;
    const std::string& name = names_[--next_];
    throw std::runtime_error(name + ": expected " + expected + ", found " + quoted(text()) + ", row skipped");
  }

  std::span<const std::string_view> fields_;
  const std::vector<std::string>& names_;
  const std::vector<size_t>& columns_;
  size_t next_ = 0;
};

template <typename Result, typename ReadRow>
std::vector<Result> read_table(const std::filesystem::path& file, const std::vector<std::string>& names,
                               std::vector<std::string>& problems, LastLine last_line, ReadRow read_row) {
  CsvReader csv(file, last_line);
  const std::vector<size_t> columns = csv.columns(std::vector<ColumnName>(names.begin(), names.end()));
  std::vector<Result> results;
  while (csv.next()) {
    try {
      Row row(csv, names, columns);
      results.push_back(read_row(row));
    } catch (const std::runtime_error& e) {
      problems.push_back(csv.place() + ": " + e.what());
    }
  }
  csv.note_torn(problems);
  return results;
}

Estimate read_estimate(Row& row) {
  Estimate estimate;
  estimate.timestamp_ns = row.integer();
  estimate.status = row.choice(kStatusNames);
  if (estimate.status == EstimateStatus::kOk) {
    estimate.camera_from_target.mean = row.pose();
    PoseCovariance& covariance = estimate.camera_from_target.covariance;
    for (int i = 0; i < 6; ++i) {
      for (int j = i; j < 6; ++j) covariance(i, j) = covariance(j, i) = row.number();
    }
  } else {
    row.skip(7 + 21);
  }
  estimate.reprojection_rms_px = row.number_or_zero();
  estimate.features = static_cast<int>(row.integer());
  estimate.ambiguity = row.number_or_zero();
  estimate.detect_us = row.number();
  estimate.pose_us = row.number();
  estimate.total_us = row.number();
  return estimate;
}

VehicleState read_state(Row& row) {
  VehicleState state;
  state.timestamp_ns = row.integer();
  state.pad_from_body = row.pose();
  for (double& value : state.body_velocity_in_pad) value = row.number();
  for (double& value : state.body_angular_velocity_in_pad) value = row.number();
  for (int i = 0; i < 12; ++i) {
    const double sigma = row.number();
    state.covariance(i, i) = sigma * sigma;
  }
  state.source = row.choice(kSourceNames);
  return state;
}

}  // namespace

std::vector<Estimate> read_estimates(const std::filesystem::path& file, std::vector<std::string>& problems,
                                     LastLine last_line) {
  return read_table<Estimate>(file, estimate_columns(), problems, last_line, read_estimate);
}

std::vector<VehicleState> read_states(const std::filesystem::path& file, std::vector<std::string>& problems,
                                      LastLine last_line) {
  return read_table<VehicleState>(file, state_columns(), problems, last_line, read_state);
}

}  // namespace perch
