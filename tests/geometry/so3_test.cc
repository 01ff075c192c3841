#include "perch/geometry/so3.h"

#include <Eigen/Dense>
#include <array>
#include <numbers>

#include "support/differentiate.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

using std::numbers::pi;

// Angles at which formulas for rotations go wrong: zero, the borders of series, and near pi.
constexpr std::array kAngles{0.0,  1e-300, 1e-20, 1e-12, 1e-8,      1e-5,      0.99e-4,   1.01e-4,
                             1e-3, 0.1,    1.0,   2.0,   pi - 1e-3, pi - 1e-8, pi - 1e-12};

TEST(So3, SkewIsTheCrossProduct) {
  TestRng rng;
  const Eigen::Vector3d a = rng.normal3(), b = rng.normal3();
  EXPECT_THAT(skew(a) * b, IsNearMatrix(a.cross(b), 4 * kEpsilon * a.norm() * b.norm()));
  EXPECT_THAT(skew(a).transpose(), IsNearMatrix(-skew(a), 0.0));
}

TEST(So3, ExpOfAQuarterTurnAboutZTakesXToY) {
  const Eigen::Vector3d y = so3_exp({0, 0, pi / 2}) * Eigen::Vector3d::UnitX();
  EXPECT_THAT(y, IsNearMatrix(Eigen::Vector3d::UnitY(), 4 * kEpsilon));
}

TEST(So3, ExpOfNothingIsExactlyTheIdentity) {
  EXPECT_EQ(so3_exp(Eigen::Vector3d::Zero()).coeffs(), Eigen::Quaterniond::Identity().coeffs());
  EXPECT_EQ(so3_log(Eigen::Quaterniond::Identity()), Eigen::Vector3d::Zero());
}

TEST(So3, ExpAgreesWithEigenAtEveryAngle) {
  TestRng rng;
  for (const double angle : kAngles) {
    const Eigen::Vector3d axis = rng.normal3().normalized();
    const Eigen::Quaterniond expected(Eigen::AngleAxisd(angle, axis));
    EXPECT_LE(so3_exp(angle * axis).angularDistance(expected), 8 * kEpsilon) << angle;
  }
}

TEST(So3, LogUndoesExpToRelativePrecision) {
  TestRng rng;
  for (const double angle : kAngles) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d r = angle * rng.normal3().normalized();
      // Relative: also 1e-300 rad come back with all their digits.
      EXPECT_LE((so3_log(so3_exp(r)) - r).norm(), 8 * kEpsilon * angle) << angle;
    }
  }
}

TEST(So3, ExpUndoesLogForRandomRotationsOfEitherSign) {
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Quaterniond q = rng.rotation();
    EXPECT_LE(so3_exp(so3_log(q)).angularDistance(q), 16 * kEpsilon);
    EXPECT_LE(so3_log(q).norm(), pi * (1 + kEpsilon));
    EXPECT_EQ(so3_log(Eigen::Quaterniond(-q.coeffs())), so3_log(q));
  }
}

TEST(So3, LogOfAHalfTurnIsPiAboutOneOfTheTwoAxes) {
  const Eigen::Vector3d r = so3_log(Eigen::Quaterniond(0, 0, -1, 0));
  EXPECT_THAT(r.cwiseAbs(), IsNearMatrix(Eigen::Vector3d(0, pi, 0), 2 * kEpsilon * pi));
}

TEST(So3, ExpOfMoreThanATurnIsTheSameRotation) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -2) / 3;
  EXPECT_LE(so3_exp((2 * pi + 0.3) * axis).angularDistance(so3_exp(0.3 * axis)), 16 * kEpsilon);
}

TEST(So3, NanComesOutAsNan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(so3_exp({nan, 0, 0}).coeffs().hasNaN());
  EXPECT_TRUE(so3_log(Eigen::Quaterniond(nan, 0, 0, 0)).hasNaN() ||
              so3_log(Eigen::Quaterniond(1, nan, 0, 0)).hasNaN());
}

