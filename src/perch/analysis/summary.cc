#include "perch/analysis/summary.h"

#include <cmath>
#include <cstdio>

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

Json curves_json(const std::vector<ErrorCurve>& curves) {
  Json json = Json::array();
  for (const ErrorCurve& curve : curves) {
    Json bins = Json::array();
    for (const ErrorBin& bin : curve.bins) {
      bins.push_back({{"from", number(bin.from)},
                      {"to", number(bin.to)},
                      {"frames", bin.count},
                      {"position_rms_m", number(bin.position_rms)},
                      {"position_rms_low_m", number(bin.position_low)},
                      {"position_rms_high_m", number(bin.position_high)},
                      {"position_median_m", number(bin.position_median)},
                      {"rotation_rms_rad", number(bin.rotation_rms)}});
    }
    json.push_back({{"by", curve.by}, {"unit", curve.unit}, {"bins", bins}});
  }
  return json;
}

Json touch_down_json(const std::optional<TouchDown>& touch_down) {
  if (!touch_down) return nullptr;
  Json bins = Json::array();
  for (const ForecastBin& bin : touch_down->bins) {
    bins.push_back({{"from_s", bin.from},
                    {"to_s", bin.to},
                    {"frames", bin.count},
                    {"place_rms_m", number(bin.place_rms)},
                    {"place_median_m", number(bin.place_median)},
                    {"time_rms_s", number(bin.time_rms)},
                    {"time_mean_s", number(bin.time_mean)}});
  }
  return {{"at_s", number(touch_down->time)},
          {"height_m", number(touch_down->height)},
          {"place_m", {number(touch_down->place.x()), number(touch_down->place.y())}},
          {"forecasts", bins}};
}

Json consistency_json(const Consistency& c) {
  return {{"reference", c.by_truth ? "truth" : "navigation"},
          {"target_in_camera_over_range_rms", number(c.seen_over_range_rms)},
          {"frames", c.nees.count},
          {"mean_nees", number(c.nees.mean)},
          {"expected_nees", 6},
          {"mean_nees_bounds_95", {number(c.nees.lower), number(c.nees.upper)}},
          {"fraction_of_frames_inside_95", number(c.nees.fraction_inside)},
          {"innovations", c.nis.count},
          {"mean_nis", number(c.nis.mean)},
          {"mean_nis_bounds_95", {number(c.nis.lower), number(c.nis.upper)}},
          {"fraction_of_innovations_inside_95", number(c.nis.fraction_inside)}};
}

Json truth_json(const std::optional<TruthScore>& truth) {
  if (!truth) return nullptr;
  return {{"frames", truth->position.count},
          {"position_m", size_json(truth->position)},
          {"rotation_rad", size_json(truth->rotation)},
          {"position_over_range_rms", number(truth->relative_position_rms)}};
}

Json attribution_json(const Attribution& a) {
  if (a.count == 0) return nullptr;
  Json causes = Json::array();
  for (const ErrorCause& cause : a.causes) {
    causes.push_back({{"cause", cause.cause},
                      {"unit", cause.unit},
                      {"value", cause.value},
                      {"sigma", cause.sigma},
                      {"alone_explains", number(cause.alone)},
                      {"only_it_explains", number(cause.only_by_this)}});
  }
  return {{"frames", a.count},
          {"position_rms_m", number(a.position_rms)},
          {"position_noise_rms_m", number(a.position_noise)},
          {"rotation_rms_rad", number(a.rotation_rms)},
          {"rotation_noise_rms_rad", number(a.rotation_noise)},
          {"causes", causes}};
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

Json conditions_json(const FlightScore& score) {
  const Conditions& c = score.conditions;
  return {{"camera", score.camera},
          {"rate_hz", number(c.rate_hz)},
          {"median_range_m", number(c.range)},
          {"median_view_angle_rad", number(c.view_angle)},
          {"median_speed_m_s", number(c.speed)},
          {"median_white", number(c.white)},
          {"median_visible", number(c.visible)}};
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
          {"start_ns", score.frames.empty() ? Json(nullptr) : Json(score.frames.front().timestamp_ns)},
          {"duration_s", number(duration)},
          {"conditions", conditions_json(score)},
          {"detection", detection_json(score.detections)},
          {"comparison", to_string(score.comparison)},
          {"compared_frames", compared},
          {"errors", errors_json(score)},
          {"error_curves", curves_json(score.curves)},
          {"touch_down", touch_down_json(score.touch_down)},
          {"truth", truth_json(score.truth)},
          {"consistency", consistency_json(score.consistency)},
          {"attribution", attribution_json(score.attribution)},
          {"reprojection_rms_px", size_json(score.reprojection_px)},
          {"stages", stages_json(score.costs)},
          {"total_us", size_json(score.costs.total_us)},
          {"problems", score.problems}};
}

const std::vector<SummaryColumn>& summary_columns() {
  using At = Json::json_pointer;
  static const std::vector<SummaryColumn> columns = [] {
    std::vector<SummaryColumn> c = {{"flight", "", At("/flight")},
                                    {"comparison", "", At("/comparison")},
                                    {"frames", "", At("/frames")},
                                    {"ok", "", At("/detection/counts/ok")},
                                    {"detection_rate", "[]", At("/detection/rate")},
                                    {"compared_frames", "", At("/compared_frames")}};
    for (const std::string kind : {"rms", "dc_offset", "rms_without_dc_offset"}) {
      for (size_t i = 0; i < 6; ++i) {
        const std::string state(kStateNames[i]);
        c.push_back({state + '_' + kind, is_angle(i) ? "[rad]" : "[m]", At("/errors/" + state + '/' + kind)});
      }
    }
    for (const std::string kind : {"rms", "median", "p95", "max"}) {
      c.push_back({"position_" + kind, "[m]", At("/errors/position_m/" + kind)});
    }
    c.push_back({"rotation_rms", "[rad]", At("/errors/rotation_rad/rms")});
    c.push_back({"position_over_range_rms", "[]", At("/errors/position_over_range_rms")});
    c.push_back({"mean_nees", "[]", At("/consistency/mean_nees")});
    c.push_back({"nees_inside_95", "[]", At("/consistency/fraction_of_frames_inside_95")});
    c.push_back({"mean_nis", "[]", At("/consistency/mean_nis")});
    c.push_back({"reprojection_rms", "[px]", At("/reprojection_rms_px/rms")});
    c.push_back({"total_mean", "[us]", At("/total_us/mean")});
    c.push_back({"total_p99", "[us]", At("/total_us/p99")});
    c.push_back({"problems", "", At("/problems")});
    return c;
  }();
  return columns;
}

Json value_of(const Json& summary, const SummaryColumn& column) {
  if (!summary.contains(column.at)) return nullptr;
  const Json& value = summary[column.at];
  return value.is_array() ? Json(value.size()) : value;
}

std::string summary_csv_header() {
  std::string csv;
  for (const SummaryColumn& column : summary_columns()) {
    csv += (csv.empty() ? "" : ",") + column.name + (column.unit.empty() ? "" : ' ' + column.unit);
  }
  return csv + '\n';
}

std::string summary_csv_row(const Json& summary) {
  std::string csv;
  for (const SummaryColumn& column : summary_columns()) {
    const Json value = value_of(summary, column);
    if (value.is_number_float()) {
      csv += csv_number(value.get<double>());
    } else {
      csv += ',' + (value.is_string() ? csv_field(value.get<std::string>())
                    : value.is_null() ? std::string()
                                      : to_text(value));
    }
  }
  return csv.substr(1) + '\n';
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
