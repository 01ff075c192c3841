#include "perch/pose/deformation.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>

namespace perch {

double step_per_px(const PlaneMeasurement& plane, const CameraModel& camera) {
  return 1 / (plane.frame.radius * camera.intrinsics()[0]);
}

// Written so that an information that is nearly singular need not be inverted.
PlaneInformation deformed(const PlaneInformation& information, double px2, double step_per_px) {
  if (!(px2 > 0)) return information;
  const PlaneInformation A = PlaneInformation::Identity() + px2 * step_per_px * step_per_px * information;
  const PlaneInformation left = A.partialPivLu().solve(information);
  return 0.5 * (left + left.transpose());
}

void learn(const PlaneInformation& root, const Eigen::Matrix<double, 8, 6>& J, double squares,
           double step_per_px, Deformation& deformation) {
  constexpr double kSpare = 2;  // a homography has eight numbers, a pose six
  // By coefficients: Eigen's product for large matrices takes thrice as long for these.
  const PlaneInformation M = step_per_px * step_per_px * root.lazyProduct(root.transpose());
  const Eigen::Matrix<double, 8, 6> MJ = M.lazyProduct(J);
  const Eigen::Matrix<double, 6, 6> JtMJ = J.transpose().lazyProduct(MJ);
  const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> normal(
      Eigen::Matrix<double, 6, 6>(J.transpose().lazyProduct(J)));
  const double trace = M.trace() - normal.solve(JtMJ).trace();
  // Two squares of unit variance vary by 4 in units of 1 / trace, of which the deformation that is allowed
  // for is a part; the frame's own adds to that: some hundredths of a pixel are no less sure than
  // thousandths.
  if (!(trace > 0) || !std::isfinite(squares)) return;
  const double of_noise = std::max(1 / trace - deformation.px2(), 0.0), spread = of_noise + 1e-3;
  deformation.add(deformation.px2() + (squares - kSpare) / trace, 1 / (spread * spread), 2 * of_noise);
}

}  // namespace perch
