#include "calib/mount/mount_report.h"

#include <cmath>

#include "calib/mount/mount_covariance.h"
#include "calib/mount/observability.h"
#include "calib/mount/wander.h"
#include "perch/analysis/page.h"
#include "perch/analysis/page_assets.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kMostPoints = 2000;  // of a flight on the page: more cannot be told apart

// To five digits.
Json number(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0) return 0;
  const double decade = std::pow(10, 4 - std::floor(std::log10(std::abs(value))));
  return std::round(value * decade) / decade;
}

Json point(const Eigen::Vector3d& p) { return {number(p.x()), number(p.y()), number(p.z())}; }

// m to cm, rad to degrees.
double shown(Eigen::Index axis) { return axis < 3 ? 100 : kDegFromRad; }

Json six(const Vector6d& values) {
  Json json = Json::array();
  for (Eigen::Index i = 0; i < 6; ++i) json.push_back(number(shown(i) * values[i]));
  return json;
}

Json scatter(const PadScatter& s) { return {number(1000 * s.position), number(kDegFromRad * s.rotation)}; }

using Errors = std::vector<std::optional<PoseError>>;

// Mean and RMS of the used pictures' errors.
std::pair<Vector6d, Vector6d> mean_and_rms(const Errors& errors, const std::vector<bool>& used) {
  Vector6d sum = Vector6d::Zero(), squares = sum;
  double n = 0;
  for (size_t i = 0; i < errors.size(); ++i) {
    if (!used[i] || !errors[i]) continue;
    sum += *errors[i];
    squares += errors[i]->cwiseAbs2();
    ++n;
  }
  return {sum / n, (squares / n).cwiseSqrt()};
}

// One list an axis, of the pictures in `shown_pictures`.
Json columns(const Errors& errors, const std::vector<size_t>& shown_pictures) {
  Json json = Json::array();
  for (Eigen::Index axis = 0; axis < 6; ++axis) {
    Json column = Json::array();
    for (const size_t i : shown_pictures) {
      column.push_back(errors[i] ? number(shown(axis) * (*errors[i])[axis]) : Json(nullptr));
    }
    json.push_back(column);
  }
  return json;
}

Json flight_json(const MountProblem& problem, const MountSolution& s, size_t f) {
  const MountFlight& flight = problem.flights[f];
  const FlightFit& fit = s.flights[f];
  const double offset = s.state.offsets[offset_of_flight(s.state, f)];
  std::vector<size_t> pictures;
  for (size_t i = 0; i < fit.used.size(); ++i) {
    if (fit.used[i] && fit.after[i]) pictures.push_back(i);
  }
  const auto used = pictures.size();
  if (used > kMostPoints) {
    std::vector<size_t> some;
    for (size_t k = 0; k < kMostPoints; ++k) some.push_back(pictures[k * used / kMostPoints]);
    pictures = some;
  }
  // The paths in the pad frame.
  const Rigid3 pad_from_world = inverse(s.state.pads[pad_of_flight(s.state, f)]);
  Json time = Json::array(), navigation = Json::array(), vision = Json::array();
  for (const size_t i : pictures) {
    const int64_t ns = flight.sightings[i].timestamp_ns;
    time.push_back(number(1e-9 * static_cast<double>(ns - flight.sightings.front().timestamp_ns)));
    const auto nav = fit.trajectory.at(ns - std::llround(1e9 * offset));
    if (!nav) continue;
    const Eigen::Vector3d& place = nav->world_from_body.translation;
    navigation.push_back(point(pad_from_world * place));
    vision.push_back(point(pad_from_world * (place - fit.after[i]->head<3>())));
  }
  const auto [dc_before, rms_before] = mean_and_rms(fit.before, fit.used);
  const auto [dc_after, rms_after] = mean_and_rms(fit.after, fit.used);
  return {{"name", flight.name},
          {"pictures", flight.sightings.size()},
          {"used", used},
          {"offset_ms", number(1000 * offset)},
          {"wander", in_words(wander(problem, s, f))},
          {"scatter_before", scatter(pad_scatter(problem, s, f, s.start))},
          {"scatter_after", scatter(pad_scatter(problem, s, f, s.state))},
          {"dc_before", six(dc_before)},
          {"dc_after", six(dc_after)},
          {"rms_before", six(rms_before)},
          {"rms_after", six(rms_after)},
          {"time_s", time},
          {"before", columns(fit.before, pictures)},
          {"after", columns(fit.after, pictures)},
          {"path", {{"navigation", navigation}, {"vision", vision}}}};
}

// What is shown of a parameter's values is multiplied by.
std::pair<double, const char*> unit_of(const std::string& name) {
  const auto has = [&](const char* word) { return name.find(word) != std::string::npos; };
  if (has("rotation") || has("direction")) return {kDegFromRad, "°"};
  if (has("scale")) return {100, "%"};
  if (has("offset") || has("latency")) return {1000, "ms"};
  return {1000, "mm"};
}

