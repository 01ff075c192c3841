#pragma once

#include <stdexcept>

namespace perch {

// what(): "run.yaml:7: camera.rate: expected a number above 0, found \"fast\"".
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace perch
