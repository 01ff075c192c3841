// perch-import: makes a flight that perch-batch runs of what other programs recorded.

#include <gflags/gflags.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>

#include "import_folder.h"
#include "perch/camera/csv.h"
#include "perch/config/atomic_file.h"
#include "perch/estimator/run_config.h"
#include "perch/flight/flight.h"
#include "perch/geometry/euler.h"
#include "perch/import/autopilot_log.h"
#include "perch/import/ros_bag.h"
#include "perch/import/time_alignment.h"
#include "perch/import/video_pictures.h"
#include "program.h"
#include "progress.h"

DEFINE_string(output, "", "the folder that the flight is written into; it must not be there");
DEFINE_string(times, "", "when each frame of the video was taken: a CSV file, a row a frame");
DEFINE_string(camera, "", "the camera's model, as perch-calibrate-camera, ROS or OpenCV write it");
DEFINE_string(
    config, "",
    "a configuration as perch-batch takes it: with its target a video is aligned with a log better than "
    "without");
DEFINE_string(set, "", "key.path=value: overrides the configuration; may be given several times");
DEFINE_string(offset, "", "the pictures' clock minus the log's, s; without: found by how both turn");
DEFINE_string(topic, "",
              "of a bag: a topic to take where it has more of that kind; may be given several times");
DEFINE_bool(copy, false,
            "videos and pictures are copied; without: hard links, or symbolic ones to another disk");

namespace perch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr char kDescription[] =
    R"(Makes a flight (an ASL folder) that perch-batch runs of what others recorded. INPUT, told apart by content:
  a video                          its frames, at --times or at the times of the file itself
  a flight                         its pictures and its camera
  a ROS 1 bag                      its pictures, camera_info and poses; beside a video its poses and IMU
  a PX4 ULog, a DataFlash .bin     position, attitude and velocity for the pictures beside it
Pictures and a log have clocks of their own: the offset is found by correlating how the camera turned with how
the vehicle did, unless --offset says it; navigation is then written on the pictures' clock.)";

std::atomic<bool> stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler may only touch lock-free atomics");

// What the pictures and navigation come from; each at most once.
struct Inputs {
  fs::path video, flight, log, bag;

  // The one whose pictures are taken: a bag's where there is no other. Empty: none.
  const fs::path& pictures() const { return !video.empty() ? video : !flight.empty() ? flight : bag; }
};

Inputs sort_inputs(const std::vector<std::string>& arguments) {
  Inputs inputs;
  const auto take = [](fs::path& place, const fs::path& input, const char* what) {
    if (!place.empty()) throw UsageError(input.string() + ": a second " + what + " beside " + place.string());
    place = input;
  };
  for (const fs::path input : arguments) {
    if (!fs::exists(input)) throw UsageError(input.string() + ": no such file");
    if (fs::is_directory(input)) {
      if (!fs::exists(input / "mav0/cam0/data.csv"))
        throw UsageError(input.string() + ": no flight: expected mav0/cam0/data.csv in it");
      take(inputs.flight, input, "flight");
    } else if (is_autopilot_log(input)) {
      take(inputs.log, input, "log");
    } else if (is_ros_bag(input)) {
      take(inputs.bag, input, "bag");
    } else {
      take(inputs.video, input, "video (or file of no known kind)");
    }
  }
  if (inputs.pictures().empty()) throw UsageError("expected a video, a bag or a flight, which have pictures");
  if (!inputs.video.empty() && !inputs.flight.empty())
    throw UsageError("expected pictures from one of " + inputs.video.string() + " and " +
                     inputs.flight.string());
  if (!FLAGS_times.empty() && inputs.video.empty())
    throw UsageError("--times: expected a video that they are of");
  if (!inputs.log.empty() && !inputs.bag.empty() && inputs.pictures() != inputs.bag)
    throw UsageError("expected navigation from one of " + inputs.log.string() + " and " +
                     inputs.bag.string());
  if (!FLAGS_topic.empty() && inputs.bag.empty()) throw UsageError("--topic: expected a bag that it is of");
  const bool two_clocks = !inputs.log.empty() || (!inputs.bag.empty() && inputs.pictures() != inputs.bag);
  if (!FLAGS_offset.empty() && !two_clocks)
    throw UsageError("--offset: expected pictures and navigation from two inputs");
  return inputs;
}

