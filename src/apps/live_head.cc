#include "live_head.h"

#include <cmath>

#include "perch/config/error.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

// From one end of the EVI-D30's pan to its middle, with what the line takes.
constexpr int64_t kCentring = 2'000'000'000;
// Without its angles for longer it is stopped; shorter gaps are those of a line that garbles.
constexpr int64_t kBlind = 200'000'000;

bool take(std::string_view& text, std::string_view prefix) {
  if (!text.starts_with(prefix)) return false;
  text.remove_prefix(prefix.size());
  return true;
}

// The circle about all of it that is seen.
double radius_of(const LandingTarget& target) {
  double radius = 0;
  for (const Feature& feature : target.features) radius = std::max(radius, feature.point.norm());
  return radius;
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
  if (ptz.has("fill")) ptz.read("fill", options.fill.emplace(0.5), Range{0.05, 0.95});
  double dead_band_deg = options.control.dead_band * kDegFromRad;
  ptz.read("dead_band_deg", dead_band_deg, Range{0, 20});
  options.control.dead_band = dead_band_deg * kRadFromDeg;
  ptz.read("gain", options.control.gain, Range{0.1, 20});
  ptz.read("motor_delay", options.visca.motor_delay, Range{0, 0.5});
  ptz.read("lag", options.control.lag, Range{0, 0.5});
  ptz.done();
  if (device == "none") return std::nullopt;
  options.gimbal = device == "mavlink";
  if (options.gimbal && options.fill) ptz.fail("fill", "none, as a gimbal does not zoom");
  if (options.gimbal) return options;
  constexpr char kExpected[] = "none, mavlink, visca+URL of a byte stream, or visca-ip+udp://HOST:52381";
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

LiveHead::LiveHead(const PtzOptions& options, const RunConfig& config, const FrameChain& frames,
                   const CameraModel& camera, const HeadModel& model)
    : options_(options),
      table_(config.zoom_table),
      control_(frames, camera, model, options.control),
      zoom_(options.zoom) {
  if (options.fill) zoom_control_.emplace(*table_, radius_of(config.target), *options.fill);
}

void LiveHead::zoom_to(double zoom, PtzCamera& head) {
  if (zoom == zoom_) return;
  zoom_ = zoom;
  ++zooms_;
  head.zoom_to(zoom);
  if (const auto camera = table_ ? table_->at(zoom) : std::nullopt) control_.look_through(*camera);
}

void LiveHead::steer(int64_t now_ns, const std::optional<VehicleState>& state,
                     const std::optional<Eigen::Quaterniond>& world_from_body,
                     const std::optional<HeadControl::Glimpse>& glimpse, PtzCamera& head) {
  if (now_ns < centring_until_ns_) return;
  doing_ = "rests";
  if (!options_.follow) return;
  const auto move = control_.update(now_ns, state, world_from_body, head, glimpse);
  if (!move) {
    doing_ = "blind";
    ++blind_;
    // It would go on as it was told last, up to its stops.
    if (blind_since_ns_ == 0) blind_since_ns_ = now_ns;
    if (now_ns - blind_since_ns_ > kBlind) head.point({});
    return;
  }
  blind_since_ns_ = 0;
  head.point(move->goal);
  doing_ = move->searching ? "searches" : "follows";
  ++(move->searching ? searching_ : moves_);
  if (!zoom_control_) return;
  const bool tracked = state && state->source != StateSource::kLost;
  if (!tracked && !move->searching) return;  // what shows it, shows it
  if (tracked && !head.zoom()) return;       // one move at a time
  const auto sight = tracked ? control_.sight(*state, now_ns, head) : std::nullopt;
  zoom_to(zoom_control_->update(now_ns, sight, zoom_), head);
}

void LiveHead::centre(int64_t now_ns, PtzCamera& head) {
  centring_until_ns_ = now_ns + kCentring;
  doing_ = "centres";
  head.point({HeadGoal::Kind::kAbsolute, 0, 0});
  zoom_to(options_.zoom, head);
}

nlohmann::ordered_json LiveHead::summary() const {
  return {{"followed", moves_}, {"searched", searching_}, {"blind", blind_}, {"zoomed", zooms_}};
}

nlohmann::json LiveHead::status(int64_t now_ns, const PtzCamera& head) const {
  nlohmann::json json = {
      {"ready", head.ready()}, {"doing", doing_}, {"pan", nullptr}, {"tilt", nullptr}, {"zoom", nullptr}};
  if (const auto angles = head.expected_at(now_ns)) {
    json["pan"] = angles->pan * kDegFromRad;
    json["tilt"] = angles->tilt * kDegFromRad;
  }
  if (const auto zoom = head.zoom()) json["zoom"] = *zoom;
  return json;
}

}  // namespace perch
