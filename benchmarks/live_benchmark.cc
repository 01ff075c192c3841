// perch_live_benchmark: perch-live as a whole, 640x480 at 30 Hz with raw pictures and an autopilot that
// streams over UDP: from exposure to bytes out, and the processor time of each thread; with and without
// recording, on an idle machine and beside a program that keeps every core busy. See benchmarks/README.md.
//
//   perch_live_benchmark SECONDS [row]
//   perch_live_benchmark SECONDS compare FILE   one turn each without and with recording, on a disk of which
//                                               each write takes 20 ms, added to the latencies in FILE;
//                                               the 99 % of all turns there against each other
//   perch_live_benchmark SECONDS memory         a simulation that is recorded: what is resident each minute

#include <signal.h>
#include <sys/wait.h>

#include <atomic>
#include <cstdio>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>

#include "apps/real_time_autopilot.h"
#include "paired_latency.h"
#include "perch/flight/sensor_file.h"
#include "perch/simulation/simulation.h"
#include "station/raw_client.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
constexpr int kRate = 30;
constexpr int kPictures = 60;  // rendered; played to and fro

struct Row {
  std::string name;
  bool busy = false;   // every core has another program on it
  std::string record;  // "", png, ffv1
  bool slow_disk = false;
  bool page = false;  // the station runs, and somebody looks at it
};

Simulation simulation() {
  const std::string source = PERCH_SOURCE_DIR;
  return read_simulation(
      Section::parse("target: " + source +
                         "/configs/targets/sharp.yaml\n"
                         "flight: {start_height: 5, start_aside: 0.5, touchdown_height: 2.5, "
                         "duration: 4, hover: 10}\n",
                     source + "/sim.yaml"));
}

// Raw grey pictures, one after the other, for as long as a run takes: what a camera's driver would give.
void write_film(const SimulatedFlight& flight, const std::string& file, int seconds) {
  std::vector<cv::Mat> pictures;
  for (int i = 0; i < kPictures; ++i) pictures.push_back(flight.picture(kRate + i));
  std::ofstream film(file, std::ios::binary);
  for (int i = 0; i < (seconds + 1) * kRate; ++i) {
    const int at = i % (2 * kPictures - 2);
    cv::Mat picture = pictures[static_cast<size_t>(at < kPictures ? at : 2 * kPictures - 2 - at)].clone();
    // A sensor's noise never repeats itself; a picture that does is not believed.
    picture.at<uint8_t>(0, 0) = static_cast<uint8_t>(i);
    film.write(picture.ptr<char>(), static_cast<std::streamsize>(picture.total()));
  }
}

// Somebody who looks at the station's page: takes the states and pictures that come and says so, as a browser
// does, from when the log says where the station is.
class Page {
 public:
  explicit Page(const std::string& log)
      : log_(log), thread_([this](const std::stop_token& stop) { watch(stop); }) {}