void note(const std::vector<std::string>& problems, json& facts) {
  for (const auto& problem : problems) {
    std::cerr << "perch-import: " << problem << '\n';
    facts["problems"].push_back(problem);
  }
}

void stop_if_asked() {
  if (stop_requested) throw std::runtime_error("interrupted; nothing is kept");
}

void import_pictures(const Inputs& inputs, const RosBag* bag, const ImportFolder& folder, json& facts) {
  if (inputs.pictures() == inputs.bag) {
    std::vector<std::string> problems;
    Progress progress;
    bag->write_pictures(folder.cam0(), problems, [&](double part) {
      stop_if_asked();
      progress.at(part, "pictures");
    });
    note(problems, facts);
  } else if (!inputs.flight.empty()) {
    folder.link_pictures(inputs.flight, FLAGS_copy);
  } else if (FLAGS_times.empty()) {
    folder.link_video(inputs.video, own_frame_times(inputs.video), FLAGS_copy);
  } else {
    const auto times = read_frame_times(FLAGS_times);
    check_frame_count(inputs.video, FLAGS_times, times.size());
    folder.link_video(inputs.video, times, FLAGS_copy);
  }
  if (!FLAGS_camera.empty()) folder.write_camera(FLAGS_camera);
}

std::optional<RunConfig> read_config(const CommandLine& line) {
  if (FLAGS_config.empty()) return std::nullopt;
  RunConfig config = read_run_config(Section::load(FLAGS_config, line.all("set")));
  if (config.frames.pan_tilt && FLAGS_offset.empty())
    throw ConfigError(FLAGS_config +
                      ": frames.base_from_camera: expected a fixed camera, as one that turns by "
                      "itself does not turn as the vehicle does; or --offset");
  return config;
}

struct Offset {
  int64_t ns = 0;
  std::optional<TimeAlignment> found;
};

Offset find_offset(const ImportFolder& folder, const fs::path& input, const AutopilotLog& log,
                   const std::optional<RunConfig>& config) {
  if (!FLAGS_offset.empty()) {
    const auto seconds = parse_finite(FLAGS_offset);
    if (!seconds || std::abs(*seconds) > 4e9)
      throw UsageError("--offset: expected seconds, found \"" + FLAGS_offset + '"');
    return {std::llround(*seconds * 1e9), {}};
  }
  std::optional<CameraModel> camera = read_flight(folder.path()).camera;
  if (config && !config->camera_model.empty()) camera = read_camera_model(config->camera_model);
  if (!camera) {
    throw UsageError(input.string() +
                     ": no camera model, without which pictures do not tell how the camera turned: "
                     "expected --camera, or --offset");
  }
  const auto pictures =
      open_image_source("flight:" + folder.path().string(), config ? config->channel : Channel::kGrey);
  Progress progress;
  int64_t done = 0;
  const auto turns = camera_turns(*pictures, *camera, config ? &*config : nullptr, [&] {
    stop_if_asked();
    progress.at(static_cast<double>(++done) / static_cast<double>(std::max<int64_t>(1, pictures->size())),
                "aligning");
  });
  try {
    const TimeAlignment found = align_times(turns, log.gyro.empty() ? angular_velocities(log.nav) : log.gyro);
    return {found.offset_ns, found};
  } catch (const AlignmentError& e) {
    throw std::runtime_error(input.string() + ": " + e.what() + "; --offset says it, if you know it");
  }
}

// Navigation that has nothing to do with the pictures scores nothing, and perch-batch would only say so
// later.
void check_overlap(const ImportFolder& folder, const NavTrack& nav, int64_t offset_ns) {
  const double first = static_cast<double>(nav.samples.front().timestamp_ns + offset_ns) * 1e-9;
  const double last = static_cast<double>(nav.samples.back().timestamp_ns + offset_ns) * 1e-9;
  CsvReader csv(folder.cam0() / "data.csv");
  double begin = 0, end = 0;
  size_t rows = 0;
  while (csv.next()) {
    const auto time = parse_integer(csv.fields()[0]);
    if (!time) continue;
    end = static_cast<double>(*time) * 1e-9;
    if (rows++ == 0) begin = end;
    if (end >= first && end <= last) return;
  }
  char text[256];
  std::snprintf(text, sizeof text,
                "no time in common: pictures from %.3f to %.3f s, the log from %.3f to %.3f s on their clock",
                begin, end, first, last);
  throw std::runtime_error(text);
}

