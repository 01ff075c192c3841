#include "calib/camera/verdict.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>

#include "calib/camera/coverage.h"
#include "perch/camera/c_numbers.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

constexpr int kColumns = 24, kRows = 18;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string number(double value, const char* format = "%.2g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string length(double m) { return m < 0.1 ? number(1000 * m, "%.1f") + " mm" : number(m, "%.2f") + " m"; }

struct Key {
  const char* key;
  const char* what;
  std::optional<double> Requirements::*limit;
  bool at_least;
};
constexpr std::array<Key, 7> kKeys{{
    {"uncertainty_px", "uncertainty at infinity on 95 % of the picture where boards have been, px",
     &Requirements::max_uncertainty_px, false},
    {"corner_px", "uncertainty at infinity anywhere in the picture, px", &Requirements::max_corner_px, false},
    {"halves_ratio", "difference of the lenses solved from halves, in what their uncertainties predict",
     &Requirements::max_halves_ratio, false},
    {"sigma_px", "noise of the corners, px", &Requirements::max_sigma_px, false},
    {"outliers", "part of the corners rejected", &Requirements::max_outliers, false},
    {"coverage", "part of the picture where boards have been", &Requirements::min_coverage, true},
    {"landing_m", "contribution to the landing error at the farthest range, m", &Requirements::max_landing_m,
     false},
}};

double found(const std::string& key, const Verdict& verdict, const Calibration& calibration) {
  if (key == "uncertainty_px") return verdict.uncertainty_px;
  if (key == "corner_px") return verdict.corner_px;
  if (key == "halves_ratio") return verdict.halves_ratio;
  if (key == "sigma_px") return calibration.fit().sigma_px;
  if (key == "outliers") return verdict.outliers;
  if (key == "coverage") return verdict.coverage;
  const auto far = std::ranges::max_element(verdict.landing, {}, &LandingError::range);
  return far == verdict.landing.end() || far->directions == 0 ? kNaN : far->mean_m;
}

// 95 % of the covered places are below the first, all places of the picture below the second.
void look_at_uncertainty(const BoardViews& views, const Candidate& best, Verdict& verdict) {
  const SensorMap map = uncertainty_map(best.fit, best.covariance, kAtInfinity, kColumns, kRows);
  const auto covered = covered_places(views, kColumns, kRows);
  std::vector<double> within;
  for (size_t i = 0; i < covered.size(); ++i) {
    // Not invertible there: as uncertain as can be.
    const double sigma =
        std::isfinite(map.values[i]) ? map.values[i] : std::numeric_limits<double>::infinity();
    if (covered[i]) within.push_back(sigma);
    verdict.corner_px = std::max(verdict.corner_px, sigma);
  }
  verdict.coverage = static_cast<double>(within.size()) / static_cast<double>(covered.size());
  std::ranges::sort(within);
  verdict.uncertainty_px = within.empty() ? kNaN : within[within.size() * 95 / 100];
}

// Median of the views' root mean squares, and those that stand out of it.
void look_at_views(const BoardViews& views, const LensFit& fit, Verdict& verdict) {
  constexpr double kStandsOut = 2.5;  // times the median: noise alone makes a view of 20 corners 1.5 in 1000
  constexpr double kManyOutliers = 0.3;
  std::vector<SuspectView> all;
  for (size_t i = 0; i < fit.corners.size(); ++i) {
    SuspectView& view = all.emplace_back();
    view.view = i;
    for (const auto& corner : fit.corners[i]) {
      view.rms_px += corner.error_px.squaredNorm();
      view.outliers += corner.outlier;
    }
    const auto count = static_cast<double>(fit.corners[i].size());
    view.rms_px = std::sqrt(view.rms_px / (2 * count));
    view.outliers /= count;
  }
  std::ranges::sort(all, std::greater{}, &SuspectView::rms_px);
  const double usual = all[all.size() / 2].rms_px;
  for (SuspectView& view : all) {
    if (view.outliers > kManyOutliers) {
      view.why = number(100 * view.outliers, "%.0f") +
                 " % of its corners do not fit: corners taken for others, or a "
                 "board that moved while it was taken.";
    } else if (view.rms_px > kStandsOut * usual) {
      view.why = number(view.rms_px / usual, "%.1f") +
                 " times the usual error: blurred, moved, or corners not where they were taken to be.";
    } else {
      continue;
    }
    verdict.suspects.push_back(view);
  }
  const size_t of = views.views.size();
  if (verdict.suspects.size() * 4 > of) {
    verdict.warnings.push_back(
        std::to_string(verdict.suspects.size()) + " of " + std::to_string(of) +
        " pictures do not fit: is the board's size as it was told, and is the board flat?");
  }
}

// Errors within one cell of the picture that lean the same way tell of a lens that bends differently.
void look_at_regions(const BoardViews& views, const LensFit& fit, Verdict& verdict) {
  constexpr int kCells = 4;
  constexpr double kLimit = 5;  // standard errors of a mean
  std::vector<Eigen::Vector3d> sums(kCells * kCells, Eigen::Vector3d::Zero());
  for (size_t i = 0; i < fit.corners.size(); ++i) {
    for (size_t k = 0; k < fit.corners[i].size(); ++k) {
      if (fit.corners[i][k].outlier) continue;
      const Eigen::Vector2d& p = views.views[i].corners[k].pixel;
      const int x = std::clamp(static_cast<int>(p.x() / views.width * kCells), 0, kCells - 1);
      const int y = std::clamp(static_cast<int>(p.y() / views.height * kCells), 0, kCells - 1);
      const Eigen::Vector2d& e = fit.corners[i][k].error_px;
      sums[static_cast<size_t>(y * kCells + x)] += Eigen::Vector3d(e.x(), e.y(), 1);
    }
  }
  double most = 0;
  int& leaning = verdict.leaning_regions;
  for (const auto& sum : sums) {
    if (sum.z() < 30) continue;
    const double mean = sum.head<2>().norm() / sum.z();
    if (mean < kLimit * fit.sigma_px / std::sqrt(sum.z()) || mean < 0.3 * fit.sigma_px) continue;
    ++leaning;
    most = std::max(most, mean);
  }
  if (leaning > 0) {
    verdict.warnings.push_back("In " + std::to_string(leaning) +
                               " of 16 parts of the picture the errors lean one way, by " + number(most) +
                               " px at most: this lens model does not bend as the lens does. Try a "
                               "richer one (OPENCV8, or SPLINED_STEREOGRAPHIC with 100 pictures or more).");
  }
}

// Where the lens model fits, a picture that is sheared its own way was not taken at one moment.
void look_at_rows(const BoardViews& views, const LensFit& fit, Verdict& verdict) {
  verdict.row_shear = row_shear(views, fit);
  if (!verdict.row_shear.shows() || verdict.leaning_regions > 0) return;
  verdict.warnings.push_back(
      "Each picture is sheared its own way, by " + number(verdict.row_shear.shift_px) +
      " px from its top to its bottom: a rolling shutter does that when camera or board "
      "moves. Hold both still, or use a global shutter.");
}

void look_at_board(const BoardViews& views, const Candidate& best, Verdict& verdict) {
  // Millimetres, most likely.
  if (views.grid.spacing > 1) {
    verdict.warnings.push_back("The board's corners are " + length(views.grid.spacing) +
                               " apart: is that the spacing in metres?");
  }
  const double size = std::max(views.grid.columns, views.grid.rows) * views.grid.spacing;
  const double bend = best.fit.warp.cwiseAbs().maxCoeff();
  if (bend > 0.01 * size) {
    verdict.warnings.push_back(
        "The board's middle is off its edges' plane by " + length(bend) +
        ", more than a hundredth of its size: a board that bends so much bends differently "
        "in every picture. Fix it to something stiff.");
  }
}

std::string summary_of(const Verdict& verdict, const Calibration& calibration) {
  const LensFit& fit = calibration.fit();
  std::string text = calibration.best().name() + " from " + std::to_string(fit.corners.size()) +
                     " pictures, corners good to " + number(fit.sigma_px) + " px: it is known to " +
                     number(verdict.uncertainty_px) +
                     " px on 95 % of the picture where boards have been, and to " +
                     number(verdict.corner_px) + " px at its worst place.";
  for (const auto& landing : verdict.landing) {
    text += landing.directions == 0
                ? " At " + number(landing.range, "%g") + " m the target does not fit into the picture."
                : " At " + number(landing.range, "%g") + " m it contributes " + length(landing.mean_m) +
                      " to the landing error (" + length(landing.worst_m) + " in the worst direction).";
  }
  const auto unmet = std::ranges::count_if(verdict.gates, [](const Gate& gate) { return !gate.met; });
  text += unmet == 0 ? " It meets all that is recommended for landing."
                     : " It misses " + std::to_string(unmet) + " of the " +
                           std::to_string(verdict.gates.size()) + " recommended limits.";
  return text;
}

}  // namespace