TEST(So3, LeftJacobianIsTheDerivativeOfExp) {
  TestRng rng;
  for (const double angle : kAngles) {
    const Eigen::Vector3d r = angle * rng.normal3().normalized();
    const Eigen::Quaterniond back = so3_exp(r).conjugate();
    const auto moved = [&](const Eigen::Vector3d& x) { return so3_log(so3_exp(x) * back); };
    // Central differences with 1e-5: 1e-10 of curvature, 1e-11 of rounding.
    EXPECT_THAT(so3_left_jacobian(r), IsNearMatrix(numeric_jacobian(moved, r, 1e-5), 1e-9)) << angle;
  }
}

TEST(So3, LeftJacobianIsExactToRoundingOnBothSidesOfItsSeries) {
  TestRng rng;
  for (const double angle : {1e-12, 1e-8, 0.99e-4, 1.01e-4, 1e-3, 1e-2}) {
    const Eigen::Vector3d r = angle * rng.normal3().normalized();
    const Eigen::Matrix3d s = skew(r);
    // sum s^k / (k + 1)!: the last term left out is 1e-2^8 / 9! = 3e-22.
    Eigen::Matrix3d series = Eigen::Matrix3d::Zero(), term = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 8; ++k) {
      series += term;
      term = (term * s / (k + 2)).eval();
    }
    EXPECT_THAT(so3_left_jacobian(r), IsNearMatrix(series, 4 * kEpsilon)) << angle;
  }
}

TEST(So3, LeftJacobianKeepsTheAxis) {
  // A longer vector along the axis is a further turn about it: J r = r, at every angle.
  TestRng rng;
  for (const double angle : kAngles) {
    const Eigen::Vector3d r = angle * rng.normal3().normalized();
    EXPECT_LE((so3_left_jacobian(r) * r - r).norm(), 16 * kEpsilon * angle) << angle;
  }
}

TEST(So3, NearestRotationOfARotationIsItself) {
  TestRng rng;
  for (int i = 0; i < 100; ++i) {
    const Eigen::Matrix3d R = rng.rotation().toRotationMatrix();
    EXPECT_THAT(nearest_rotation(R), IsNearMatrix(R, 32 * kEpsilon));
    EXPECT_THAT(nearest_rotation(1e6 * R), IsNearMatrix(R, 32 * kEpsilon));
  }
}

TEST(So3, NoNeighbourIsNearerThanTheNearestRotation) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    Eigen::Matrix3d m;
    m << rng.normal3(), rng.normal3(), rng.normal3();  // determinants of both signs
    const Eigen::Matrix3d R = nearest_rotation(m);
    EXPECT_NEAR(R.determinant(), 1, 32 * kEpsilon);
    EXPECT_THAT(R * R.transpose(), IsNearMatrix(Eigen::Matrix3d::Identity(), 32 * kEpsilon));
    const Eigen::Matrix3d neighbour = so3_exp(rng.normal3(0.1)).toRotationMatrix() * R;
    EXPECT_LE((R - m).norm(), (neighbour - m).norm());
  }
}

TEST(So3, NearestRotationOfAMirrorIsNoMirror) {
  const Eigen::Matrix3d mirror = Eigen::Vector3d(3, 2, -1).asDiagonal();
  // The sign is given up where the singular value is smallest.
  EXPECT_THAT(nearest_rotation(mirror), IsNearMatrix(Eigen::Matrix3d::Identity(), 8 * kEpsilon));
}

TEST(So3, NearestRotationOfASingularMatrixIsARotation) {
  EXPECT_NEAR(nearest_rotation(Eigen::Matrix3d::Zero()).determinant(), 1, 8 * kEpsilon);
  EXPECT_NEAR(nearest_rotation(Eigen::Matrix3d::Ones()).determinant(), 1, 8 * kEpsilon);
}

}  // namespace
}  // namespace perch
