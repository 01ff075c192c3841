#pragma once

#include "perch/links/visca/visca_camera.h"
#include "perch/simulation/serial_line.h"
#include "perch/simulation/simulated_evi_d30.h"

namespace perch {

// A VISCA camera's two ends with a wire between them, ms by ms.
class ViscaRig {
 public:
  explicit ViscaRig(double flipped = 0, bool over_ip = false, uint64_t seed = 1)
      : camera_(options(over_ip)),
        device_(device_options(over_ip)),
        over_ip_(over_ip),
        there_(over_ip ? 0 : 9600, flipped, 2 * seed - 1),
        back_(over_ip ? 0 : 9600, flipped, 2 * seed) {}

  // `wire_cut`: nothing gets through.
  void step() {
    now_ns_ += 1'000'000;
    for (const auto& packet : camera_.tick(now_ns_)) {
      if (wire_cut) continue;
      if (over_ip_) {
        device_.receive(packet);
      } else {
        there_.send(packet, now_ns_);
      }
    }
    if (const auto bytes = there_.receive(now_ns_); !bytes.empty()) device_.receive(bytes);
    for (const auto& packet : device_.advance(now_ns_)) {
      if (wire_cut) continue;
      if (over_ip_) {
        camera_.receive(packet, now_ns_, true);
      } else {
        back_.send(packet, now_ns_);
      }
    }
    if (const auto bytes = back_.receive(now_ns_); !bytes.empty()) camera_.receive(bytes, now_ns_, false);
  }
  void run(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 1000 + 0.5); ++i) step();
  }

  visca::ViscaCamera& camera() { return camera_; }
  SimulatedEviD30& device() { return device_; }
  int64_t now_ns() const { return now_ns_; }
  double seconds() const { return static_cast<double>(now_ns_) * 1e-9; }
  bool wire_cut = false;

 private:
  static visca::ViscaOptions options(bool over_ip) {
    visca::ViscaOptions options;
    options.over_ip = over_ip;
    return options;
  }
  static EviD30Options device_options(bool over_ip) {
    EviD30Options options;
    options.over_ip = over_ip;
    return options;
  }

  visca::ViscaCamera camera_;
  SimulatedEviD30 device_;
  bool over_ip_;
  SerialLine there_, back_;
  int64_t now_ns_ = 0;
};

}  // namespace perch