Requirements recommended_requirements() {
  return {.max_uncertainty_px = 0.5,
          .max_corner_px = 1.5,
          .max_halves_ratio = 2,
          .max_sigma_px = 0.3,
          .max_outliers = 0.03,
          .min_coverage = 0.8,
          .max_landing_m = {}};
}

Requirements parse_requirements(const std::string& text) {
  if (text == "recommended") return recommended_requirements();
  const CNumbers dot_is_the_decimal_point;
  Requirements requirements;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const size_t equals = part.find('=');
    const std::string name = part.substr(0, equals),
                      value = equals == std::string::npos ? "" : part.substr(equals + 1);
    const auto key = std::ranges::find_if(kKeys, [&](const Key& k) { return k.key == name; });
    if (key == kKeys.end()) {
      std::string known;
      for (const auto& k : kKeys) known += std::string(known.empty() ? "" : ", ") + k.key;
      throw CalibrationError("--require: expected one of " + known + " or recommended, not \"" + name + "\"");
    }
    char* end = nullptr;
    const double limit = std::strtod(value.c_str(), &end);
    if (value.empty() || *end != 0 || !std::isfinite(limit) || limit < 0)
      throw CalibrationError("--require: " + name + ": expected a number of 0 or more, not \"" + value +
                             "\"");
    requirements.*key->limit = limit;
  }
  return requirements;
}

