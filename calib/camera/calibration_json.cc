#include "calib/camera/calibration_json.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "calib/camera/coverage.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

Json candidate_json(const Candidate& candidate) {
  const LensFit& fit = candidate.fit;
  Json json = {{"lens", fit.lens}, {"regularised", fit.regularised}, {"usable", candidate.usable()}};
  if (!candidate.failure.empty()) json["failure"] = candidate.failure;
  if (fit.intrinsics.empty() || candidate.covariance.matrix.size() == 0) return json;
  std::vector<double> sigmas;
  for (size_t i = 0; i < fit.intrinsics.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    sigmas.push_back(std::sqrt(candidate.covariance.matrix(k, k)));
  }
  json.update({{"intrinsics", fit.intrinsics},
               {"intrinsics_sigma", sigmas},
               {"warp_m", {fit.warp.x(), fit.warp.y()}},
               {"warp_sigma_m", {candidate.covariance.warp_sigma.x(), candidate.covariance.warp_sigma.y()}},
               {"rms_px", fit.rms_px},
               {"sigma_px", fit.sigma_px},
               {"corners", fit.seen},
               {"outliers", fit.outliers},
               {"converged", fit.converged}});
  if (const auto& cross = candidate.cross_validation) {
    json["cross_validation"] = {{"held_out_px", cross->held_out_px},
                                {"difference_px", cross->difference_px},
                                {"predicted_px", cross->predicted_px}};
  }
  return json;
}

Json landing_json(const LandingError& landing) {
  return {{"range_m", landing.range},
          {"mean_m", landing.mean_m},
          {"worst_m", landing.worst_m},
          {"worst_pixel", {landing.worst_pixel.x(), landing.worst_pixel.y()}},
          {"mean_rotation_deg", kDegFromRad * landing.mean_rotation},
          {"without_mount_calibration_m", landing.without_mount_calibration_m},
          {"directions", landing.directions}};
}

Json gate_json(const Gate& gate) {
  return {{"key", gate.key},
          {"what", gate.what},
          {"found", gate.found},
          {"limit", gate.limit},
          {"met", gate.met}};
}

Json views_json(const BoardViews& views, const LensFit& fit) {
  Json json = Json::array();
  const auto poses = board_poses(views, fit);
  for (size_t i = 0; i < views.views.size(); ++i) {
    double squares = 0;
    int outliers = 0;
    for (const auto& corner : fit.corners[i]) {
      squares += corner.error_px.squaredNorm();
      outliers += corner.outlier;
    }
    json.push_back({{"picture", views.views[i].picture},
                    {"corners", fit.corners[i].size()},
                    {"outliers", outliers},
                    {"rms_px", std::sqrt(squares / (2 * static_cast<double>(fit.corners[i].size())))},
                    {"distance_m", poses[i].distance},
                    {"tilt_deg", kDegFromRad * poses[i].tilt}});
  }
  return json;
}

}  // namespace

std::string calibration_json_text(const BoardViews& views, const Calibration& calibration,
                                  const Verdict& verdict) {
  Json candidates = Json::array(), landing = Json::array(), gates = Json::array(), suspects = Json::array();
  for (const auto& candidate : calibration.candidates) candidates.push_back(candidate_json(candidate));
  for (const auto& range : verdict.landing) landing.push_back(landing_json(range));
  for (const auto& gate : verdict.gates) gates.push_back(gate_json(gate));
  for (const auto& suspect : verdict.suspects) {
    suspects.push_back({{"picture", views.views[suspect.view].picture},
                        {"rms_px", suspect.rms_px},
                        {"outliers", suspect.outliers},
                        {"why", suspect.why}});
  }
  const Json views_found = views_json(views, calibration.fit());
  const auto worst = std::max_element(
      views_found.begin(), views_found.end(),
      [](const Json& a, const Json& b) { return a["rms_px"].get<double>() < b["rms_px"].get<double>(); });
  const Json json = {
      {"summary", verdict.summary},
      {"width", views.width},
      {"height", views.height},
      {"board",
       {{"columns", views.grid.columns}, {"rows", views.grid.rows}, {"spacing_m", views.grid.spacing}}},
      {"chosen", candidate_json(calibration.best())},
      {"why", calibration.why},
      {"uncertainty_px", verdict.uncertainty_px},
      {"corner_px", verdict.corner_px},
      {"coverage", verdict.coverage},
      {"halves_ratio", verdict.halves_ratio},
      {"row_shear_px", verdict.row_shear.shift_px},
      {"row_shear_gain", verdict.row_shear.median_gain},
      {"seed_spread_px", calibration.seed_spread_px},
      {"landing", landing},
      {"recommended", gates},
      {"missing", verdict.missing},
      {"warnings", verdict.warnings},
      {"remarks", calibration.remarks},
      {"suspects", suspects},
      {"worst_picture", (*worst)["picture"]},
      {"candidates", candidates},
      {"views", views_found}};
  // A file's name need not be UTF-8.
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_calibration_json(const std::filesystem::path& file, const BoardViews& views,
                            const Calibration& calibration, const Verdict& verdict) {
  std::ofstream stream(file, std::ios::binary);
  stream << calibration_json_text(views, calibration, verdict);
  stream.close();
  if (!stream) throw CalibrationError(file.string() + ": cannot be written");
}

}  // namespace perch
