#include "perch/analysis/score.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Of a reference without an attitude there is none.
void add_known(double value, std::vector<double>& values) {
  if (std::isfinite(value)) values.push_back(value);
}

NormalisedErrors check_normalised(std::span<const double> values) {
  NormalisedErrors checked;
  checked.count = values.size();
  if (values.empty()) return checked;
  double sum = 0;
  size_t inside = 0;
  for (const double value : values) {
    sum += value;
    if (kChiSquareLower <= value && value <= kChiSquareUpper) ++inside;
  }
  const auto n = static_cast<double>(values.size());
  const int degrees_of_freedom = 6 * static_cast<int>(values.size());
  checked.mean = sum / n;
  checked.lower = chi_square_quantile(0.025, degrees_of_freedom) / n;
  checked.upper = chi_square_quantile(0.975, degrees_of_freedom) / n;
  checked.fraction_inside = static_cast<double>(inside) / n;
  return checked;
}

// Against the truth where `has_truth`, else against navigation, which may be the truth itself.
Consistency check_consistency(std::span<const FrameRecord> frames, bool has_truth, bool nav_is_truth) {
  Consistency consistency;
  consistency.by_truth = has_truth || nav_is_truth;
  std::vector<double> seen, nees, nis;
  for (const FrameRecord& frame : frames) {
    if (frame.nis && std::isfinite(*frame.nis)) nis.push_back(*frame.nis);
    const auto& error = error_of(frame, has_truth);
    if (!error) continue;
    if (frame.range > 0) add_known(error->seen_position / frame.range, seen);
    if (error->nees) nees.push_back(*error->nees);
  }
  consistency.seen_over_range_rms = statistics(seen).rms;
  consistency.nees = check_normalised(nees);
  consistency.nis = check_normalised(nis);
  return consistency;
}

Comparison comparison_of(const FlightResult& result, bool any_compared) {
  if (any_compared) return Comparison::kCompared;
  if (result.flight.nav.samples.empty()) return Comparison::kNoNavigation;
  if (!result.chain.world_from_pad) return Comparison::kNoWorldFromPad;
  return Comparison::kNoCommonTime;
}

void score_errors(const std::vector<const FrameRecord*>& compared, FlightScore& score) {
  std::array<std::vector<double>, 6> states;
  std::vector<double> position, rotation, relative;
  for (const FrameRecord* frame : compared) {
    for (size_t i = 0; i < 6; ++i)
      add_known(frame->error->difference[static_cast<Eigen::Index>(i)], states[i]);
    position.push_back(frame->error->position);
    add_known(frame->error->rotation, rotation);
    if (frame->range > 0) relative.push_back(frame->error->position / frame->range);
  }
  for (size_t i = 0; i < 6; ++i) {
    score.states[i] = is_angle(i) ? angle_statistics(states[i]) : statistics(states[i]);
  }
  score.position = statistics(position);
  score.rotation = statistics(rotation);
  score.relative_position_rms = statistics(relative).rms;
}

std::optional<TruthScore> score_truth(const std::vector<FrameRecord>& frames) {
  std::vector<double> position, rotation, relative;
  for (const FrameRecord& frame : frames) {
    if (!frame.truth_error) continue;
    position.push_back(frame.truth_error->position);
    rotation.push_back(frame.truth_error->rotation);
    if (frame.range > 0) relative.push_back(frame.truth_error->position / frame.range);
  }
  if (position.empty()) return std::nullopt;
  return TruthScore{statistics(position), statistics(rotation), statistics(relative).rms};
}

Conditions conditions_of(const std::vector<FrameRecord>& frames) {
  std::vector<double> intervals;
  for (size_t i = 1; i < frames.size(); ++i)
    intervals.push_back(1e-9 * static_cast<double>(frames[i].timestamp_ns - frames[i - 1].timestamp_ns));
  const auto median = [&](const auto& value_of) {
    std::vector<double> values;
    for (const FrameRecord& frame : frames) {
      if (const double value = value_of(frame); std::isfinite(value)) values.push_back(value);
    }
    return quantile(std::move(values), 0.5);
  };
  const TargetLook unseen{std::nan(""), std::nan(""), std::nan("")};
  return {.rate_hz = 1 / quantile(intervals, 0.5),
          .range = median([](const FrameRecord& f) { return f.range; }),
          .view_angle = median([](const FrameRecord& f) { return f.view_angle; }),
          .speed = median([](const FrameRecord& f) { return f.speed; }),
          .white = median([&](const FrameRecord& f) { return f.look.value_or(unseen).white; }),
          .visible = median([&](const FrameRecord& f) { return f.look.value_or(unseen).visible; })};
}

}  // namespace

