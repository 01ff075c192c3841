#include "calib/camera/calibration.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <future>
#include <numeric>

#include "calib/camera/coverage.h"

namespace perch {
namespace {

// Halves of fewer pictures than this are no calibrations.
constexpr size_t kFewestToHalve = 8;
// Of the maps in which halves and models are compared.
constexpr int kColumns = 24, kRows = 18;

std::string short_name(const std::string& lens) {
  constexpr std::string_view kPrefix = "LENSMODEL_";
  return lens.starts_with(kPrefix) ? lens.substr(kPrefix.size()) : lens;
}

std::string rounded(double value, const char* format = "%.3g") {
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::vector<LensSeed> solve_seeds(const BoardViews& views, const CalibrationOptions& options) {
  std::vector<double> guesses = options.focal_guesses_px;
  if (guesses.empty()) {
    for (const double widths : {1.0, 2.5, 6.0}) guesses.push_back(widths * views.width);
  }
  std::vector<LensSeed> seeds;
  std::string failure;
  for (const double guess : guesses) {
    try {
      seeds.push_back(seed_from_focal_length(views, guess));
    } catch (const CalibrationError& e) {
      failure = e.what();
    }
  }
  if (seeds.empty()) throw CalibrationError(failure);
  std::ranges::stable_sort(seeds, {}, &LensSeed::cost);
  return seeds;
}

// The part of a fit that belongs to some of its views.
LensSeed seed_of(const LensSeed& seed, size_t parity) {
  LensSeed part = seed;
  part.camera_from_board.clear();
  for (size_t i = parity; i < seed.camera_from_board.size(); i += 2)
    part.camera_from_board.push_back(seed.camera_from_board[i]);
  return part;
}

BoardViews half_of(const BoardViews& views, size_t parity) {
  BoardViews half = views;
  half.views.clear();
  for (size_t i = parity; i < views.views.size(); i += 2) half.views.push_back(views.views[i]);
  return half;
}

// Mean squared errors by view, over the corners that no fit calls outliers.
std::vector<double> mean_squares(const LensFit& predicted) {
  std::vector<double> squares;
  for (const auto& view : predicted.corners) {
    double sum = 0, count = 0;
    for (const auto& corner : view) {
      if (corner.outlier) continue;
      sum += corner.error_px.squaredNorm();
      count += 2;
    }
    squares.push_back(count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN());
  }
  return squares;
}

// Over the covered places.
double root_mean_square(const SensorMap& map, const std::vector<bool>& covered) {
  double sum = 0, count = 0;
  for (size_t i = 0; i < map.values.size(); ++i) {
    if (!covered[i] || !std::isfinite(map.values[i])) continue;
    sum += map.values[i] * map.values[i];
    ++count;
  }
  return std::sqrt(sum / std::max(1.0, count));
}

CrossValidation cross_validate(const BoardViews& views, const std::string& lens, const LensSeed& seed,
                               const FitOptions& options) {
  CrossValidation result;
  result.by_view.resize(views.views.size());
  LensFit fits[2];
  SensorMap sigma[2];
  const BoardViews halves[2] = {half_of(views, 0), half_of(views, 1)};
  for (size_t k = 0; k < 2; ++k) {
    fits[k] = fit_lens(halves[k], lens, seed_of(seed, k), options);
    sigma[k] = uncertainty_map(fits[k], lens_covariance(halves[k], fits[k]), kAtInfinity, kColumns, kRows);
  }
  for (size_t k = 0; k < 2; ++k) {
    const auto squares = mean_squares(fit_poses(halves[1 - k], fits[k]));
    for (size_t i = 0; i < squares.size(); ++i) result.by_view[2 * i + 1 - k] = squares[i];
  }
  double sum = 0;
  for (const double square : result.by_view) sum += square;
  result.held_out_px = std::sqrt(sum / static_cast<double>(result.by_view.size()));

  SensorMap predicted = sigma[0];
  std::vector<double> weight;
  const auto covered = covered_places(views, kColumns, kRows);
  for (size_t i = 0; i < predicted.values.size(); ++i) {
    predicted.values[i] = std::hypot(sigma[0].values[i], sigma[1].values[i]);
    weight.push_back(covered[i] ? 1 / (predicted.values[i] * predicted.values[i]) : 0);
  }
  result.halves = model_difference(fits[0].model(), fits[1].model(), kColumns, kRows, weight);
  result.difference_px = root_mean_square(result.halves.length, covered);
  result.predicted_px = root_mean_square(predicted, covered);
  return result;
}

// What can be told of a fit, or why nothing can.
LensCovariance covariance_of(const BoardViews& views, const LensFit& fit) {
  try {
    return lens_covariance(views, fit);
  } catch (const CalibrationError& e) {
    const auto missing = what_is_missing(views, fit);
    throw CalibrationError(e.what() + (missing.empty() ? std::string() : ". " + missing.front()));
  }
}

Candidate solve(const BoardViews& views, const std::string& lens, const LensSeed& seed,
                const FitOptions& options) {
  Candidate candidate;
  candidate.fit.lens = lens;
  candidate.fit.regularised = options.regularise;
  try {
    check_views(views, lens);
    candidate.fit = fit_lens(views, lens, seed, options);
    candidate.covariance = covariance_of(views, candidate.fit);
    if (!candidate.fit.converged)
      candidate.failure = "did not come to an end in mrcal's 300 iterations, twice";
    if (views.views.size() >= kFewestToHalve)
      candidate.cross_validation = cross_validate(views, lens, seed, options);
  } catch (const std::exception& e) {
    candidate.failure = e.what();
  }
  return candidate;
}

// Whether the held-out squares of `a` are above those of `b` by no more than the mean difference's standard
// error.
bool is_as_good(const CrossValidation& a, const CrossValidation& b) {
  const auto n = static_cast<double>(a.by_view.size());
  double sum = 0, squares = 0;
  for (size_t i = 0; i < a.by_view.size(); ++i) sum += a.by_view[i] - b.by_view[i];
  for (size_t i = 0; i < a.by_view.size(); ++i) squares += std::pow(a.by_view[i] - b.by_view[i] - sum / n, 2);
  return sum / n <= std::sqrt(squares / (n - 1) / n);
}

// The leanest within one standard error of the best. Only regularised ones compete: what holds a lens
// together where no board has been is no part of the question how many unknowns it needs.
void choose(Calibration& calibration) {
  const auto& all = calibration.candidates;
  std::vector<size_t> usable;
  for (size_t i = 0; i < all.size(); ++i) {
    if (all[i].usable() && all[i].fit.regularised) usable.push_back(i);
  }
  if (usable.empty()) throw CalibrationError(all.front().failure);
  std::ranges::stable_sort(usable, {}, [&](size_t i) { return all[i].fit.intrinsics.size(); });
  calibration.chosen = usable.front();
  if (usable.size() == 1) {
    calibration.why = "It is the only one that was asked for and could be solved.";
    return;
  }
  if (!std::ranges::all_of(usable, [&](size_t i) { return all[i].cross_validation.has_value(); })) {
    calibration.why = "There are too few pictures to hold half of them back (" +
                      std::to_string(kFewestToHalve) +
                      " at least), so the leanest model was taken unseen. Take more pictures.";
    return;
  }
  const auto held_out = [&](size_t i) { return all[i].cross_validation->held_out_px; };
  const size_t best = *std::ranges::min_element(usable, {}, held_out);
  calibration.chosen = *std::ranges::find_if(usable, [&](size_t i) {
    return i == best || is_as_good(*all[i].cross_validation, *all[best].cross_validation);
  });
  const auto told = [&](size_t i) {
    return all[i].name() + " predicts the half of the pictures that it has not seen to " +
           rounded(held_out(i), "%.4f") + " px";
  };
  calibration.why = told(best);
  if (usable.front() == best) {
    calibration.why += ", the best of all, and it is the leanest.";
  } else if (calibration.chosen == best) {
    calibration.why += ", better than every leaner model by more than a standard error.";
  } else {
    calibration.why += ", the best of all; but " + told(calibration.chosen) +
                       ", worse by less than a standard error, with fewer unknowns for noise to get into.";
  }
  calibration.why +=
      " The error of the fits themselves was not looked at: it falls with every unknown, true or not.";
}

double most(const SensorMap& map, const std::vector<bool>& covered) {
  double largest = 0;
  for (size_t i = 0; i < map.values.size(); ++i) {
    if (covered[i] && map.values[i] > largest) largest = map.values[i];
  }
  return largest;
}

// The chosen lens again from the other seeds.
void compare_seeds(const BoardViews& views, const CalibrationOptions& options, Calibration& calibration) {
  const LensFit& fit = calibration.fit();
  const auto covered = covered_places(views, kColumns, kRows);
  std::vector<double> weight(covered.begin(), covered.end());
  for (size_t k = 1; k < calibration.seeds.size(); ++k) {
    const std::string from = "From a focal length of " + rounded(calibration.seeds[k].guess_px) + " px ";
    try {
      const LensFit other = fit_lens(views, fit.lens, calibration.seeds[k],
                                     {.regularise = fit.regularised,
                                      .solve_warp = fit.warp_solved,
                                      .seed = options.seed + static_cast<uint32_t>(k)});
      const double spread =
          most(model_difference(fit.model(), other.model(), kColumns, kRows, weight).length, covered);
      if (other.cost > fit.cost * 1.01) {
        calibration.remarks.push_back(from + "the solve ends in a worse minimum (" + rounded(other.rms_px) +
                                      " px): that guess was no good.");
        continue;
      }
      calibration.seed_spread_px = std::max(calibration.seed_spread_px, spread);
    } catch (const std::exception& e) {
      calibration.remarks.push_back(from + "there is no solution: " + e.what());
    }
  }
}

// By how many standard deviations of the free solve the regularisation has moved the parameters (root mean
// square, whitened): what noise makes of the difference is less than 1 (Hausman, Econometrica 46, 1978). 0 of
// a spline, whose knots that nobody saw have no free solve.
double moved_in_sigmas(const Candidate& held, const Candidate& free) {
  const Eigen::MatrixXd covariance = free.covariance.intrinsics();
  const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  if (llt.info() != Eigen::Success) return 0;
  const auto n = covariance.rows();
  const Eigen::VectorXd moved = Eigen::Map<const Eigen::VectorXd>(held.fit.intrinsics.data(), n) -
                                Eigen::Map<const Eigen::VectorXd>(free.fit.intrinsics.data(), n);
  return llt.matrixL().solve(moved).norm() / std::sqrt(static_cast<double>(n));
}

// mrcal's regularisation is made for focal lengths of some hundred pixels and corners good to a pixel. Of
// longer lenses and better corners it pulls harder than these do: where it moves the lens by more than a
// sigma and is not what holds it together, the free solve is right.
void compare_regularisation(const BoardViews& views, Calibration& calibration) {
  const Candidate& held = calibration.best();
  const auto free = std::ranges::find_if(calibration.candidates, [&](const Candidate& c) {
    return c.usable() && !c.fit.regularised && c.fit.lens == held.fit.lens;
  });
  if (free == calibration.candidates.end()) return;
  const auto covered = covered_places(views, kColumns, kRows);
  const auto sigma = [&](const Candidate& c) {
    return root_mean_square(uncertainty_map(c.fit, c.covariance, kAtInfinity, kColumns, kRows), covered);
  };
  const std::vector<double> weight(covered.begin(), covered.end());
  const double moved_px = root_mean_square(
      model_difference(held.fit.model(), free->fit.model(), kColumns, kRows, weight).length, covered);
  const double sigma_held = sigma(held),
               moved = std::max(moved_px / sigma_held, moved_in_sigmas(held, *free));
  const bool decided = sigma(*free) < 2 * sigma_held;
  const bool predicts = !held.cross_validation || !free->cross_validation ||
                        is_as_good(*free->cross_validation, *held.cross_validation);
  if (!(moved > 1) || !decided || !predicts) return;
  calibration.chosen = static_cast<size_t>(free - calibration.candidates.begin());
  calibration.why += " The regularisation moves it by " + rounded(moved) + " standard deviations, " +
                     rounded(moved_px) + " px, so the solve without it was taken.";
}

}  // namespace

std::string Candidate::name() const {
  return short_name(fit.lens) + (fit.regularised ? "" : " without regularisation");
}

Candidate calibrate_once(const BoardViews& views, const std::string& lens,
                         const CalibrationOptions& options) {
  check_views(views, lens);
  const auto seeds = solve_seeds(views, options);
  Candidate candidate;
  candidate.fit =
      fit_lens(views, lens, seeds.front(), {.solve_warp = options.solve_warp, .seed = options.seed});
  candidate.covariance = covariance_of(views, candidate.fit);
  return candidate;
}

Calibration calibrate_camera(const BoardViews& views, const CalibrationOptions& options,
                             const CalibrationProgress& progress) {
  if (options.lens_models.empty()) throw CalibrationError("expected a lens model");
  const auto tell = [&](double fraction, const std::string& what) {
    if (progress) progress(fraction, what);
  };
  check_views(views, options.lens_models.front());
  Calibration calibration;
  calibration.ranges = options.ranges;
  tell(0, "poses of the boards");
  calibration.seeds = solve_seeds(views, options);

  // Two at a time: libmrcal's solves are independent, and their results the same to the last bit in any
  // thread.
  const size_t count = 2 * options.lens_models.size();
  for (size_t i = 0; i < count; i += 2) {
    const std::string& lens = options.lens_models[i / 2];
    tell(0.1 + 0.75 * static_cast<double>(i) / static_cast<double>(count), short_name(lens));
    const auto run = [&](bool regularise) {
      return solve(views, lens, calibration.seeds.front(),
                   {.regularise = regularise, .solve_warp = options.solve_warp, .seed = options.seed});
    };
    auto free = std::async(std::launch::async, run, false);
    calibration.candidates.push_back(run(true));
    calibration.candidates.push_back(free.get());
  }
  choose(calibration);
  compare_regularisation(views, calibration);
  tell(0.85, "the same from other seeds");
  compare_seeds(views, options, calibration);
  tell(1, "solved");
  return calibration;
}

}  // namespace perch
