#include "perch/analysis/stage_costs.h"

#include <algorithm>
#include <numeric>

namespace perch {

StageCosts measure_stage_costs(std::span<const Estimate> estimates) {
  struct Times {
    std::string_view stage;
    std::vector<double> us;
  };
  std::vector<Times> stages;
  const auto times_of = [&stages](std::string_view stage) -> std::vector<double>& {
    const auto found =
        std::find_if(stages.begin(), stages.end(), [&](const Times& t) { return t.stage == stage; });
    return found != stages.end() ? found->us : stages.emplace_back(Times{stage, {}}).us;
  };

  std::vector<double> totals, others;
  for (const Estimate& estimate : estimates) {
    if (estimate.status == EstimateStatus::kUnreadable) continue;
    double rest = estimate.total_us;
    for (const StageTime& time : estimate.stages) {
      times_of(time.stage).push_back(time.us);
      rest -= time.us;
    }
    totals.push_back(estimate.total_us);
    // The clock's rounding can leave less than nothing.
    others.push_back(std::max(0.0, rest));
  }
  if (!stages.empty()) stages.push_back({"other", std::move(others)});

  StageCosts costs;
  costs.total_us = statistics(totals);
  const double all_us = std::accumulate(totals.begin(), totals.end(), 0.0);
  for (const Times& times : stages) {
    const double sum_us = std::accumulate(times.us.begin(), times.us.end(), 0.0);
    costs.stages.push_back(
        {std::string(times.stage), statistics(times.us), all_us > 0 ? sum_us / all_us : 0});
  }
  return costs;
}

}  // namespace perch