const char* to_string(Comparison comparison) {
  switch (comparison) {
    case Comparison::kCompared:
      return "compared";
    case Comparison::kNoNavigation:
      return "no navigation";
    case Comparison::kNoWorldFromPad:
      return "no world_from_pad";
    case Comparison::kNoCommonTime:
      return "no detected frame within the navigation's time";
    case Comparison::kNotEstimated:
      return "not estimated";
  }
  return "";
}

FlightScore score_flight(const FlightResult& result) {
  FlightScore score;
  score.name = result.flight.name;
  score.target = result.target;
  score.camera = result.camera;
  score.frame_names = result.frame_names;
  score.frame_names.resize(result.estimates.size());
  score.problems = result.flight.problems;
  score.problems.insert(score.problems.end(), result.problems.begin(), result.problems.end());

  score.frames.reserve(result.estimates.size());
  std::vector<std::optional<VehicleState>> states;
  for (size_t i = 0; i < result.estimates.size(); ++i) {
    const Estimate& estimate = result.estimates[i];
    score.frames.push_back(make_frame_record(estimate, result.chain, result.flight));
    if (i < result.greys.size()) score.frames.back().grey = result.greys[i];
    if (i < result.looks.size()) score.frames.back().look = result.looks[i];
    if (!estimate.problem.empty()) score.problems.push_back(estimate.problem);
    states.push_back(estimate.state);
  }
  score.conditions = conditions_of(score.frames);
  std::vector<const FrameRecord*> compared;
  std::vector<double> reprojection_px;
  for (const FrameRecord& frame : score.frames) {
    if (frame.vision) reprojection_px.push_back(frame.reprojection_rms_px);
    if (frame.error) compared.push_back(&frame);
  }
  score.comparison = comparison_of(result, !compared.empty());
  score_errors(compared, score);
  score.truth = score_truth(score.frames);
  score.curves = error_curves(score.frames, score.truth.has_value());
  score.touch_down = find_touch_down(score.frames, states);
  score.consistency = check_consistency(score.frames, score.truth.has_value(), result.flight.nav_is_truth);
  score.attribution = attribute_errors(result.estimates, result.chain, result.flight);
  score.reprojection_px = statistics(reprojection_px);
  score.detections = count_detections(score.frames);
  score.costs = measure_stage_costs(result.estimates);
  return score;
}

FlightScore failed_flight(const std::string& name, const std::string& problem) {
  FlightScore score;
  score.name = name;
  score.problems = {problem};
  score.comparison = Comparison::kNotEstimated;
  return score;
}

std::vector<ShownFrame> frames_to_show(const FlightScore& score) {
  const bool by_error = score.comparison == Comparison::kCompared;
  const auto badness = [&](size_t i) {
    return by_error ? score.frames[i].error->position : score.frames[i].reprojection_rms_px;
  };
  std::vector<size_t> order;
  for (size_t i = 0; i < score.frames.size(); ++i) {
    if (by_error ? score.frames[i].error.has_value() : score.frames[i].vision.has_value()) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return badness(a) < badness(b); });

  std::vector<ShownFrame> shown;
  if (!order.empty()) shown.push_back({order.front(), "best"});
  if (order.size() > 2) shown.push_back({order[order.size() / 2], "median"});
  if (order.size() > 1) shown.push_back({order.back(), "worst"});

  const auto seen = [](const Gap& gap) {
    return gap.frames - gap.reasons[static_cast<size_t>(EstimateStatus::kUnreadable)];
  };
  const auto longest = std::max_element(score.detections.gaps.begin(), score.detections.gaps.end(),
                                        [&](const Gap& a, const Gap& b) { return seen(a) < seen(b); });
  if (longest != score.detections.gaps.end() && seen(*longest) > 0) {
    size_t frame = longest->first_frame + longest->frames / 2;
    // Pictures that cannot be read show nothing: the next one round the gap that can.
    while (score.frames[frame].status == EstimateStatus::kUnreadable) {
      frame = frame + 1 < longest->first_frame + longest->frames ? frame + 1 : longest->first_frame;
    }
    shown.push_back({frame, "longest gap"});
  }
  return shown;
}

}  // namespace perch
