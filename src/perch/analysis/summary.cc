#include "perch/analysis/summary.h"

#include <cmath>
#include <cstdio>
#include <sstream>

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

// nlohmann writes NaN as null too, but only when dumping: a comparison in memory would still see it.
Json number(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json error_json(const Statistics& s, const char* unit) {
  return {{"unit", unit},
          {"rms", number(s.rms)},
          {"dc_offset", number(s.mean)},
          {"rms_without_dc_offset", number(s.rms_without_mean)},
          {"median", number(s.median)},
          {"p95", number(s.p95)},
          {"max", number(s.max)}};
}

// Of sizes, which have no DC offset.
Json size_json(const Statistics& s) {
  return {{"rms", number(s.rms)}, {"mean", number(s.mean)}, {"median", number(s.median)},
          {"p95", number(s.p95)}, {"p99", number(s.p99)},   {"max", number(s.max)}};
}

Json counts_json(const StatusCounts& counts, bool also_zero) {
  Json json = Json::object();
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0 || also_zero) json[to_string(kStatuses[i])] = counts[i];
  }
  return json;
}

Json detection_json(const Detections& detections) {
  Json gaps = Json::array();
  for (const Gap& gap : detections.gaps) {
    gaps.push_back({{"first_frame", gap.first_frame},
                    {"frames", gap.frames},
                    {"start_s", number(gap.start)},
                    {"duration_s", number(gap.duration)},
                    {"reasons", counts_json(gap.reasons, false)}});
  }
  return {
      {"rate", number(detections.rate)}, {"counts", counts_json(detections.counts, true)}, {"gaps", gaps}};
}

Json errors_json(const FlightScore& score) {
  Json errors = Json::object();
  for (size_t i = 0; i < 6; ++i) {
    errors[std::string(kStateNames[i])] = error_json(score.states[i], is_angle(i) ? "rad" : "m");
  }
  errors["position_m"] = size_json(score.position);
  errors["rotation_rad"] = size_json(score.rotation);
  errors["position_over_range_rms"] = number(score.relative_position_rms);
  return errors;
}

Json bins_json(const std::vector<DistanceBin>& bins) {
  Json json = Json::array();
  for (const DistanceBin& bin : bins) {
    json.push_back({{"from_m", number(bin.from)},
                    {"to_m", number(bin.to)},
                    {"frames", bin.count},
                    {"position_rms_m", number(bin.position_rms)},
                    {"position_median_m", number(bin.position_median)},
                    {"rotation_rms_rad", number(bin.rotation_rms)}});
  }
  return json;
}

Json consistency_json(const Consistency& c) {
  return {{"reference", c.by_truth ? "truth" : "navigation"},
          {"target_in_camera_over_range_rms", number(c.seen_over_range_rms)},
          {"frames", c.count},
          {"mean_nees", number(c.mean_nees)},
          {"expected_nees", 6},
          {"mean_nees_bounds_95", {number(c.lower), number(c.upper)}},
          {"fraction_of_frames_inside_95", number(c.fraction_inside)}};
}

Json truth_json(const std::optional<TruthScore>& truth) {
  if (!truth) return nullptr;
  return {{"frames", truth->position.count},
          {"position_m", size_json(truth->position)},
          {"rotation_rad", size_json(truth->rotation)},
          {"position_over_range_rms", number(truth->relative_position_rms)}};
}

Json stages_json(const StageCosts& costs) {
  Json json = Json::array();
  for (const StageCost& cost : costs.stages) {
    json.push_back({{"stage", cost.stage},
                    {"frames", cost.us.count},
                    {"mean_us", number(cost.us.mean)},
                    {"median_us", number(cost.us.median)},
                    {"p99_us", number(cost.us.p99)},
                    {"share", number(cost.share)}});
  }
  return json;
}

// A field of a CSV, quoted where it must be.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

// ",value" with nine digits, more than any error has; "," where there is no number.
std::string csv_number(double value) {
  if (!std::isfinite(value)) return ",";
  char text[40];
  std::snprintf(text, sizeof(text), ",%.9g", value);
  return text;
}

}  // namespace

nlohmann::ordered_json summary_json(const FlightScore& score) {
  size_t compared = score.position.count;
  const double duration =
      score.frames.empty()
          ? 0
          : 1e-9 * static_cast<double>(score.frames.back().timestamp_ns - score.frames.front().timestamp_ns);
  return {{"flight", score.name},
          {"target", score.target},
          {"frames", score.frames.size()},
          {"duration_s", number(duration)},
          {"detection", detection_json(score.detections)},
          {"comparison", to_string(score.comparison)},
          {"compared_frames", compared},
          {"errors", errors_json(score)},
          {"distance_bins", bins_json(score.bins)},
          {"truth", truth_json(score.truth)},
          {"consistency", consistency_json(score.consistency)},
          {"reprojection_rms_px", size_json(score.reprojection_px)},
          {"stages", stages_json(score.costs)},
          {"total_us", size_json(score.costs.total_us)},
          {"problems", score.problems}};
}

std::string summary_csv_header() {
  std::string csv = "flight,comparison,frames,ok,detection_rate [],compared_frames";
  for (const char* kind : {"rms", "dc_offset", "rms_without_dc_offset"}) {
    for (size_t i = 0; i < 6; ++i) {
      csv += ',';
      csv += kStateNames[i];
      csv += '_';
      csv += kind;
      csv += is_angle(i) ? " [rad]" : " [m]";
    }
  }
  return csv +
         ",position_rms [m],position_median [m],position_p95 [m],position_max [m],rotation_rms [rad]"
         ",position_over_range_rms [],mean_nees [],nees_inside_95 [],reprojection_rms [px]"
         ",total_mean [us],total_p99 [us],problems\n";
}

std::string summary_csv_row(const FlightScore& score) {
  std::ostringstream csv;
  csv << csv_field(score.name) << ',' << to_string(score.comparison) << ',' << score.frames.size() << ','
      << score.detections.counts[0] << csv_number(score.detections.rate) << ',' << score.position.count;
  for (const Statistics& s : score.states) csv << csv_number(s.rms);
  for (const Statistics& s : score.states) csv << csv_number(s.mean);
  for (const Statistics& s : score.states) csv << csv_number(s.rms_without_mean);
  for (const double value :
       {score.position.rms, score.position.median, score.position.p95, score.position.max, score.rotation.rms,
        score.relative_position_rms, score.consistency.mean_nees, score.consistency.fraction_inside,
        score.reprojection_px.rms, score.costs.total_us.mean, score.costs.total_us.p99}) {
    csv << csv_number(value);
  }
  csv << ',' << score.problems.size() << '\n';
  return csv.str();
}

std::string errors_csv(const FlightScore& score) {
  std::string csv = "#timestamp [ns],x [m],y [m],z [m],yaw [rad],pitch [rad],roll [rad],range [m],nees []\n";
  for (const FrameRecord& frame : score.frames) {
    if (!frame.error) continue;
    csv += std::to_string(frame.timestamp_ns);
    for (const double difference : frame.error->difference) csv += csv_number(difference);
    csv += csv_number(frame.range);
    csv += csv_number(frame.error->nees.value_or(std::nan("")));
    csv += '\n';
  }
  return csv;
}

std::string to_text(const nlohmann::ordered_json& json, int indent) {
  return json.dump(indent, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

}  // namespace perch