// Each parameter's value, NaN of a rotation about an axis, and what it has changed by since the start.
struct Values {
  Eigen::VectorXd value, change;
};

Values values_of(const MountSolution& s) {
  const auto n = static_cast<Eigen::Index>(s.names.size());
  Values v{Eigen::VectorXd::Constant(n, NAN), Eigen::VectorXd::Constant(n, NAN)};
  Eigen::Index row = 0;
  const auto add_pose = [&](const Rigid3& start, const Rigid3& found) {
    v.value.segment<3>(row) = found.translation;
    v.change.segment<6>(row) = pose_error(start, found);
    row += 6;
  };
  add_pose(s.start.mount, s.state.mount);
  for (size_t i = 0; i < s.state.pads.size(); ++i) add_pose(s.start.pads[i], s.state.pads[i]);
  for (size_t i = 0; i < s.state.offsets.size(); ++i, ++row) {
    v.value[row] = s.state.offsets[i];
    v.change[row] = s.state.offsets[i] - s.start.offsets[i];
  }
  // A head's are changes by themselves.
  if (row < n) v.change.tail(n - row) = s.state.head.head(n - row);
  return v;
}

Json parameters_json(const MountSolution& s) {
  Json parameters = Json::array();
  const Values values = values_of(s);
  const Eigen::VectorXd sigma = s.covariance.diagonal().cwiseSqrt(),
                        alone = covariance_of(s.information).diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    const std::string& name = s.names[static_cast<size_t>(i)];
    const auto [scale, unit] = unit_of(name);
    parameters.push_back({{"name", name},
                          {"value", number(scale * values.value[i])},
                          {"change", number(scale * values.change[i])},
                          {"sigma", number(scale * sigma[i])},
                          {"alone", number(scale * alone[i])},
                          {"unit", unit}});
  }
  return parameters;
}

Json correlation_json(const Eigen::MatrixXd& covariance) {
  Json correlation = Json::array();
  const Eigen::VectorXd sigma = covariance.diagonal().cwiseSqrt();
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    Json row = Json::array();
    for (Eigen::Index k = 0; k < sigma.size(); ++k) {
      row.push_back(number(covariance(i, k) / (sigma[i] * sigma[k])));
    }
    correlation.push_back(row);
  }
  return correlation;
}

Json held_out_json(const HeldOut& part) {
  Json json = {{"problem", part.problem},
               {"moved_mm", number(1000 * part.moved)},
               {"turned_deg", number(kDegFromRad * part.turned)},
               {"moved_sigmas", number(part.moved_sigmas)},
               {"within", Json::array()},
               {"beyond", Json::array()}};
  for (const PadScatter& s : part.within) json["within"].push_back(scatter(s));
  for (const PadScatter& s : part.beyond) json["beyond"].push_back(scatter(s));
  return json;
}

Json page_json(const MountProblem& problem, const MountSolution& s, const std::vector<HeldOut>& held_out,
               const std::string& yaml, const nlohmann::json& pad) {
  Json costs = Json::array(), effect = Json::array(), not_told = Json::array(), held = Json::array(),
       flights = Json::array();
  for (const OffsetCost& c : s.offset_costs) costs.push_back({number(1000 * c.offset), number(c.cost)});
  for (const double range : {1.0, 5.0, 10.0}) {
    const MountEffect e = mount_effect(s, problem.chain, range);
    effect.push_back({range, number(1000 * e.position), number(kDegFromRad * e.rotation)});
  }
  for (const Untold& u : untold(s, problem.options)) not_told.push_back(in_words(u));
  for (const HeldOut& part : held_out) held.push_back(held_out_json(part));
  for (size_t f = 0; f < problem.flights.size(); ++f) flights.push_back(flight_json(problem, s, f));
  return {{"parameters", parameters_json(s)},
          {"correlation", correlation_json(s.covariance)},
          {"chi_square", number(s.chi_square / s.degrees)},
          {"offset_costs", costs},
          {"effect", effect},
          {"untold", not_told},
          {"held_out", held},
          {"flights", flights},
          {"pad", pad},
          {"yaml", yaml}};
}

}  // namespace

std::string mount_report_html(const MountProblem& problem, const MountSolution& solution,
                              const std::vector<HeldOut>& held_out, const std::string& yaml,
                              const nlohmann::json& pad) {
  std::string html = page_head("Perch mount calibration", PageScripts::kInline);
  const auto add = [&html](std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts) html += part;
  };
  add({"<style>\n", kReportCss, "</style>\n</head>\n<body>\n<main id=\"report\"></main>\n"});
  add(
      {"<noscript>This report draws its plots with JavaScript; the same numbers are in the file of "
       "--json.</noscript>\n"});
  add({"<script id=\"calibration\" type=\"application/json\">",
       script_json(page_json(problem, solution, held_out, yaml, pad)), "</script>\n"});
  add({"<script>\n", kMountJs, "</script>\n</body>\n</html>\n"});
  return html;
}

}  // namespace perch
