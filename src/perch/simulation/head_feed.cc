#include "perch/simulation/head_feed.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace perch {
namespace {

constexpr size_t kMost = 256;
constexpr int64_t kNear = 20'000'000;

}  // namespace

void HeadFeed::take(const Chunk& chunk) {
  const std::string line(chunk.bytes.begin(), chunk.bytes.end());
  long long time_ns = 0;
  double pan = 0, tilt = 0, zoom = 0;
  if (std::sscanf(line.c_str(), "%lld %lf %lf %lf", &time_ns, &pan, &tilt, &zoom) != 4) return;
  if (!std::isfinite(pan) || !std::isfinite(tilt) || !(zoom >= 0 && zoom <= 1)) return;
  if (!told_.empty() && time_ns <= told_.back().time_ns) return;
  told_.push_back({time_ns, {pan, tilt}, zoom});
  if (told_.size() > kMost) told_.pop_front();
}

void HeadFeed::take_in() {
  bool more = true;
  while (more) {
    more = false;
    stream_.run(std::chrono::nanoseconds(0), [&](const Chunk& chunk) {
      take(chunk);
      more = true;
    });
  }
}

std::optional<HeadFeed::Told> HeadFeed::at(int64_t time_ns) {
  take_in();
  const auto after = std::lower_bound(told_.begin(), told_.end(), time_ns,
                                      [](const Told& told, int64_t t) { return told.time_ns < t; });
  const auto near = [&](const Told& told) { return std::abs(told.time_ns - time_ns) <= kNear; };
  if (after == told_.end())
    return !told_.empty() && near(told_.back()) ? std::optional(told_.back()) : std::nullopt;
  if (after == told_.begin()) return near(*after) ? std::optional(*after) : std::nullopt;
  const Told& a = *std::prev(after);
  const Told& b = *after;
  if (!near(a) || !near(b)) return std::nullopt;
  const double s = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
  const auto between = [&](double from, double to) { return from + s * (to - from); };
  return Told{time_ns,
              {between(a.angles.pan, b.angles.pan), between(a.angles.tilt, b.angles.tilt)},
              between(a.zoom, b.zoom)};
}

}  // namespace perch
