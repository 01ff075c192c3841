#include "perch/simulation/navigation.h"

#include <cmath>

#include "perch/geometry/so3.h"

namespace perch {

namespace {

Eigen::Vector3d normal3(RandomStream& random, double deviation) {
  const double x = random.normal(), y = random.normal(), z = random.normal();
  return deviation * Eigen::Vector3d(x, y, z);
}

// x' = -x / tau + noise, sampled exactly; in its steady state from the first sample on.
class OrnsteinUhlenbeck {
 public:
  OrnsteinUhlenbeck(double deviation, double correlation, double step, RandomStream& random)
      : random_(random),
        kept_(std::exp(-step / correlation)),
        added_(deviation * std::sqrt(1 - kept_ * kept_)),
        value_(normal3(random, deviation)) {}

  Eigen::Vector3d next() {
    value_ = kept_ * value_ + normal3(random_, added_);
    return value_;
  }

 private:
  RandomStream& random_;
  double kept_, added_;
  Eigen::Vector3d value_;
};

}  // namespace

std::vector<NavigationReport> navigate(const Descent& descent, const NavigationOptions& options,
                                       int64_t start_ns, uint64_t seed) {
  // So much that the first and the last picture lie between two reports.
  constexpr double kAround = 0.5;  // s
  RandomStream random(seed);
  const double step = 1 / options.rate_hz;
  OrnsteinUhlenbeck position_drift(options.position_drift, options.drift_correlation, step, random);
  OrnsteinUhlenbeck attitude_drift(options.attitude_drift, options.drift_correlation, step, random);
  std::vector<NavigationReport> reports;
  const auto count = static_cast<int64_t>((descent.duration() + 2 * kAround) * options.rate_hz);
  for (int64_t i = 0; i <= count; ++i) {
    const int64_t since_start_ns = std::llround((static_cast<double>(i) * step - kAround) * 1e9);
    const VehicleTruth truth = descent.at(static_cast<double>(since_start_ns) * 1e-9);
    NavigationReport report;
    report.timestamp_ns = start_ns + since_start_ns - std::llround(options.time_offset * 1e9);
    const Eigen::Vector3d turn = attitude_drift.next() + normal3(random, options.attitude_white);
    report.world_from_body.rotation =
        positive_w((so3_exp(turn) * truth.world_from_body.rotation).normalized());
    report.world_from_body.translation =
        truth.world_from_body.translation + position_drift.next() + normal3(random, options.position_white);
    report.body_velocity_in_world = truth.body_velocity_in_world + normal3(random, options.velocity_white);
    reports.push_back(report);
  }
  return reports;
}

}  // namespace perch
