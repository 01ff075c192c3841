#include "calib/camera/lens_fit.h"

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <random>
#include <set>

#include "calib/camera/mrcal_problem.h"

namespace perch {
namespace {

// A pose takes 6 of the 2 * 4 numbers that four corners give; two more make an error of one of them show.
constexpr size_t kFewestCorners = 6;
// One view would leave focal length and distance apart in nothing but its perspective.
constexpr size_t kFewestViews = 3;
// Distortions and the warp bend what two solves end at by less than this part of the cost.
constexpr double kSameCost = 1e-5;

bool on_one_line(const BoardView& view) {
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (const auto& corner : view.corners) mean += Eigen::Vector2d(corner.column, corner.row);
  mean /= static_cast<double>(view.corners.size());
  for (const auto& corner : view.corners) {
    const Eigen::Vector2d d = Eigen::Vector2d(corner.column, corner.row) - mean;
    scatter += d * d.transpose();
  }
  return !(scatter(0, 0) * scatter(1, 1) - scatter(0, 1) * scatter(1, 0) > 1e-9);
}

void check_view(const BoardViews& all, const BoardView& view) {
  if (view.corners.size() < kFewestCorners) {
    throw CalibrationError(view.picture + ": expected " + std::to_string(kFewestCorners) +
                           " corners at least, found " + std::to_string(view.corners.size()));
  }
  std::set<std::pair<int, int>> taken;
  for (const auto& corner : view.corners) {
    const std::string where =
        view.picture + ": corner (" + std::to_string(corner.column) + ", " + std::to_string(corner.row) + ")";
    if (corner.column < 0 || corner.column >= all.grid.columns || corner.row < 0 ||
        corner.row >= all.grid.rows)
      throw CalibrationError(where + " is not on the board");
    if (!taken.insert({corner.column, corner.row}).second) throw CalibrationError(where + " is there twice");
    if (!corner.pixel.allFinite() || !std::isfinite(corner.sigma) || !(corner.sigma > 0))
      throw CalibrationError(where + ": expected a pixel and a sigma above 0");
  }
  if (on_one_line(view)) throw CalibrationError(view.picture + ": all corners are on one line");
}

// The pose of a view by a camera of the stereographic projection, through the pinhole picture that it stands
// for.
mrcal_pose_t first_pose(const BoardViews& all, const BoardView& view, const double* intrinsics) {
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> picture;
  for (const auto& corner : view.corners) {
    const mrcal_point2_t q{{corner.pixel.x(), corner.pixel.y()}};
    mrcal_point3_t v;
    mrcal_unproject_stereographic(&v, nullptr, &q, 1, intrinsics);
    if (!(v.z > 0)) continue;  // no pinhole sees it
    board.emplace_back(corner.column * all.grid.spacing, corner.row * all.grid.spacing, 0);
    picture.emplace_back(v.x / v.z, v.y / v.z);
  }
  cv::Vec3d r(0, 0, 0), t(0, 0, 1);
  try {
    if (board.size() >= 4) cv::solvePnP(board, picture, cv::Matx33d::eye(), cv::noArray(), r, t);
    if (t[2] < 0) {  // behind the camera fits as well: mirrored, from where that would be before it
      t = -t;
      cv::solvePnP(board, picture, cv::Matx33d::eye(), cv::noArray(), r, t, true);
    }
  } catch (const cv::Exception&) {
    throw CalibrationError(view.picture + ": its corners are no picture of a board");
  }
  if (!(cv::norm(r) < 1e3 && cv::norm(t) < 1e6))
    throw CalibrationError(view.picture + ": no pose fits its corners");
  return {{{r[0], r[1], r[2]}}, {{t[0], t[1], t[2]}}};
}

// As mrcal-calibrate-cameras does: not zero, where some derivatives vanish; denominators smaller yet.
void append_distortions(const LensSeed& seed, uint32_t random_seed, MrcalProblem& problem) {
  std::mt19937 random(random_seed);
  std::copy(seed.intrinsics.begin(), seed.intrinsics.end(), problem.intrinsics.begin());
  for (size_t i = 4; i < problem.intrinsics.size(); ++i) {
    const double uniform = static_cast<double>(random()) / static_cast<double>(std::mt19937::max());
    problem.intrinsics[i] = 1e-6 * (2 * uniform - 1);
    if (MRCAL_LENSMODEL_IS_OPENCV(problem.lens.type) && i >= 9 && i < 12) problem.intrinsics[i] *= 1e-3;
  }
}

LensFit finish(MrcalProblem& problem, const FitOptions& options) {
  problem.restore_weights();
  problem.solve(everything(problem.lens, options));
  FitOptions again = options;
  again.reject_outliers = false;
  const auto selections = everything(problem.lens, again);
  // mrcal says nothing when it stops at its 300th iteration.
  const double before = problem.measurements(selections).squaredNorm();
  problem.solve(selections);
  LensFit fit = problem.result(selections);
  fit.converged = std::abs(before - fit.cost) <= kSameCost * fit.cost + 1e-12;
  return fit;
}

}  // namespace

void check_lens(const std::string& lens) {
  const mrcal_lensmodel_t model = mrcal_lens(lens);
  const mrcal_lensmodel_metadata_t metadata = mrcal_lensmodel_metadata(&model);
  if (!metadata.has_core || !metadata.has_gradients)
    throw CalibrationError(lens + ": mrcal can project with this lens model but not fit it");
}

void check_views(const BoardViews& views, const std::string& lens) {
  check_lens(lens);
  const mrcal_lensmodel_t model = mrcal_lens(lens);
  const auto& grid = views.grid;
  if (grid.columns < 2 || grid.rows < 2 || !(grid.spacing > 0) || !std::isfinite(grid.spacing))
    throw CalibrationError("the board: expected 2 x 2 corners at least and a spacing above 0");
  if (views.width < 1 || views.height < 1) throw CalibrationError("expected pictures of a size above 0");
  if (views.views.size() < kFewestViews) {
    throw CalibrationError(
        "expected " + std::to_string(kFewestViews) + " pictures of the board at least, found " +
        std::to_string(views.views.size()) +
        ": fewer leave focal length and distance undecided however small their errors are");
  }
  for (const auto& view : views.views) check_view(views, view);
  size_t corners = 0;
  for (const auto& view : views.views) corners += view.corners.size();
  const size_t unknowns =
      static_cast<size_t>(mrcal_lensmodel_num_params(&model)) + 6 * views.views.size() + 2;
  // A spline's knots that nothing has seen are held by the regularisation.
  if (model.type != MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC && 2 * corners <= unknowns) {
    throw CalibrationError("expected more than " + std::to_string(unknowns / 2) + " corners for " + lens +
                           ", found " + std::to_string(corners));
  }
}

LensSeed seed_from_focal_length(const BoardViews& views, double guess_px) {
  MrcalProblem problem(views, "LENSMODEL_STEREOGRAPHIC");
  problem.intrinsics = {guess_px, guess_px, (views.width - 1) / 2.0, (views.height - 1) / 2.0};
  for (size_t i = 0; i < views.views.size(); ++i)
    problem.poses[i] = first_pose(views, views.views[i], problem.intrinsics.data());
  problem.solve(only_poses());
  problem.solve(poses_and_core());
  const LensFit fit = problem.result(poses_and_core());
  return {guess_px, fit.intrinsics, fit.camera_from_board, fit.cost};
}

LensFit fit_lens(const BoardViews& views, const std::string& lens, const LensSeed& seed,
                 const FitOptions& options) {
  MrcalProblem problem(views, lens);
  problem.set_poses(seed.camera_from_board);
  append_distortions(seed, options.seed, problem);
  // Always with the regularisation at first: from far off a free lens goes anywhere.
  FitOptions flat = options;
  flat.solve_warp = false;
  flat.regularise = true;
  problem.solve(everything(problem.lens, flat));
  return finish(problem, options);
}

LensFit refit_lens(const BoardViews& views, const LensFit& start, const FitOptions& options) {
  MrcalProblem problem = problem_at(views, start);
  return finish(problem, options);
}

LensFit fit_poses(const BoardViews& views, const LensFit& lens) {
  // From a pinhole's poses of the rays that the lens says: nothing of the views has been in its solve.
  const CameraModel model = lens.model();
  BoardViews straight = views;
  for (auto& view : straight.views) {
    std::erase_if(view.corners, [&](BoardCorner& corner) {
      const auto ray = model.ray_from_pixel(corner.pixel);
      if (!ray) return true;
      const mrcal_point3_t v{{ray->x(), ray->y(), ray->z()}};
      const double unit[4] = {1, 1, 0, 0};
      mrcal_point2_t q;
      mrcal_project_stereographic(&q, nullptr, &v, 1, unit);
      corner.pixel << q.x, q.y;
      return false;
    });
  }
  LensFit start = lens;
  start.corners.clear();
  start.camera_from_board.clear();
  MrcalProblem problem = problem_at(views, start);
  const double unit[4] = {1, 1, 0, 0};
  for (size_t i = 0; i < views.views.size(); ++i)
    problem.poses[i] = first_pose(straight, straight.views[i], unit);
  problem.solve(only_poses());
  auto rejecting = only_poses();
  rejecting.do_apply_outlier_rejection = true;
  problem.solve(rejecting);
  return problem.result(only_poses());
}

}  // namespace perch
