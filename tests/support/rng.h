#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <random>
#include <string>

#include "perch/geometry/rigid3.h"
#include "perch/geometry/so3.h"

namespace perch {

// A random stream seeded from the running test's name and a number: the order of the tests changes nothing,
// and the number repeats a failure.
class TestRng {
 public:
  explicit TestRng(unsigned number = 0) {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    // FNV-1a: std::hash may differ between libraries.
    uint64_t hash = 1469598103934665603ULL ^ number;
    const std::string name = info ? std::string(info->test_suite_name()) + "." + info->name() : "";
    for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
    engine_.seed(hash);
  }

  uint64_t bits() { return engine_(); }
  double uniform(double low, double high) {
    // 53 bits of the engine: std::uniform_real_distribution is not the same everywhere.
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  int index(int count) { return static_cast<int>(uniform(0, count)); }
  double normal(double sigma = 1) {
    // Box-Muller; 1 - u keeps the logarithm finite.
    const double r = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
    return sigma * r * std::cos(6.283185307179586 * uniform(0, 1));
  }
  Eigen::Vector3d normal3(double sigma = 1) { return {normal(sigma), normal(sigma), normal(sigma)}; }
  Eigen::Quaterniond rotation() {
    return Eigen::Quaterniond(normal(), normal(), normal(), normal()).normalized();
  }
  Rigid3 pose(double size) { return {rotation(), normal3(size)}; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace perch
