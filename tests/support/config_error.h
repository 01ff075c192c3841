#pragma once

#include <gmock/gmock.h>

#include <functional>
#include <string>

#include "perch/config/error.h"

namespace perch {

// What a ConfigError says; "no error" when none is thrown. Other exceptions go on and fail the test.
inline std::string config_error(const std::function<void()>& action) {
  try {
    action();
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace perch
