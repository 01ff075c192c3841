#pragma once

#include <Eigen/Core>
#include <type_traits>

namespace perch {

// d f / d x at x by central differences. The error is some step^2 * f''' + epsilon * |f| / step.
template <typename F, typename Vector>
auto numeric_jacobian(const F& f, const Vector& x, double step) {
  using Value = std::decay_t<decltype(f(x).eval())>;
  Eigen::Matrix<double, Value::RowsAtCompileTime, Vector::RowsAtCompileTime> jacobian;
  for (Eigen::Index i = 0; i < x.rows(); ++i) {
    Vector high = x, low = x;
    high(i) += step;
    low(i) -= step;
    jacobian.col(i) = (f(high) - f(low)) / (2 * step);
  }
  return jacobian;
}

}  // namespace perch
