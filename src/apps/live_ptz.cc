#include "live_ptz.h"

#include <chrono>
#include <cmath>

#include "perch/config/error.h"
#include "perch/geometry/euler.h"
#include "thread_cpu.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

// A packet's bytes take 5 to 16 ms at 9600 baud.
constexpr auto kTick = 2ms;

// Between where the zoom was told to go and where it says it is, of the whole way.
constexpr double kZoomThere = 0.01;

bool take(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

}  // namespace

std::optional<PtzOptions> read_ptz_options(Section ptz) {
  std::string device = "none";
  ptz.read("device", device);
  PtzOptions options;
  int address = options.visca.camera;
  ptz.read("address", address, Range{1, 7});
  options.visca.camera = static_cast<uint8_t>(address);
  ptz.read("follow", options.follow);
  ptz.read("zoom", options.zoom, kFraction);
  double dead_band_deg = options.control.dead_band * kDegFromRad;
  ptz.read("dead_band_deg", dead_band_deg, Range{0, 20});
  options.control.dead_band = dead_band_deg * kRadFromDeg;
  ptz.read("gain", options.control.gain, Range{0.1, 20});
  ptz.read("motor_delay", options.visca.motor_delay, Range{0, 0.5});
  ptz.read("lag", options.control.lag, Range{0, 0.5});
  ptz.done();
  if (device == "none") return std::nullopt;
  constexpr char kExpected[] = "none, visca+URL of a byte stream, or visca-ip+udp://HOST:52381";
  std::string_view url = device;
  options.visca.over_ip = take(url, "visca-ip+");
  if (!options.visca.over_ip && !take(url, "visca+")) ptz.fail("device", kExpected);
  try {
    options.url = parse_stream_url(url);
  } catch (const ConfigError& e) {
    ptz.fail("device", std::string(kExpected) + " (" + e.what() + ")");
  }
  if (options.visca.over_ip != options.url.datagrams()) ptz.fail("device", kExpected);
  // What VISCA cameras speak where nothing else is said, unlike telemetry radios.
  const bool says_baud = options.url.text.find("baud=") != std::string::npos ||
                         options.url.text.find(':', options.url.text.find('/')) != std::string::npos;
  if (options.url.kind == StreamKind::kSerial && !says_baud) options.url.baud = 9600;
  // Behind a network the wire is what it is at the far end: 9600 baud, until somebody says otherwise.
  if (options.url.kind == StreamKind::kSerial) options.visca.baud = options.url.baud;
  return options;
}

LivePtz::LivePtz(const PtzOptions& options, const FrameChain& chain, const CameraModel& camera)
    : options_(options),
      stream_(options.url),
      head_(options.visca),
      control_(chain, camera, head_.model(), options.control),
      thread_([this] { run(); }) {}

LivePtz::~LivePtz() {
  if (options_.follow) {
    const std::lock_guard lock(mutex_);
    head_.point({});
  }
  // Half a second for the stop: a head that drives on would end at its stops.
  for (const int64_t until = monotonic_ns() + 500'000'000; monotonic_ns() < until && options_.follow;) {
    std::this_thread::sleep_for(10ms);
    const std::lock_guard lock(mutex_);
    if (!head_.ready() || !head_.busy()) break;
  }
  stop_ = true;
  stream_.wake();
  thread_.join();
}

void LivePtz::run() {
  while (!stop_) {
    turn();
    ++progress_;
    cpu_seconds_ = thread_cpu_seconds();
  }
}

void LivePtz::turn() {
  stream_.run(kTick, [&](const Chunk& chunk) {
    const std::lock_guard lock(mutex_);
    head_.receive(chunk.bytes, chunk.arrival_ns, chunk.datagram);
  });
  const std::lock_guard lock(mutex_);
  // A device that began anew is told anew.
  if (head_.ready() && !zoom_told_) head_.zoom_to(options_.zoom);
  zoom_told_ = head_.ready();
  bool wrote = false;
  for (const visca::Bytes& packet : head_.tick(monotonic_ns())) wrote |= stream_.write(packet);
  if (wrote) stream_.wake();  // run() comes back at once, and has sent it
}

std::optional<HeadAngles> LivePtz::angles_at(int64_t time_ns) const {
  const std::lock_guard lock(mutex_);
  return head_.at(time_ns);
}

std::optional<double> LivePtz::zoom() const {
  const std::lock_guard lock(mutex_);
  const auto zoom = head_.zoom();
  return zoom && std::abs(*zoom - options_.zoom) < kZoomThere ? zoom : std::nullopt;
}

void LivePtz::report(const std::optional<VehicleState>& state,
                     const std::optional<Eigen::Quaterniond>& world_from_body) {
  if (!options_.follow) return;
  const std::lock_guard lock(mutex_);
  const auto move = control_.update(monotonic_ns(), state, world_from_body, head_);
  if (!move) return ++blind_, void();
  head_.point(move->goal);
  ++(move->searching ? searching_ : moves_);
}

nlohmann::ordered_json LivePtz::summary() const {
  const StreamStatistics stream = stream_.statistics();
  const std::lock_guard lock(mutex_);
  const auto& s = head_.statistics();
  return {{"ready", head_.ready()},
          {"reaction_s", head_.reaction()},
          {"followed", moves_},
          {"searched", searching_},
          {"blind", blind_},
          {"starts", s.starts},
          {"inquiries", s.inquiries},
          {"positions", s.positions},
          {"positions_doubted", s.positions_doubted},
          {"positions_refused", s.positions_refused},
          {"commands", s.commands},
          {"acks", s.acks},
          {"completions", s.completions},
          {"errors", s.errors},
          {"time_outs", s.time_outs},
          {"garbled", s.garbled},
          {"bytes_in", stream.bytes_in},
          {"bytes_out", stream.bytes_out},
          {"last_error", stream.last_error}};
}

}  // namespace perch
