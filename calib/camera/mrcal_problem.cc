#include "calib/camera/mrcal_problem.h"

#include <suitesparse/cholmod.h>

#include <algorithm>
#include <cmath>

#include "perch/camera/c_numbers.h"

extern "C" {
#include <mrcal/mrcal-internal.h>
}

namespace perch {
namespace {

// Of points in space, of which there are none here.
constexpr mrcal_problem_constants_t kConstants{0.1, 1e6};
constexpr mrcal_point3_t kNoCorner{{0, 0, -1}};

int bytes(int doubles) { return doubles * static_cast<int>(sizeof(double)); }

// The corners' usual sigma: weights are relative to it, since the regularisation counts pixels.
double usual_sigma(const BoardViews& views) {
  std::vector<double> sigmas;
  for (const auto& view : views.views) {
    for (const auto& corner : view.corners) sigmas.push_back(corner.sigma);
  }
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  return *middle;
}

}  // namespace

mrcal_lensmodel_t mrcal_lens(const std::string& name) {
  const CNumbers dot_is_the_decimal_point;
  mrcal_lensmodel_t lens{};
  if (!mrcal_lensmodel_from_name(&lens, name.c_str()))
    throw CalibrationError(name + ": expected a lens model that mrcal knows");
  return lens;
}

MrcalProblem::MrcalProblem(const BoardViews& board_views, const std::string& name)
    : views(board_views),
      lens_name(name),
      lens(mrcal_lens(name)),
      columns_(board_views.grid.columns),
      rows_(board_views.grid.rows),
      count_(static_cast<int>(board_views.views.size())),
      size_{board_views.width, board_views.height} {
  intrinsics.resize(static_cast<size_t>(mrcal_lensmodel_num_params(&lens)));
  poses.resize(views.views.size());
  fresh_pool_.assign(views.views.size() * static_cast<size_t>(places()), kNoCorner);
  const double usual = usual_sigma(views);
  for (size_t i = 0; i < views.views.size(); ++i) {
    observations_.push_back({{0, -1}, static_cast<int>(i)});
    for (const auto& corner : views.views[i].corners) {
      fresh_pool_[place(i, corner)] = {{corner.pixel.x(), corner.pixel.y(), usual / corner.sigma}};
    }
  }
  pool_ = fresh_pool_;
}

size_t MrcalProblem::place(size_t view, const BoardCorner& corner) const {
  return view * static_cast<size_t>(places()) + static_cast<size_t>(corner.row * columns_ + corner.column);
}

double MrcalProblem::weight(size_t view, const BoardCorner& corner) const {
  return fresh_pool_[place(view, corner)].z;
}

int MrcalProblem::state_count(const mrcal_problem_selections_t& selections) const {
  return mrcal_num_states(1, 0, count_, 0, 0, count_, selections, &lens);
}

int MrcalProblem::measurement_count(const mrcal_problem_selections_t& selections) const {
  return mrcal_num_measurements(count_, 0, columns_, rows_, 1, 0, count_, 0, 0, selections, &lens);
}

void MrcalProblem::solve(const mrcal_problem_selections_t& selections) {
  const mrcal_stats_t stats =
      mrcal_optimize(nullptr, 0, nullptr, 0, intrinsics.data(), nullptr, poses.data(), nullptr, &warp, 1, 0,
                     count_, 0, 0, observations_.data(), nullptr, count_, 0, pool_.data(), &lens, size_,
                     selections, &kConstants, views.grid.spacing, columns_, rows_, false, false);
  // The only sign of a failure is a negative RMS; a NaN is none, and must not pass for success.
  const bool finite = std::ranges::all_of(intrinsics, [](double v) { return std::isfinite(v); });
  if (!(stats.rms_reproj_error__pixels >= 0) || !finite)
    throw CalibrationError(lens_name + ": mrcal found no solution");
}

void MrcalProblem::evaluate(const mrcal_problem_selections_t& selections, double* x,
                            cholmod_sparse* Jt) const {
  std::vector<double> state(static_cast<size_t>(state_count(selections)));
  const bool done = mrcal_optimizer_callback(
      state.data(), bytes(static_cast<int>(state.size())), x, bytes(measurement_count(selections)), Jt,
      intrinsics.data(), nullptr, poses.data(), nullptr, &warp, 1, 0, count_, 0, 0, observations_.data(),
      nullptr, count_, 0, pool_.data(), &lens, size_, selections, &kConstants, views.grid.spacing, columns_,
      rows_, false);
  if (!done) throw CalibrationError(lens_name + ": mrcal cannot evaluate the solution");
}

Eigen::VectorXd MrcalProblem::measurements(const mrcal_problem_selections_t& selections) const {
  Eigen::VectorXd x(measurement_count(selections));
  evaluate(selections, x.data(), nullptr);
  return x;
}

MrcalProblem::Linearisation MrcalProblem::linearise(const mrcal_problem_selections_t& selections) const {
  Linearisation linear;
  const int states = state_count(selections), rows = measurement_count(selections);
  linear.x.resize(rows);
  linear.J_transposed.resize(states, rows);
  linear.J_transposed.resizeNonZeros(_mrcal_num_j_nonzero(count_, 0, columns_, rows_, 1, 0, count_, 0, 0,
                                                          observations_.data(), nullptr, selections, &lens));
  auto& J = linear.J_transposed;
  // J by rows is its transpose by columns: mrcal writes into Eigen's arrays.
  cholmod_sparse Jt{};
  Jt.nrow = static_cast<size_t>(states);
  Jt.ncol = static_cast<size_t>(rows);
  Jt.nzmax = static_cast<size_t>(J.data().size());
  Jt.p = J.outerIndexPtr();
  Jt.i = J.innerIndexPtr();
  Jt.x = J.valuePtr();
  Jt.itype = CHOLMOD_INT;
  Jt.xtype = CHOLMOD_REAL;
  Jt.dtype = CHOLMOD_DOUBLE;
  Jt.sorted = Jt.packed = 1;
  evaluate(selections, linear.x.data(), &Jt);

  linear.scale = Eigen::VectorXd::Ones(states);
  mrcal_unpack_solver_state_vector(linear.scale.data(), 1, 0, count_, 0, 0, selections, &lens);
  linear.board_measurements = mrcal_num_measurements_boards(count_, columns_, rows_);
  linear.intrinsics = mrcal_num_intrinsics_optimization_params(selections, &lens);
  linear.first_pose = mrcal_state_index_frames(0, 1, 0, count_, 0, 0, count_, selections, &lens);
  linear.first_warp = mrcal_state_index_calobject_warp(1, 0, count_, 0, 0, count_, selections, &lens);
  return linear;
}

LensFit MrcalProblem::result(const mrcal_problem_selections_t& selections) const {
  LensFit fit;
  fit.lens = lens_name;
  fit.intrinsics = intrinsics;
  fit.width = size_[0], fit.height = size_[1];
  fit.regularised = selections.do_apply_regularization;
  fit.warp_solved = selections.do_optimize_calobject_warp;
  fit.warp << warp.x2, warp.y2;
  fit.states = state_count(selections);
  for (const auto& pose : poses) {
    fit.camera_from_board.emplace_back();
    fit.camera_from_board.back() << pose.r.x, pose.r.y, pose.r.z, pose.t.x, pose.t.y, pose.t.z;
  }
  fit.cost = measurements(selections).squaredNorm();

  // mrcal's error of an outlier is 0: with all weights as they were it is what it is.
  MrcalProblem all = *this;
  all.restore_weights();
  const Eigen::VectorXd x = all.measurements(selections);
  double squares = 0;
  for (size_t i = 0; i < views.views.size(); ++i) {
    auto& corners = fit.corners.emplace_back();
    for (const auto& corner : views.views[i].corners) {
      const size_t at = place(i, corner);
      const Eigen::Vector2d whitened = x.segment<2>(static_cast<Eigen::Index>(2 * at));
      corners.push_back({whitened / fresh_pool_[at].z, pool_[at].z < 0});
      ++fit.seen;
      if (corners.back().outlier) {
        ++fit.outliers;
      } else {
        squares += whitened.squaredNorm();
      }
    }
  }
  const double inliers = 2 * (fit.seen - fit.outliers);
  fit.rms_px = std::sqrt(squares / std::max(1.0, inliers));
  fit.sigma_px = std::sqrt(squares / std::max(1.0, inliers - fit.states));
  return fit;
}

mrcal_problem_selections_t only_poses() {
  mrcal_problem_selections_t s{};
  s.do_optimize_frames = true;
  return s;
}

mrcal_problem_selections_t poses_and_core() {
  mrcal_problem_selections_t s = only_poses();
  s.do_optimize_intrinsics_core = true;
  return s;
}

mrcal_problem_selections_t everything(const mrcal_lensmodel_t& lens, const FitOptions& options) {
  mrcal_problem_selections_t s = only_poses();
  // A spline's knots can do all that its focal lengths and centre do.
  s.do_optimize_intrinsics_core = lens.type != MRCAL_LENSMODEL_SPLINED_STEREOGRAPHIC;
  s.do_optimize_intrinsics_distortions = true;
  s.do_optimize_extrinsics = true;  // of no camera; mrcal's uncertainty refuses a solve without
  s.do_optimize_calobject_warp = options.solve_warp;
  s.do_apply_regularization = options.regularise;
  s.do_apply_outlier_rejection = options.reject_outliers;
  return s;
}

mrcal_problem_selections_t selections_of(const LensFit& fit, const mrcal_lensmodel_t& lens) {
  return everything(lens,
                    {.regularise = fit.regularised, .solve_warp = fit.warp_solved, .reject_outliers = false});
}

MrcalProblem problem_at(const BoardViews& views, const LensFit& fit) {
  MrcalProblem problem(views, fit.lens);
  problem.intrinsics = fit.intrinsics;
  problem.warp = {{fit.warp.x(), fit.warp.y()}};
  problem.set_poses(fit.camera_from_board);
  problem.mark_outliers(fit);
  return problem;
}

void MrcalProblem::set_poses(const std::vector<LensFit::PoseVector>& camera_from_board) {
  for (size_t i = 0; i < camera_from_board.size(); ++i) {
    const auto& v = camera_from_board[i];
    poses[i] = {{{v(0), v(1), v(2)}}, {{v(3), v(4), v(5)}}};
  }
}

void MrcalProblem::mark_outliers(const LensFit& fit) {
  for (size_t i = 0; i < fit.corners.size(); ++i) {
    for (size_t k = 0; k < fit.corners[i].size(); ++k) {
      if (fit.corners[i][k].outlier) pool_[place(i, views.views[i].corners[k])].z = -1;
    }
  }
}

}  // namespace perch