std::vector<Gate> check(const Verdict& verdict, const Calibration& calibration,
                        const Requirements& requirements) {
  std::vector<Gate> gates;
  for (const auto& key : kKeys) {
    const std::optional<double>& limit = requirements.*key.limit;
    if (!limit) continue;
    Gate gate{key.key, key.what, found(key.key, verdict, calibration), *limit, key.at_least, false};
    gate.met = gate.at_least ? gate.found >= gate.limit : gate.found <= gate.limit;  // not so with NaN
    gates.push_back(gate);
  }
  return gates;
}

std::string in_words(const Gate& gate) {
  return gate.what + ": " + (std::isnan(gate.found) ? "unknown" : number(gate.found, "%.3g")) +
         ", asked for at " + (gate.at_least ? "least " : "most ") + number(gate.limit, "%g");
}

Verdict judge(const BoardViews& views, const Calibration& calibration, const LandingTarget& target) {
  const Candidate& best = calibration.best();
  Verdict verdict;
  look_at_uncertainty(views, best, verdict);
  const auto& cross = best.cross_validation;
  verdict.halves_ratio = cross ? cross->difference_px / cross->predicted_px : kNaN;
  verdict.outliers = static_cast<double>(best.fit.outliers) / best.fit.seen;
  for (const double range : calibration.ranges)
    verdict.landing.push_back(landing_error(best.fit, best.covariance, target, range));
  verdict.missing = what_is_missing(views, best.fit);
  look_at_views(views, best.fit, verdict);
  look_at_regions(views, best.fit, verdict);
  look_at_rows(views, best.fit, verdict);
  look_at_board(views, best, verdict);
  if (cross && verdict.halves_ratio > 2) {
    verdict.warnings.push_back("The lenses of the two halves differ " + number(verdict.halves_ratio) +
                               " times as much as their noise explains: something other than noise is in the "
                               "pictures (a moving focus or zoom, a board that bends, a wrong lens model).");
  }
  if (calibration.seed_spread_px > 0.01) {
    verdict.warnings.push_back("Solves from other starts end " + number(calibration.seed_spread_px) +
                               " px elsewhere: the pictures do not decide it.");
  }
  verdict.gates = check(verdict, calibration, recommended_requirements());
  verdict.summary = summary_of(verdict, calibration);
  return verdict;
}

}  // namespace perch
