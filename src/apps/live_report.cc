#include "live_report.h"

#include <cstdio>

namespace perch {

uint64_t FrameCounts::all() const {
  const std::lock_guard lock(mutex_);
  uint64_t sum = 0;
  for (const uint64_t count : counts_) sum += count;
  return sum;
}

uint64_t FrameCounts::of(EstimateStatus status) const {
  const std::lock_guard lock(mutex_);
  return counts_[static_cast<size_t>(status)];
}

nlohmann::ordered_json FrameCounts::json() const {
  const std::lock_guard lock(mutex_);
  nlohmann::ordered_json json;
  for (size_t i = 0; i < counts_.size(); ++i) json[to_string(static_cast<EstimateStatus>(i))] = counts_[i];
  return json;
}

std::string latency_text(const LiveHistograms& histograms) {
  std::string text;
  for (size_t i = 0; i < kLiveStages; ++i) {
    const LatencyHistogram& histogram = histograms[i];
    if (histogram.count() == 0) continue;
    char part[96];
    std::snprintf(part, sizeof(part), "%s%s %.2f/%.2f/%.2f", text.empty() ? "" : ", ", kLiveStageNames[i],
                  histogram.quantile_us(0.5) * 1e-3, histogram.quantile_us(0.99) * 1e-3,
                  histogram.worst_us() * 1e-3);
    text += part;
  }
  return text.empty() ? text : text + " ms (median/99 %/worst)";
}

nlohmann::ordered_json latency_json(const LiveHistograms& histograms) {
  nlohmann::ordered_json json;
  for (size_t i = 0; i < kLiveStages; ++i) {
    const LatencyHistogram& histogram = histograms[i];
    json[kLiveStageNames[i]] = {{"count", histogram.count()},
                                {"median", histogram.quantile_us(0.5)},
                                {"p99", histogram.quantile_us(0.99)},
                                {"worst", histogram.worst_us()}};
  }
  return json;
}

nlohmann::ordered_json camera_json(const LiveCounters& counters) {
  return {{"frames", counters.frames},           {"dropped", counters.dropped},
          {"settling", counters.settling},       {"reopened", counters.reopened},
          {"open_failed", counters.open_failed}, {"resized", counters.resized},
          {"stalled", counters.stalled},         {"last_problem", counters.last_problem}};
}

}  // namespace perch
