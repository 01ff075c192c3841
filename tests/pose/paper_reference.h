#pragma once

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <cmath>
#include <optional>
#include <span>

#include "perch/geometry/euler.h"
#include "perch/geometry/rigid3.h"

namespace perch {

// The paper's section 2.2 word for word and slow: what the product's solvers are measured against. Points q
// of the target's plane, points x of the image of an ideal camera.

using Points = std::span<const Eigen::Vector2d>;

// F of equations 2.5 and 2.6, over (r1, r2, p).
inline Eigen::MatrixXd paper_F(Points plane, Points image) {
  Eigen::MatrixXd F(2 * static_cast<Eigen::Index>(plane.size()), 9);
  for (size_t i = 0; i < plane.size(); ++i) {
    const double q1 = plane[i].x(), q2 = plane[i].y(), x1 = image[i].x(), x2 = image[i].y();
    F.row(2 * static_cast<Eigen::Index>(i)) << q1, 0, -q1 * x1, q2, 0, -q2 * x1, 1, 0, -x1;
    F.row(2 * static_cast<Eigen::Index>(i) + 1) << 0, q1, -q1 * x2, 0, q2, -q2 * x2, 0, 1, -x2;
  }
  return F;
}

// Section 2.2.2: the singular vector of F's smallest singular value, its sign by positive depth, its scale by
// the norms of r1 and r2, R = U V' Q from the SVD of [r1 r2 0].
inline Rigid3 paper_linear(Points plane, Points image) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd_F(paper_F(plane, image), Eigen::ComputeFullV);
  Eigen::Matrix<double, 9, 1> v = svd_F.matrixV().col(8);
  if (v(8) < 0) v = -v;
  const Eigen::Vector3d r1 = v.head<3>(), r2 = v.segment<3>(3), p = v.tail<3>();
  const double scale = 2 / (r1.norm() + r2.norm());

  Eigen::Matrix3d r;
  r << r1, r2, Eigen::Vector3d::Zero();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd_r(r, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d R = svd_r.matrixU() * svd_r.matrixV().transpose();
  if (R.determinant() < 0) R.col(2) = -R.col(2);
  return {Eigen::Quaterniond(R), scale * p};
}

// Section 2.2.3: beta = (theta_1, theta_2, theta_3, p), R = exp(e3 theta_3) exp(e2 theta_2) exp(e1 theta_1).
using Beta = Eigen::Matrix<double, 6, 1>;

inline Beta beta_from_pose(const Rigid3& camera_from_target) {
  const YawPitchRoll angles = ypr_from_rotation(camera_from_target.rotation);
  Beta beta;
  beta << angles.roll, angles.pitch, angles.yaw, camera_from_target.translation;
  return beta;
}

inline Rigid3 pose_from_beta(const Beta& beta) {
  return {rotation_from_ypr({.yaw = beta(2), .pitch = beta(1), .roll = beta(0)}), beta.tail<3>()};
}

// G of equation 2.7: the first two rows of (x e3' - I) [R p] q.
inline Eigen::VectorXd paper_G(Points plane, Points image, const Beta& beta) {
  const Rigid3 g = pose_from_beta(beta);
  Eigen::VectorXd G(2 * static_cast<Eigen::Index>(plane.size()));
  for (size_t i = 0; i < plane.size(); ++i) {
    const Eigen::Vector3d c = g * Eigen::Vector3d(plane[i].x(), plane[i].y(), 0);
    G.segment<2>(2 * static_cast<Eigen::Index>(i)) = image[i] * c.z() - c.head<2>();
  }
  return G;
}

// Its derivative by beta.
inline Eigen::MatrixXd paper_DG(Points plane, Points image, const Beta& beta) {
  using Eigen::AngleAxisd, Eigen::Matrix3d, Eigen::Vector3d;
  const Matrix3d R1 = AngleAxisd(beta(0), Vector3d::UnitX()).toRotationMatrix();
  const Matrix3d R2 = AngleAxisd(beta(1), Vector3d::UnitY()).toRotationMatrix();
  const Matrix3d R3 = AngleAxisd(beta(2), Vector3d::UnitZ()).toRotationMatrix();
  Eigen::MatrixXd DG(2 * static_cast<Eigen::Index>(plane.size()), 6);
  for (size_t i = 0; i < plane.size(); ++i) {
    const Vector3d q(plane[i].x(), plane[i].y(), 0);
    Eigen::Matrix<double, 3, 6> Dc;  // of c = R q + p
    Dc << R3 * R2 * Vector3d::UnitX().cross(R1 * q), R3 * Vector3d::UnitY().cross(R2 * R1 * q),
        Vector3d::UnitZ().cross(R3 * R2 * R1 * q), Matrix3d::Identity();
    DG.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = image[i] * Dc.row(2) - Dc.topRows<2>();
  }
  return DG;
}

struct PaperIteration {
  Beta beta;
  double norm_G = 0;
};

// One step of equation 2.8; k_n is halved from 1 until |G| falls. Empty when no step lowers it.
inline std::optional<PaperIteration> paper_step(Points plane, Points image, const PaperIteration& at) {
  const Eigen::VectorXd G = paper_G(plane, image, at.beta);
  const Beta step = paper_DG(plane, image, at.beta).completeOrthogonalDecomposition().pseudoInverse() * G;
  for (double k = 1; k > 1e-6; k /= 2) {
    const Beta next = at.beta - k * step;
    const double norm = paper_G(plane, image, next).norm();
    if (norm < at.norm_G) return PaperIteration{next, norm};
  }
  return std::nullopt;
}

inline PaperIteration paper_newton_raphson(Points plane, Points image, const Rigid3& start) {
  const Beta beta = beta_from_pose(start);
  PaperIteration at{beta, paper_G(plane, image, beta).norm()};
  for (int n = 0; n < 100; ++n) {
    const auto next = paper_step(plane, image, at);
    if (!next) break;
    at = *next;
  }
  return at;
}

}  // namespace perch
