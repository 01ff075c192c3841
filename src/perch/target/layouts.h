#pragma once

#include "perch/target/landing_target.h"

namespace perch {

// The two kinds of target, each from its own part of the schema. `section` is the whole file, of which `name`
// and `type` have been read; both set everything but the name. For read_target.
void read_squares(Section& section, LandingTarget& target);
void read_apriltag(Section& section, LandingTarget& target);

// Sides of what is printed, m: outside of it somebody wrote millimetres.
inline constexpr Range kPrintable{0.001, 100};

// A key without a sensible default.
inline void require(const Section& section, std::string_view key, const std::string& expected) {
  if (!section.has(key)) section.fail(key, expected);
}

}  // namespace perch