 private:
  void watch(const std::stop_token& stop) {
    const std::string says = "station: port ";
    size_t at = std::string::npos;
    std::string log;
    while (!stop.stop_requested() && at == std::string::npos) {
      usleep(20'000);
      log = std::ifstream(log_).good() ? read_file(log_) : "";
      at = log.rfind(says);
      if (at != std::string::npos && log.find('\n', at) == std::string::npos) at = std::string::npos;
    }
    if (stop.stop_requested()) return;
    const int port = std::stoi(log.substr(at + says.size()));
    const std::string host = "127.0.0.1:" + std::to_string(port);
    RawClient client(static_cast<uint16_t>(port));
    if (!client.upgrade(host, "http://" + host)) return;
    client.say(R"({"from":{"session":"","sequence":0}})");
    for (int messages = 0; !stop.stop_requested();) {
      const auto message = client.next(0.1);
      if (message.opcode == 8) return;
      if (message.opcode > 0) client.say("{\"ack\":" + std::to_string(++messages) + "}");
    }
  }

  const std::string log_;
  std::jthread thread_;
};

pid_t start(const std::string& folder, std::vector<std::string> arguments, const std::string& preload) {
  const pid_t child = fork();
  if (child != 0) return child;
  if (!preload.empty()) setenv("LD_PRELOAD", preload.c_str(), 1);
  std::vector<char*> argv;
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  if (chdir(folder.c_str()) != 0 || !freopen("log", "w", stderr)) _exit(126);
  execv(argv[0], argv.data());
  _exit(127);
}

// One for each core: an endless sum.
std::vector<pid_t> keep_cores_busy() {
  std::vector<pid_t> busy;
  for (unsigned i = 0; i < std::thread::hardware_concurrency(); ++i) {
    const pid_t child = fork();
    if (child == 0) {
      for (std::atomic<uint64_t> sum = 0;;) ++sum;
    }
    busy.push_back(child);
  }
  return busy;
}

json run(const Row& row, const TempFolder& folder, int seconds, std::vector<double>* latencies_ms = nullptr) {
  mavlink::RealTimeAutopilot autopilot;
  const std::string film = folder / "film.raw";
  std::vector<std::string> arguments = {PERCH_LIVE,
                                        "--config",
                                        "run.yaml",
                                        "--summary",
                                        "summary.json",
                                        "--duration",
                                        std::to_string(seconds),
                                        "--set",
                                        "nav=" + autopilot.url()};
  if (!row.record.empty()) {
    arguments.insert(arguments.end(), {"--set", "outputs.record.folder=flights", "--set",
                                       "outputs.record.format=" + row.record});
  }
  if (row.page) arguments.insert(arguments.end(), {"--set", "outputs.station.listen=127.0.0.1:0"});
  fs::remove(folder / "log");
  std::optional<Page> page;
  if (row.page) page.emplace(folder / "log");
  const auto busy = row.busy ? keep_cores_busy() : std::vector<pid_t>{};
  waitpid(start(folder.path().string(), arguments, row.slow_disk ? PERCH_SLOW_DISK : ""), nullptr, 0);
  page.reset();
  for (const pid_t child : busy) kill(child, SIGKILL), waitpid(child, nullptr, 0);
  json summary = json::parse(read_file(folder / "summary.json"));
  summary["landing_targets"] = autopilot.landing_targets().size();
  for (const auto& [arrived_ns, target] : autopilot.landing_targets()) {
    if (latencies_ms)
      latencies_ms->push_back(1e-6 * static_cast<double>(arrived_ns) -
                              1e-3 * static_cast<double>(target.time_usec));
  }
  return summary;
}

void compare(const TempFolder& folder, int seconds, const std::string& file) {
  PairedLatencies paired(file);
  const long turn = time(nullptr);
  for (const char* record : {"", "png", "ffv1"}) {
    std::vector<double> ms;
    run({"", false, record, *record != 0}, folder, seconds, &ms);
    paired.add(turn, *record ? std::string("recording ") + record : "not recording", ms);
  }
  paired.print("not recording");
}

double resident_mb(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

void watch_memory(const TempFolder& folder, int seconds) {
  mavlink::RealTimeAutopilot autopilot;
  folder.write("sim.yaml",
               "target: " PERCH_SOURCE_DIR
               "/configs/targets/sharp.yaml\n"
               "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, "
               "119.5], rate_hz: 15}\n"
               "flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 14, hover: " +
                   std::to_string(seconds) + "}\n");
  folder.write("memory.yaml", "target: " PERCH_SOURCE_DIR
                              "/configs/targets/sharp.yaml\n"
                              "camera: {source: 'sim:sim.yaml'}\noutputs: {mavlink: {}, record: flights}\n");
  const pid_t child = start(folder.path().string(),
                            {PERCH_LIVE, "--config", "memory.yaml", "--summary", "summary.json", "--duration",
                             std::to_string(seconds), "--set", "nav=" + autopilot.url()},
                            "");
  for (int second = 1; second < seconds; ++second) {
    sleep(1);
    if (second % 60 != 0 && second + 1 != seconds) continue;
    std::printf("after %d s %.1f MB\n", second, resident_mb(child));
    std::fflush(stdout);
  }
  waitpid(child, nullptr, 0);
  const json summary = json::parse(read_file(folder / "summary.json"));
  std::printf("%lld frames, %zu messages, %lld pictures not recorded\n",
              static_cast<long long>(summary["frames"]), autopilot.landing_targets().size(),
              static_cast<long long>(summary["recording"]["frames_dropped"]));
}

void print(const Row& row, const json& summary) {
  const auto latency = [&](const char* stage) {
    const json& l = summary["latency_us"][stage];
    char text[64];
    std::snprintf(text, sizeof(text), "%.2f / %.2f / %.1f", l["median"].get<double>() * 1e-3,
                  l["p99"].get<double>() * 1e-3, l["worst"].get<double>() * 1e-3);
    return std::string(text);
  };
  const double seconds = summary["seconds"];
  const auto percent = [&](const char* thread) {
    return 100 * summary["cpu_s"][thread].get<double>() / seconds;
  };
  std::printf("| %s | %s | %s | %s | %.1f | %.1f | %.1f | %.1f | %.1f | %lld of %lld | %lld |\n",
              row.name.c_str(), latency("waiting").c_str(), latency("estimate").c_str(),
              latency("total").c_str(), percent("process"), percent("capture"), percent("estimator"),
              percent("link"), row.page ? 100 * summary["station"]["cpu_s"].get<double>() / seconds : 0,
              static_cast<long long>(summary["landing_targets"]), static_cast<long long>(summary["frames"]),
              row.record.empty() ? 0LL : static_cast<long long>(summary["recording"]["frames_dropped"]));
  std::fflush(stdout);
}

int benchmark(int seconds, const std::string& only, const std::string& file) {
  const TempFolder folder;
  if (only == "memory") {
    watch_memory(folder, seconds);
    return 0;
  }
  const SimulatedFlight flight(simulation());
  write_film(flight, folder / "film.raw", seconds);
  folder.write("camera.cameramodel", camera_model_text(flight.simulation().camera));
  folder.write("run.yaml", "target: " PERCH_SOURCE_DIR
                           "/configs/targets/sharp.yaml\n"
                           "camera:\n"
                           "  model: camera.cameramodel\n"
                           "  source: 'gst:filesrc location=" +
                               (folder / "film.raw").string() +
                               " ! rawvideoparse format=gray8 width=640 height=480 framerate=30/1'\n"
                               "frames: {body_from_base: identity}\n"
                               "outputs: {mavlink: {}}\n");
  if (only == "compare") {
    compare(folder, seconds, file);
    return 0;
  }
  std::puts(
      "| | waiting, ms | estimate, ms | exposure to sent, ms | CPU % of a core | capture | estimator | link "
      "| station | sent of frames | pictures not recorded |\n|---|---|---|---|---|---|---|---|---|---|---|");
  for (const Row& row :
       {Row{"idle", false, "", false}, Row{"a page that watches", false, "", false, true},
        Row{"recording png", false, "png", false}, Row{"recording ffv1", false, "ffv1", false},
        Row{"recording png, slow disk", false, "png", true}, Row{"all cores busy", true, "", false},
        Row{"all cores busy, recording png", true, "png", false}}) {
    if (only.empty() || row.name == only) print(row, run(row, folder, seconds));
  }
  return 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  if (argc < 2) {
    std::cerr << "usage: perch_live_benchmark SECONDS [ROW | compare FILE | memory]\n";
    return 2;
  }
  return perch::benchmark(std::atoi(argv[1]), argc > 2 ? argv[2] : "",
                          argc > 3 ? argv[3] : "live_latencies.txt");
}
