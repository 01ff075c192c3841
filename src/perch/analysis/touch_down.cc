#include "perch/analysis/touch_down.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "perch/analysis/statistics.h"

namespace perch {
namespace {

constexpr double kTouching = 0.05;  // m above the lowest: navigation's height scatters by so much
constexpr double kDescent = 0.5;    // m: less is no landing but noise
constexpr double kSlowest = 0.05;   // m/s: what sinks slower does not say when it arrives
constexpr std::array<double, 6> kToGo{0, 0.5, 1, 2, 5, 10};  // s

double seconds(int64_t from_ns, int64_t to_ns) { return 1e-9 * static_cast<double>(to_ns - from_ns); }

// Of the frames that navigation knows, in the order of their times.
struct Track {
  std::vector<int64_t> time_ns;
  std::vector<Eigen::Vector3d> position;  // of the body in the pad frame
};

Track track_of(std::span<const FrameRecord> frames) {
  Track track;
  for (const FrameRecord& frame : frames) {
    if (!frame.navigation || (!track.time_ns.empty() && frame.timestamp_ns <= track.time_ns.back())) continue;
    track.time_ns.push_back(frame.timestamp_ns);
    track.position.emplace_back(frame.navigation->head<3>());
  }
  return track;
}

struct Moment {
  int64_t time_ns = 0;
  Eigen::Vector3d position;
};

std::optional<Moment> touched(const Track& track) {
  if (track.position.empty()) return std::nullopt;
  double lowest = INFINITY;
  for (const Eigen::Vector3d& p : track.position) lowest = std::min(lowest, p.z());
  const double level = lowest + kTouching;
  // The first time: afterwards somebody may carry it.
  bool high = false;
  size_t i = 0;
  for (; i < track.position.size(); ++i) {
    const double height = track.position[i].z();
    if (height > level + kDescent) high = true;
    if (high && height <= level) break;
  }
  if (i == track.position.size()) return std::nullopt;
  const Eigen::Vector3d above = track.position[i - 1], below = track.position[i];
  const double part = (above.z() - level) / (above.z() - below.z());
  const double dt_ns = static_cast<double>(track.time_ns[i] - track.time_ns[i - 1]);
  return Moment{track.time_ns[i - 1] + std::llround(part * dt_ns), above + part * (below - above)};
}

std::vector<ForecastBin> bin_forecasts(const std::vector<TouchDownForecast>& forecasts) {
  std::vector<ForecastBin> bins;
  for (size_t i = 0; i + 1 < kToGo.size(); ++i) {
    std::vector<double> place, time;
    for (const TouchDownForecast& forecast : forecasts) {
      if (forecast.to_go < kToGo[i] || forecast.to_go >= kToGo[i + 1]) continue;
      place.push_back(forecast.place_error);
      time.push_back(forecast.time_error);
    }
    if (place.empty()) continue;
    const Statistics of_place = statistics(place), of_time = statistics(time);
    bins.push_back(
        {kToGo[i], kToGo[i + 1], place.size(), of_place.rms, of_place.median, of_time.rms, of_time.mean});
  }
  return bins;
}

}  // namespace

std::optional<TouchDown> find_touch_down(std::span<const FrameRecord> frames,
                                         std::span<const std::optional<VehicleState>> states) {
  const auto moment = touched(track_of(frames));
  if (!moment) return std::nullopt;
  TouchDown touch_down;
  touch_down.time = seconds(frames.front().timestamp_ns, moment->time_ns);
  touch_down.height = moment->position.z();
  touch_down.place = moment->position.head<2>();
  for (const auto& state : states) {
    if (!state || state->source == StateSource::kLost) continue;
    const double to_go = seconds(state->timestamp_ns, moment->time_ns);
    const Eigen::Vector3d& p = state->pad_from_body.translation;
    const Eigen::Vector3d& v = state->body_velocity_in_pad;
    if (to_go <= 0 || to_go >= kToGo.back() || !(v.z() < -kSlowest)) continue;
    const double said = (p.z() - touch_down.height) / -v.z();
    const Eigen::Vector2d place = p.head<2>() + said * v.head<2>();
    touch_down.forecasts.push_back({to_go, (place - touch_down.place).norm(), said - to_go});
  }
  touch_down.bins = bin_forecasts(touch_down.forecasts);
  return touch_down;
}

}  // namespace perch
