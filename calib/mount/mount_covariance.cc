#include "calib/mount/mount_covariance.h"

#include <ceres/crs_matrix.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <cmath>
#include <set>

namespace perch {
namespace {

using Sparse = Eigen::SparseMatrix<double>;

Sparse jacobian_of(ceres::Problem& problem, const std::vector<double*>& blocks,
                   const std::vector<ceres::ResidualBlockId>& residuals) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  options.residual_blocks = residuals;
  options.apply_loss_function = false;
  options.num_threads = 2;
  ceres::CRSMatrix crs;
  if (!problem.Evaluate(options, nullptr, nullptr, nullptr, &crs))
    throw MountError("the last problem has no derivative");
  const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> rows(
      crs.num_rows, crs.num_cols, static_cast<Eigen::Index>(crs.values.size()), crs.rows.data(),
      crs.cols.data(), crs.values.data());
  return Sparse(rows);
}

// H_gg - H_gn H_nn^-1 H_ng; the first n columns are g.
Eigen::MatrixXd eliminated(const Sparse& J, Eigen::Index n) {
  const Sparse H = J.transpose() * J;
  const Eigen::Index rest = H.cols() - n;
  Eigen::MatrixXd Hgg = Eigen::MatrixXd(H.block(0, 0, n, n));
  if (rest == 0) return Hgg;
  const Sparse Hnn = H.block(n, n, rest, rest);
  const Eigen::MatrixXd Hng = Eigen::MatrixXd(H.block(n, 0, rest, n));
  const Eigen::SimplicialLDLT<Sparse> ldlt(Hnn);
  if (ldlt.info() != Eigen::Success) throw MountError("the trajectory's states are not determined");
  Hgg -= Hng.transpose() * ldlt.solve(Hng);
  return 0.5 * (Hgg + Hgg.transpose());
}

std::vector<std::string> names_of(const MountProblem& problem, const MountState& state) {
  std::vector<std::string> names;
  const auto add_pose = [&](const std::string& of, const std::string& rotation) {
    for (const char* axis : {"x", "y", "z"}) names.push_back(of + " " + axis);
    for (const char* axis : {"x", "y", "z"}) names.push_back(rotation + " " + axis);
  };
  add_pose("lever arm", "mount rotation");
  for (size_t i = 0; i < state.pads.size(); ++i) {
    const std::string of = state.pads.size() == 1 ? "" : " (" + problem.flights[i].name + ")";
    add_pose("pad" + of, "pad rotation" + of);
  }
  for (size_t i = 0; i < state.offsets.size(); ++i) {
    names.push_back("time offset" + (state.offsets.size() == 1 ? "" : " (" + problem.flights[i].name + ")"));
  }
  if (problem.chain.head) names.insert(names.end(), kHeadNames.begin(), kHeadNames.end());
  return names;
}

}  // namespace

Eigen::MatrixXd covariance_of(const Eigen::MatrixXd& information) {
  Eigen::VectorXd scale = information.diagonal().cwiseMax(1e-12).cwiseSqrt().cwiseInverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scale.asDiagonal() * information *
                                                             scale.asDiagonal());
  const Eigen::VectorXd values = eigen.eigenvalues().cwiseMax(1e-13);
  return scale.asDiagonal() * eigen.eigenvectors() * values.cwiseInverse().asDiagonal() *
         eigen.eigenvectors().transpose() * scale.asDiagonal();
}

void check_converged(ceres::Problem& least_squares, const std::string& on, double limit) {
  ceres::Problem::EvaluateOptions options;
  options.num_threads = 2;
  std::vector<double> residuals;
  ceres::CRSMatrix crs;
  if (!least_squares.Evaluate(options, nullptr, &residuals, nullptr, &crs)) {
    throw MountError("the least squares on " + on + " have no derivative where they ended");
  }
  const Eigen::Map<const Eigen::SparseMatrix<double, Eigen::RowMajor>> rows(
      crs.num_rows, crs.num_cols, static_cast<Eigen::Index>(crs.values.size()), crs.rows.data(),
      crs.cols.data(), crs.values.data());
  const Sparse J(rows);
  const Eigen::VectorXd gradient =
      J.transpose() * Eigen::Map<const Eigen::VectorXd>(residuals.data(), crs.num_rows);
  Sparse H = J.transpose() * J;
  // What is not told at all has no gradient either, and must not divide by nothing.
  const Eigen::VectorXd damping = 1e-9 * H.diagonal().array() + 1e-12;
  H += Sparse(damping.asDiagonal());
  const Eigen::SimplicialLDLT<Sparse> ldlt(H);
  const double gain = ldlt.info() == Eigen::Success ? gradient.dot(ldlt.solve(gradient)) : NAN;
  if (gain < limit) return;
  throw MountError("the least squares on " + on + " did not converge: another step would gain " +
                   std::to_string(gain) + " in chi-square");
}

void measure_information(ceres::Problem& least_squares, UnknownBlocks& unknowns,
                         const std::vector<ceres::ResidualBlockId>& priors, const MountProblem& problem,
                         MountSolution& solution) {
  const std::vector<double*> sought = unknowns.all(problem.chain.head.has_value());
  solution.names = names_of(problem, solution.state);
  const auto n = static_cast<Eigen::Index>(solution.names.size());
  std::vector<double*> blocks = sought, all;
  least_squares.GetParameterBlocks(&all);
  const std::set<double*> first(sought.begin(), sought.end());
  for (double* block : all) {
    if (!first.contains(block)) blocks.push_back(block);
  }
  Eigen::MatrixXd both = eliminated(jacobian_of(least_squares, blocks, {}), n);
  solution.prior_information = Eigen::MatrixXd::Zero(n, n);
  if (!priors.empty()) {
    solution.prior_information = eliminated(jacobian_of(least_squares, sought, priors), n);
  }
  solution.information = both - solution.prior_information;
  solution.covariance = covariance_of(both);
}

}  // namespace perch
