#include "perch/camera/picture_source.h"

#include <glob.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <vector>

#include "perch/camera/clock_order.h"
#include "perch/camera/csv.h"
#include "perch/camera/video_source.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

struct Picture {
  int64_t timestamp_ns = 0;
  fs::path file;
  int64_t row = 0;  // of data.csv, from 0, bad ones counted: the number of its frame in data.mkv
};

class PictureSource : public ImageSource {
 public:
  PictureSource(std::vector<Picture> pictures, std::vector<std::string> problems, Channel channel)
      : pictures_(std::move(pictures)), channel_(channel) {
    problems_ = std::move(problems);
  }

  bool advance(Frame& frame) override {
    if (next_ == pictures_.size()) return false;
    const Picture& picture = pictures_[next_++];
    frame = Frame{};
    frame.timestamp_ns = picture.timestamp_ns;
    frame.name = picture.file.filename().string();
    frame.file = picture.file;
    return true;
  }
  void read(Frame& frame) const override { read_picture(frame.file, channel_, frame); }
  int64_t size() const override { return static_cast<int64_t>(pictures_.size()); }

 protected:
  std::vector<Picture> pictures_;
  size_t next_ = 0;
  Channel channel_;
};

class FlightVideoSource : public PictureSource {
 public:
  FlightVideoSource(const fs::path& video, std::vector<Picture> pictures, std::vector<std::string> problems,
                    Channel channel)
      : PictureSource(std::move(pictures), std::move(problems), channel), file_(video), video_(video) {}

  // A video's frames can be decoded in their order only.
  bool advance(Frame& frame) override {
    if (!PictureSource::advance(frame)) return false;
    const int64_t row = pictures_[next_ - 1].row;
    frame.name = file_.filename().string() + "#" + std::to_string(row);
    if (video_.seek(row)) {
      video_.read(channel_, frame);
    } else {
      frame.problem = file_.string() + ": ends before frame " + std::to_string(row);
    }
    return true;
  }
  void read(Frame&) const override {}

 private:
  fs::path file_;
  VideoReader video_;
};

std::vector<Picture> read_rows(const fs::path& cam0, bool video, LastLine last_line,
                               std::vector<std::string>& problems) {
  CsvReader csv(cam0 / "data.csv", last_line);
  csv.columns(std::array<ColumnName, 1>{"timestamp [ns]"});  // refuses times in other units
  std::vector<Picture> pictures;
  std::vector<std::string> places;
  for (int64_t row = 0; csv.next(); ++row) {
    const auto fields = csv.fields();
    const auto time = parse_integer(fields[0]);
    if (!time) {
      problems.push_back(csv.place() + ": timestamp: expected whole nanoseconds, found " + quoted(fields[0]) +
                         ", row skipped");
    } else if (!video && (fields.size() < 2 || fields[1].empty())) {
      problems.push_back(csv.place() + ": filename: found none, row skipped");
    } else {
      pictures.push_back({*time, fields.size() < 2 ? "" : cam0 / "data" / fields[1], row});
      places.push_back(csv.place());
    }
  }
  csv.note_torn(problems);
  if (pictures.empty() && problems.empty()) problems.push_back((cam0 / "data.csv").string() + ": no rows");
  return in_time_order(std::move(pictures), places, problems);
}

std::vector<fs::path> matching_files(const std::string& pattern) {
  glob_t matches{};
  const int error = glob(pattern.c_str(), GLOB_TILDE | GLOB_NOSORT, nullptr, &matches);
  std::vector<fs::path> files;
  for (size_t i = 0; error == 0 && i < matches.gl_pathc; ++i) files.emplace_back(matches.gl_pathv[i]);
  globfree(&matches);
  std::error_code ignored;
  std::erase_if(files, [&](const fs::path& file) { return fs::is_directory(file, ignored); });
  return files;
}

// The time in a name of 10 digits or more: seconds since 1970 have 10, ns 19; frame numbers have fewer.
std::optional<int64_t> time_in_name(const fs::path& file) {
  const std::string stem = file.stem().string();
  if (stem.size() < 10 ||
      !std::all_of(stem.begin(), stem.end(), [](unsigned char c) { return std::isdigit(c); })) {
    return std::nullopt;
  }
  return parse_integer(stem);
}

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    while (i + 1 < a.size() && a[i] == '0' && is_digit(a[i + 1])) ++i;
    while (j + 1 < b.size() && b[j] == '0' && is_digit(b[j + 1])) ++j;
    size_t end_a = i, end_b = j;
    while (end_a < a.size() && is_digit(a[end_a])) ++end_a;
    while (end_b < b.size() && is_digit(b[end_b])) ++end_b;
    if (end_a - i != end_b - j) return end_a - i < end_b - j;
    if (const int order = a.compare(i, end_a - i, b, j, end_b - j); order != 0) return order < 0;
    i = end_a, j = end_b;
  }
  if (i < a.size() || j < b.size()) return i == a.size();
  return a < b;  // 01 and 1: any order, but always the same
}

std::unique_ptr<ImageSource> open_flight_pictures(const fs::path& folder, Channel channel) {
  const fs::path cam0 = folder / "mav0" / "cam0";
  std::error_code ignored;
  if (!fs::exists(cam0 / "data.csv", ignored)) {
    throw std::runtime_error(folder.string() + ": no flight: expected mav0/cam0/data.csv in it");
  }
  const fs::path video = cam0 / "data.mkv";
  const bool has_video = !fs::is_directory(cam0 / "data", ignored) && fs::exists(video, ignored);
  std::vector<std::string> problems;
  // A live run appends its rows as it goes.
  const LastLine last_line = fs::exists(folder / "run", ignored) ? LastLine::kMustEnd : LastLine::kMayLackEnd;
  std::vector<Picture> pictures = read_rows(cam0, has_video, last_line, problems);
  if (has_video) {
    return std::make_unique<FlightVideoSource>(video, std::move(pictures), std::move(problems), channel);
  }
  return std::make_unique<PictureSource>(std::move(pictures), std::move(problems), channel);
}

std::unique_ptr<ImageSource> open_pictures(const std::string& pattern, Channel channel) {
  std::vector<fs::path> files = matching_files(pattern);
  if (files.empty()) throw std::runtime_error("images:" + pattern + ": no file matches");
  std::sort(files.begin(), files.end(),
            [](const fs::path& a, const fs::path& b) { return natural_less(a.string(), b.string()); });
  std::vector<Picture> pictures;
  std::vector<int64_t> times;
  for (const fs::path& file : files) {
    const auto number = static_cast<int64_t>(pictures.size());
    pictures.push_back({number * kNominalPeriodNs, file, number});
    if (const auto time = time_in_name(file)) times.push_back(*time);
  }
  // Files of several folders may come in another order than their times.
  std::sort(times.begin(), times.end());
  const bool all_times =
      times.size() == files.size() && std::adjacent_find(times.begin(), times.end()) == times.end();
  if (all_times) {
    for (Picture& picture : pictures) picture.timestamp_ns = *time_in_name(picture.file);
    std::sort(pictures.begin(), pictures.end(),
              [](const Picture& a, const Picture& b) { return a.timestamp_ns < b.timestamp_ns; });
  }
  return std::make_unique<PictureSource>(std::move(pictures), std::vector<std::string>{}, channel);
}

}  // namespace perch
