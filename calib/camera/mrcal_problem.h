#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <string>
#include <vector>

#include "calib/camera/board_view.h"
#include "calib/camera/lens_fit.h"

extern "C" {  // the headers of mrcal 2.2 do not say so themselves
#include <mrcal/mrcal.h>
}

namespace perch {

// One moving board before one camera, in libmrcal's arrays. The camera is the reference frame: a board's pose
// is camera_from_board. Everything that mrcal asserts or takes on trust has been checked by check_views.
class MrcalProblem {
 public:
  MrcalProblem(const BoardViews& views, const std::string& lens);

  // In: the seed; out: the solution. Throws CalibrationError when mrcal gives up or returns no number.
  void solve(const mrcal_problem_selections_t& selections);
  // All corners count again, with their own weights.
  void restore_weights() { pool_ = fresh_pool_; }

  // At the present state. `J` is by the packed state (packed = state / scale) and has a row for every
  // measurement: two a place of the grid, view by view and row by row, then the regularisation's.
  struct Linearisation {
    Eigen::VectorXd x;
    Eigen::SparseMatrix<double> J_transposed;
    Eigen::VectorXd scale;
    int board_measurements = 0;
    int first_pose = -1, first_warp = -1;  // in the state; the intrinsics come first
    int intrinsics = 0;                    // how many of them are in the state
  };
  Linearisation linearise(const mrcal_problem_selections_t& selections) const;
  // The measurements alone.
  Eigen::VectorXd measurements(const mrcal_problem_selections_t& selections) const;

  // Errors, counts and costs of a solution, all corners looked at.
  LensFit result(const mrcal_problem_selections_t& selections) const;

  int places() const { return columns_ * rows_; }
  double weight(size_t view, const BoardCorner& corner) const;
  int state_count(const mrcal_problem_selections_t& selections) const;

  const BoardViews& views;
  std::string lens_name;
  mrcal_lensmodel_t lens{};
  std::vector<double> intrinsics;
  std::vector<mrcal_pose_t> poses;
  mrcal_calobject_warp_t warp{};

  void set_poses(const std::vector<LensFit::PoseVector>& camera_from_board);
  void mark_outliers(const LensFit& fit);
  const std::vector<mrcal_point3_t>& pool() const { return pool_; }

 private:
  size_t place(size_t view, const BoardCorner& corner) const;
  int measurement_count(const mrcal_problem_selections_t& selections) const;
  void evaluate(const mrcal_problem_selections_t& selections, double* x,
                struct cholmod_sparse_struct* Jt) const;

  int columns_, rows_, count_;
  int size_[2];
  std::vector<mrcal_observation_board_t> observations_;
  std::vector<mrcal_point3_t> pool_, fresh_pool_;  // pixel and weight; negative: missing or outlier
};

// What a solve lets go.
mrcal_problem_selections_t only_poses();
mrcal_problem_selections_t poses_and_core();
mrcal_problem_selections_t everything(const mrcal_lensmodel_t& lens, const FitOptions& options);
// Those of a finished solve, without rejection.
mrcal_problem_selections_t selections_of(const LensFit& fit, const mrcal_lensmodel_t& lens);

// The problem at a fit's optimum, its outliers marked.
MrcalProblem problem_at(const BoardViews& views, const LensFit& fit);

// Throws CalibrationError.
mrcal_lensmodel_t mrcal_lens(const std::string& name);

}  // namespace perch