json quaternion_json(const Eigen::Quaterniond& rotation) {
  const Eigen::Quaterniond q = positive_w(rotation);
  return {q.w(), q.x(), q.y(), q.z()};
}

// How the flight came to be, for those who ask later.
json facts_of(const Inputs& inputs) {
  json facts;
  facts["program"] = std::string("perch-import ") + PERCH_VERSION;
  const auto add = [&](const char* key, const fs::path& file) {
    if (!file.empty()) facts[key] = fs::absolute(file).lexically_normal().string();
  };
  add("video", inputs.video);
  add("flight", inputs.flight);
  add("times", FLAGS_times);
  add("log", inputs.log);
  add("bag", inputs.bag);
  facts["problems"] = json::array();
  return facts;
}

void import_navigation(const Inputs& inputs, const AutopilotLog& log, const std::optional<RunConfig>& config,
                       const ImportFolder& folder, json& facts) {
  note(log.problems, facts);
  const bool one_clock = inputs.log.empty() && inputs.pictures() == inputs.bag;
  const Offset offset = one_clock ? Offset{} : find_offset(folder, inputs.pictures(), log, config);
  check_overlap(folder, log.nav, offset.ns);
  folder.write_nav(log.nav, offset.ns);
  facts["log_kind"] = log.kind;
  facts["attitude_from"] = log.attitude_from;
  facts["position_from"] = log.position_from;
  if (log.unix_minus_boot_ns) facts["log_clock_unix_minus_boot_ns"] = *log.unix_minus_boot_ns;
  facts["offset_ns"] = offset.ns;
  std::cout << (inputs.log.empty() ? inputs.bag : inputs.log).string() << ": " << log.kind << ", "
            << log.nav.samples.size() << " samples from " << log.attitude_from << " and " << log.position_from
            << '\n';
  if (!offset.found) return;
  const TimeAlignment& found = *offset.found;
  facts["gyro_from"] = log.gyro.empty() ? log.attitude_from : log.gyro_from;
  facts["offset_sigma_s"] = found.sigma;
  facts["turning_explained"] = found.explained;
  facts["turning_explained_by_next_best_offset"] = found.rival_explained;
  facts["turns_by_target"] = found.by_target;
  facts["camera_from_body_wxyz"] = quaternion_json(found.camera_from_body);
  const YawPitchRoll ypr = ypr_from_rotation(found.camera_from_body.conjugate());
  std::printf(
      "offset: the pictures' clock is %+.4f s (sigma %.4f) from the log's; %.1f %% of the camera's turning "
      "is the "
      "vehicle's (%.1f %% with the next best offset), over %.0f s, %.0f %% of it by the target\n"
      "mount, roughly: body_from_camera ypr_deg [%.1f, %.1f, %.1f]\n",
      static_cast<double>(offset.ns) * 1e-9, found.sigma, 100 * found.explained, 100 * found.rival_explained,
      found.duration, 100 * found.by_target, ypr.yaw * kDegFromRad, ypr.pitch * kDegFromRad,
      ypr.roll * kDegFromRad);
  std::fflush(stdout);
}

int run(const CommandLine& line) {
  if (FLAGS_output.empty()) throw UsageError("--output: expected a folder, found nothing");
  const Inputs inputs = sort_inputs(line.arguments);
  const auto config = read_config(line);
  if (!FLAGS_camera.empty()) read_camera_model(FLAGS_camera);
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
  ImportFolder folder(FLAGS_output);
  json facts = facts_of(inputs);
  std::optional<RosBag> bag;
  if (!inputs.bag.empty()) bag.emplace(inputs.bag, line.all("topic"));
  import_pictures(inputs, bag ? &*bag : nullptr, folder, facts);
  if (!inputs.log.empty()) {
    import_navigation(inputs, read_autopilot_log(inputs.log), config, folder, facts);
  } else if (bag && (bag->has_poses() || inputs.pictures() != inputs.bag)) {
    import_navigation(inputs, bag->navigation(), config, folder, facts);
  }
  write_whole_file(folder.path() / "import.json",
                   facts.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  stop_if_asked();
  folder.finish();
  std::cout << FLAGS_output << ": a flight\n";
  return 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(
      argc, argv, {"perch-import", "--output FLIGHT INPUT... [flags]", perch::kDescription}, perch::run);
}
