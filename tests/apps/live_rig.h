#pragma once

#include <gmock/gmock.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "apps/real_time_autopilot.h"
#include "perch/simulation/live_simulation.h"
#include "support/child_program.h"
#include "support/run_program.h"

namespace perch {

namespace fs = std::filesystem;
using mavlink::kMs;
using mavlink::kSecond;
using mavlink::RealTimeAutopilot;
using nlohmann::json;
using testing::HasSubstr;

// Small pictures from near, so that a busy machine keeps up with them.
inline constexpr char kSimulation[] =
    "camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5],"
    " rate_hz: 15}\n"
    "flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 14, hover: 120}\n";

// How long a test waits for what comes within seconds: a machine that others load may take many times that.
inline constexpr double kPatience = 40;  // s

inline void sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class PerchLive : public testing::Test {
 protected:
  explicit PerchLive(std::unique_ptr<mavlink::Wire> wire = std::make_unique<mavlink::UdpWire>(),
                     std::unique_ptr<mavlink::Signing> signing = nullptr)
      : autopilot_(std::move(wire), std::move(signing)) {
    const std::string target = "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n";
    folder_.write("sim.yaml", target + kSimulation);
    folder_.write("run.yaml", target + "camera: {source: 'sim:sim.yaml'}\n" + "nav: " + autopilot_.url() +
                                  "\noutputs: {mavlink: {}}\n");
    flight_ = std::make_unique<SimulatedFlight>(read_simulation(Section::load(folder_ / "sim.yaml")));
  }

  ChildProgram start(std::vector<std::string> more = {}) const {
    std::vector<std::string> arguments = {"--config", "run.yaml", "--summary", "summary.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return {folder_, PERCH_LIVE, arguments};
  }
  json summary() const { return json::parse(read_file(folder_ / "summary.json")); }

  // Reads off the log when the flight began, and has the autopilot fly it.
  void fly_with(const ChildProgram& live) {
    ASSERT_TRUE(live.says(" ns\n", kPatience)) << live.err();
    const std::string log = live.err();
    const int64_t first = std::stoll(log.substr(log.find("first picture, ") + 15));
    begin_ns_ = std::stoll(log.substr(log.find("exposed at ") + 11)) - first * kSecond / 15;
    autopilot_.with([&](auto& autopilot) { autopilot.motion = [this](int64_t t) { return truth_at(t); }; });
  }
  double flight_time(int64_t time_ns) const { return 1e-9 * static_cast<double>(time_ns - begin_ns_); }
  mavlink::TrueMotion truth_at(int64_t time_ns) const {
    const VehicleTruth now = flight_->vehicle_at(flight_time(time_ns));
    const VehicleTruth soon = flight_->vehicle_at(flight_time(time_ns + kMs));
    const Eigen::Vector3d rate =
        1e3 * so3_log(now.world_from_body.rotation.conjugate() * soon.world_from_body.rotation);
    return {now.world_from_body, rate, now.body_velocity_in_world};
  }
  Eigen::Vector3d pad_in_body_at(int64_t time_ns) const {
    return (inverse(flight_->vehicle_at(flight_time(time_ns)).world_from_body) *
            flight_->pad_at(flight_time(time_ns)).world_from_pad)
        .translation;
  }
  std::vector<RealTimeAutopilot::Arrival<mavlink::LandingTarget>> landing_targets_since(
      int64_t time_ns) const {
    auto all = autopilot_.landing_targets();
    std::erase_if(all, [&](const auto& a) { return a.arrived_ns < time_ns; });
    return all;
  }
  // Waits until so many have come since.
  bool landing_targets_come(int64_t since_ns, size_t count, double seconds = kPatience) const {
    for (double t = 0; t < seconds; t += 0.02, sleep(0.02)) {
      if (landing_targets_since(since_ns).size() >= count) return true;
    }
    return false;
  }

  TempFolder folder_;
  RealTimeAutopilot autopilot_;
  std::unique_ptr<SimulatedFlight> flight_;
  std::atomic<int64_t> begin_ns_ = 0;
};

}  // namespace perch
