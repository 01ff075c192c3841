#include "perch/import/video_pictures.h"

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "perch/camera/csv.h"
#include "perch/camera/image_source.h"
#include "perch/camera/video_source.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

struct Unit {
  ColumnName column;
  double ns;
};
constexpr Unit kUnits[] = {
    {"timestamp [ns]", 1}, {"timestamp [us]", 1e3}, {"timestamp [ms]", 1e6}, {"timestamp [s]", 1e9}};

struct TimeColumn {
  size_t number = 0;
  double ns = 1;
};

TimeColumn find_time(const CsvReader& csv) {
  std::string why;
  for (const Unit& unit : kUnits) {
    try {
      return {csv.columns(std::array{unit.column}).front(), unit.ns};
    } catch (const std::runtime_error& e) {
      if (why.empty()) why = e.what();
    }
  }
  throw std::runtime_error(why + "; or [us], [ms], [s]");
}

}  // namespace

void link_file(const fs::path& source, const fs::path& target, bool copy) {
  std::error_code error;
  const fs::path real = fs::canonical(source, error);
  if (!error && copy) fs::copy_file(real, target, error);
  if (!error && !copy) {
    fs::create_hard_link(real, target, error);
    if (error) fs::create_symlink(real, target, error);
  }
  if (error)
    throw std::runtime_error(source.string() + ": cannot become " + target.string() + ": " + error.message());
}

std::vector<int64_t> read_frame_times(const fs::path& file) {
  CsvReader csv(file);
  const TimeColumn time = find_time(csv);
  std::vector<int64_t> times;
  while (csv.next()) {
    const auto fields = csv.fields();
    const auto field = time.number < fields.size() ? fields[time.number] : std::string_view{};
    // Nanoseconds since 1970 do not fit a double; microseconds do.
    if (const auto whole = parse_integer(field); whole && time.ns == 1) {
      times.push_back(*whole);
    } else if (const auto number = parse_finite(field);
               number && time.ns > 1 && std::abs(*number * time.ns) < 9e18) {
      times.push_back(std::llround(*number * time.ns));
    } else {
      throw std::runtime_error(csv.place() + ": timestamp: expected a time, found " + quoted(field) +
                               "; which frames the rows after it are of would not be known");
    }
  }
  if (times.empty()) throw std::runtime_error(file.string() + ": no times");
  return times;
}

std::vector<int64_t> own_frame_times(const fs::path& video) {
  const auto source = open_image_source("video:" + video.string());
  std::vector<int64_t> times;
  for (Frame frame; source->advance(frame);) times.push_back(frame.timestamp_ns);
  if (times.empty()) throw std::runtime_error(video.string() + ": no frame that can be decoded");
  return times;
}

void check_frame_count(const fs::path& video, const fs::path& csv, size_t rows) {
  VideoReader reader(video);
  int64_t count = reader.count();
  if (count == static_cast<int64_t>(rows)) return;
  for (count = 0; reader.seek(count);) ++count;
  if (count == static_cast<int64_t>(rows)) return;
  throw std::runtime_error(csv.string() + ": " + std::to_string(rows) + " times, but " + video.string() +
                           " has " + std::to_string(count) +
                           " frames: which frame a time is of is not known");
}

}  // namespace perch
