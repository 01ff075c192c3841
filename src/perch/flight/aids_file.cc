#include "perch/flight/aids_file.h"

#include <array>
#include <stdexcept>

#include "perch/camera/csv.h"
#include "perch/flight/csv_number.h"

namespace perch {
namespace {

constexpr std::string_view kFrame = "frame", kAutopilot = "autopilot";

// A number of each row that is not there is an empty field. Not finite ones are numbers, too: the estimator
// was given them.
constexpr std::array<ColumnName, 22> kColumns{"timestamp [ns]",
                                              "kind",
                                              "said",
                                              "q_w",
                                              "q_x",
                                              "q_y",
                                              "q_z",
                                              "v_x [m/s]",
                                              "v_y [m/s]",
                                              "v_z [m/s]",
                                              "w_x [rad/s]",
                                              "w_y [rad/s]",
                                              "w_z [rad/s]",
                                              "attitude_sigma [rad]",
                                              "velocity_sigma [m/s]",
                                              "angular_velocity_sigma [rad/s]",
                                              "pan [rad]",
                                              "tilt [rad]",
                                              "pan_sigma [rad]",
                                              "tilt_sigma [rad]",
                                              "roll [rad]",
                                              "zoom []"};
constexpr size_t kTime = 0, kKind = 1, kSaid = 2, kAttitude = 3, kVelocity = 7, kAngularVelocity = 10,
                 kSigmas = 13, kHead = 16, kZoom = 21;

// As they are: the sign of a quaternion, which is no matter to a rotation, may be one to a rounding.
void append_quaternion(const std::optional<Eigen::Quaterniond>& q, std::string& csv) {
  if (!q) return csv.append(4, ','), void();
  for (const double value : {q->w(), q->x(), q->y(), q->z()}) append_field(csv, value);
}

void append_vector(const std::optional<Eigen::Vector3d>& v, std::string& csv) {
  if (!v) return csv.append(3, ','), void();
  for (const double value : *v) append_field(csv, value);
}

void append_sample(const AutopilotSample& sample, std::string& csv) {
  append_number(csv, sample.timestamp_ns);
  csv += ',';
  csv += kAutopilot;
  csv += ',';
  append_quaternion(sample.world_from_body, csv);
  append_vector(sample.body_velocity_in_world, csv);
  append_vector(sample.angular_velocity_in_body, csv);
  for (const double sigma : {sample.attitude_sigma, sample.velocity_sigma, sample.angular_velocity_sigma}) {
    append_field(csv, sigma);
  }
  csv += ",,,,,,\n";
}

class AidRow {
 public:
  AidRow(const CsvReader& csv, const std::vector<size_t>& columns)
      : fields_(csv.fields()), columns_(columns) {}

  std::string_view text(size_t column) const {
    return column < columns_.size() && columns_[column] < fields_.size() ? fields_[columns_[column]]
                                                                         : std::string_view{};
  }
  int64_t integer(size_t column) const {
    const auto value = parse_integer(text(column));
    if (!value) fail(column, "a whole number");
    return *value;
  }
  double number(size_t column) const {
    const auto value = parse_double(text(column));
    if (!value) fail(column, "a number");
    return *value;
  }
  std::optional<Eigen::Quaterniond> quaternion(size_t column) const {
    if (text(column).empty()) return std::nullopt;
    return Eigen::Quaterniond(number(column), number(column + 1), number(column + 2), number(column + 3));
  }
  std::optional<Eigen::Vector3d> vector(size_t column) const {
    if (text(column).empty()) return std::nullopt;
    return Eigen::Vector3d(number(column), number(column + 1), number(column + 2));
  }
  [[noreturn]] void fail(size_t column, const std::string& expected) const {
    throw std::runtime_error(std::string(kColumns[column]) + ": expected " + expected + ", found " +
                             quoted(text(column)) + ", row skipped");
  }

 private:
  std::span<const std::string_view> fields_;
  const std::vector<size_t>& columns_;
};

AutopilotSample sample_of(const AidRow& row) {
  AutopilotSample sample;
  sample.timestamp_ns = row.integer(kTime);
  sample.world_from_body = row.quaternion(kAttitude);
  sample.body_velocity_in_world = row.vector(kVelocity);
  sample.angular_velocity_in_body = row.vector(kAngularVelocity);
  sample.attitude_sigma = row.number(kSigmas);
  sample.velocity_sigma = row.number(kSigmas + 1);
  sample.angular_velocity_sigma = row.number(kSigmas + 2);
  return sample;
}

// The frame's own row, after those of the samples.
FrameAid frame_of(const AidRow& row, std::vector<AutopilotSample>& said) {
  FrameAid frame;
  frame.timestamp_ns = row.integer(kTime);
  if (row.integer(kSaid) != static_cast<int64_t>(said.size())) {
    row.fail(kSaid, std::to_string(said.size()) + " as rows before it could be used");
  }
  frame.aid.world_from_body = row.quaternion(kAttitude);
  if (!row.text(kHead).empty())
    frame.aid.angles = HeadAngles{row.number(kHead), row.number(kHead + 1), row.number(kHead + 2),
                                  row.number(kHead + 3), row.number(kHead + 4)};
  if (!row.text(kZoom).empty()) frame.aid.zoom = row.number(kZoom);
  frame.aid.autopilot = std::move(said);
  return frame;
}

}  // namespace

std::string aids_header() {
  std::string header = "#";
  for (const ColumnName& name : kColumns) {
    if (header.size() > 1) header += ',';
    header += name;
  }
  return header + "\n";
}

void append_aid(int64_t frame_timestamp_ns, const Estimator::Aid& aid, std::string& csv) {
  for (const AutopilotSample& sample : aid.autopilot) append_sample(sample, csv);
  append_number(csv, frame_timestamp_ns);
  csv += ',';
  csv += kFrame;
  csv += ',';
  append_number(csv, aid.autopilot.size());
  append_quaternion(aid.world_from_body, csv);
  csv.append(3 + 3 + 3, ',');
  if (aid.angles) {
    const HeadAngles& a = *aid.angles;
    for (const double value : {a.pan, a.tilt, a.pan_sigma, a.tilt_sigma, a.roll}) append_field(csv, value);
  } else {
    csv.append(5, ',');
  }
  csv += ',';
  if (aid.zoom) append_number(csv, *aid.zoom);
  csv += '\n';
}

std::vector<FrameAid> read_aids(const std::filesystem::path& file, std::vector<std::string>& problems) {
  CsvReader csv(file, LastLine::kMustEnd);
  // The first recordings knew no zoom.
  const size_t count = kColumns.size() - (csv.has_column(kColumns[kZoom]) ? 0 : 1);
  const std::vector<size_t> columns = csv.columns(std::span(kColumns).first(count));
  std::vector<FrameAid> frames;
  std::vector<AutopilotSample> said;
  while (csv.next()) {
    const AidRow row(csv, columns);
    try {
      if (row.text(kKind) == kAutopilot) {
        said.push_back(sample_of(row));
      } else if (row.text(kKind) == kFrame) {
        frames.push_back(frame_of(row, said));
        said.clear();
      } else {
        row.fail(kKind, "frame or autopilot");
      }
    } catch (const std::runtime_error& e) {
      problems.push_back(csv.place() + ": " + e.what());
      if (row.text(kKind) == kFrame) said.clear();
    }
  }
  csv.note_torn(problems);
  return frames;
}

}  // namespace perch
