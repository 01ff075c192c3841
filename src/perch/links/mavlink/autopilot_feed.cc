#include "perch/links/mavlink/autopilot_feed.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace perch::mavlink {
namespace {

constexpr auto kPeriod = static_cast<int64_t>(1e9 / AutopilotFeed::kMostSamplesHz);

// Where the first sample stands that is later than a period after the last one taken.
template <class Sample>
size_t first_new(const History<Sample>& history, int64_t last_ns) {
  size_t i = history.size();
  while (i > 0 && history[i - 1].time_ns > last_ns) --i;
  return i;
}

template <class Sample, class Take>
void take_new(const History<Sample>& history, int64_t& last_ns, const Take& take) {
  for (size_t i = first_new(history, last_ns); i < history.size(); ++i) {
    const bool first = last_ns == std::numeric_limits<int64_t>::min();
    if (!first && history[i].time_ns - last_ns < kPeriod) continue;
    last_ns = history[i].time_ns;
    take(history[i]);
  }
}

}  // namespace

AutopilotFeed::AutopilotFeed(double time_offset)
    : time_offset_ns_(std::llround(time_offset * 1e9)),
      last_attitude_ns_(std::numeric_limits<int64_t>::min()),
      last_motion_ns_(last_attitude_ns_) {}

std::vector<AutopilotSample> AutopilotFeed::take(const VehicleHistory& history) {
  std::vector<AutopilotSample> samples;
  take_new(history.attitudes(), last_attitude_ns_, [&](const AttitudeSample& said) {
    AutopilotSample sample;
    sample.timestamp_ns = said.time_ns + time_offset_ns_;
    sample.world_from_body = said.ned_from_body;
    sample.angular_velocity_in_body = said.body_rate;
    samples.push_back(sample);
  });
  take_new(history.motions(), last_motion_ns_, [&](const MotionSample& said) {
    AutopilotSample sample;
    sample.timestamp_ns = said.time_ns + time_offset_ns_;
    sample.body_velocity_in_world = said.body_velocity_in_ned;
    samples.push_back(sample);
  });
  std::stable_sort(samples.begin(), samples.end(),
                   [](const auto& a, const auto& b) { return a.timestamp_ns < b.timestamp_ns; });
  return samples;
}

std::optional<Eigen::Quaterniond> AutopilotFeed::attitude_at(const VehicleHistory& history,
                                                             int64_t camera_time_ns) const {
  const auto sample = history.attitude_at(camera_time_ns - time_offset_ns_);
  if (!sample) return std::nullopt;
  return sample->ned_from_body;
}

std::optional<HeadAngles> AutopilotFeed::head_angles_at(const VehicleHistory& history,
                                                        const FrameChain& chain,
                                                        int64_t camera_time_ns) const {
  const int64_t time_ns = camera_time_ns - time_offset_ns_;
  const auto gimbal = history.gimbal_at(time_ns);
  const auto body = history.attitude_at(time_ns);
  if (!gimbal || !body) return std::nullopt;
  // Forward, right, down are a camera's z, x, y.
  Eigen::Matrix3d frd_from_camera;
  frd_from_camera << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  const Eigen::Quaterniond body_from_gimbal =
      body->ned_from_body.conjugate() * ned_from_gimbal(*gimbal, body->ned_from_body);
  return head_angles_of(chain, body_from_gimbal * Eigen::Quaterniond(frd_from_camera));
}

}  // namespace perch::mavlink
