#include "perch/simulation/live_simulation.h"

#include <algorithm>
#include <cmath>

#include "perch/config/error.h"
#include "perch/geometry/so3.h"

namespace perch {

LiveSimulation::LiveSimulation(const Simulation& simulation, Pace pace, LiveClock& clock)
    : flight_(simulation), pace_(pace), clock_(clock) {
  const ShutterOptions& shutter = simulation.shutter;
  exposed_ns_ = std::llround((shutter.exposure + shutter.readout) / 2 * 1e9);
  const int64_t offset_ns = std::llround(simulation.nav.time_offset * 1e9);
  for (const NavigationReport& report : flight_.navigation()) {
    NavigationError error;
    error.since_start_ns = report.timestamp_ns - flight_.timestamp_ns(0) + offset_ns;
    const VehicleTruth truth = flight_.vehicle_at(static_cast<double>(error.since_start_ns) * 1e-9);
    error.position = report.world_from_body.translation - truth.world_from_body.translation;
    error.rotation = so3_log(report.world_from_body.rotation * truth.world_from_body.rotation.conjugate());
    error.velocity = report.body_velocity_in_world - truth.body_velocity_in_world;
    errors_.push_back(error);
  }
  if (!simulation.head.empty()) {
    if (pace != Pace::kRealTime)
      throw ConfigError("camera.pace: expected real_time, as a head turns the simulation's camera");
    head_ = std::make_unique<HeadFeed>(simulation.head);
  }
  if (pace == Pace::kRealTime) clock_offset_ns_ = clock.now_ns() - flight_.timestamp_ns(0);
}

int64_t LiveSimulation::stamp_ns(int64_t frame) const {
  return flight_.timestamp_ns(frame) + clock_offset_ns_;
}

std::optional<LiveFrame> LiveSimulation::next(std::chrono::nanoseconds timeout) {
  const int64_t deadline = clock_.now_ns() + timeout.count();
  if (ended_) return std::nullopt;
  if (head_) {
    clock_.sleep_until(std::min(due_ns(frame_), deadline));
    if (clock_.now_ns() < due_ns(frame_)) return std::nullopt;
  }
  if (!picture_) render();
  if (ended_) return std::nullopt;
  if (pace_ == Pace::kRealTime) {
    clock_.sleep_until(std::min(due_ns(frame_), deadline));
    if (clock_.now_ns() < due_ns(frame_)) return std::nullopt;
  }
  LiveFrame picture{std::move(*picture_), clock_.now_ns()};
  picture_.reset();
  ended_ = ++frame_ == flight_.frames();
  tally_.picture(picture.frame);
  return picture;
}

void LiveSimulation::render() {
  const int64_t start = clock_.now_ns();
  if (pace_ == Pace::kRealTime) {
    // Pictures that could not be ready in time are left out, or each would be later than the one before.
    // One that is rendered after its exposure has the time to the next one.
    const int64_t ready = head_ ? start - static_cast<int64_t>(1e9 / flight_.simulation().rate_hz)
                                : start + static_cast<int64_t>(cost_ns_);
    for (; frame_ < flight_.frames() && due_ns(frame_) < ready; ++frame_) {
      tally_.add(&LiveCounters::dropped);
    }
    ended_ = frame_ == flight_.frames();
    if (ended_) return;
  }
  picture_.emplace();
  picture_->timestamp_ns = stamp_ns(frame_);
  picture_->name = std::to_string(frame_);
  const auto head = head_ ? head_->at(stamp_ns(frame_)) : std::nullopt;
  picture_->grey = head ? flight_at(head->zoom).picture(frame_, head->angles) : flight_.picture(frame_);
  const auto cost = static_cast<double>(clock_.now_ns() - start);
  cost_ns_ += cost_ns_ == 0 ? cost : (cost - cost_ns_) / 8;
}

const SimulatedFlight& LiveSimulation::flight_at(double zoom) {
  if (zoom == 0 || flight_.simulation().zoom_ratio == 1) return flight_;
  if (!zoomed_ || zoom != zoom_) {
    Simulation simulation = flight_.simulation();
    std::vector<double> intrinsics = simulation.camera.intrinsics();  // the focal lengths first
    for (size_t i = 0; i < 2; ++i) intrinsics[i] *= std::pow(simulation.zoom_ratio, zoom);
    simulation.camera = {simulation.camera.lens(), intrinsics, simulation.camera.width(),
                         simulation.camera.height()};
    zoomed_ = std::make_unique<SimulatedFlight>(simulation);
    zoom_ = zoom;
  }
  return *zoomed_;
}

Eigen::Vector3d LiveSimulation::angular_velocity_in_body(int64_t time_ns) const {
  // A central difference: the motion's own times are tenths of seconds, and 1 ms keeps 12 digits of the 16.
  constexpr double kStep = 1e-3;  // s
  const double t = seconds(time_ns);
  const auto rotation = [&](double at) { return flight_.vehicle_at(at).world_from_body.rotation; };
  return so3_log(rotation(t - kStep).conjugate() * rotation(t + kStep)) / (2 * kStep);
}

NavigationReport LiveSimulation::navigation(int64_t time_ns) const {
  const VehicleTruth truth = vehicle(time_ns);
  // The last report up to then; before the first, the first.
  const auto after = std::upper_bound(errors_.begin(), errors_.end(), time_ns - stamp_ns(0),
                                      [](int64_t since_start_ns, const NavigationError& error) {
                                        return since_start_ns < error.since_start_ns;
                                      });
  const NavigationError& error = after == errors_.begin() ? errors_.front() : *std::prev(after);
  NavigationReport report;
  report.timestamp_ns = time_ns - std::llround(flight_.simulation().nav.time_offset * 1e9);
  report.world_from_body.translation = truth.world_from_body.translation + error.position;
  report.world_from_body.rotation =
      positive_w((so3_exp(error.rotation) * truth.world_from_body.rotation).normalized());
  report.body_velocity_in_world = truth.body_velocity_in_world + error.velocity;
  return report;
}

std::unique_ptr<LiveSimulation> open_live_simulation(const std::filesystem::path& file,
                                                     const LiveOptions& options) {
  return std::make_unique<LiveSimulation>(read_simulation(Section::load(file)), options.pace);
}

}  // namespace perch
