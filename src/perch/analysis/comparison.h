#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace perch {

// What two runs over the same frames made of some of them: of a flight, or of a second of one. A is the run
// before, B the one in question. Errors are of frames that both have a pose of: who finds more of the hard
// frames would seem the less accurate else.
struct ComparedFrames {
  size_t frames = 0;
  std::array<size_t, 2> ok{};  // with a pose: A, B
  std::array<double, 2> us{};  // all frames' times
  size_t both = 0;             // compared with navigation by both
  // Sums of squares over those.
  std::array<double, 2> position{};    // m^2
  std::array<double, 2> over_range{};  // of position over range
  std::array<double, 2> angles{};      // of yaw, pitch and roll, rad^2

  ComparedFrames& operator+=(const ComparedFrames& other);
};

// With the bounds that hold 95 % of what other flights of the same kind would have shown (percentile
// bootstrap).
struct Interval {
  double value = 0, low = 0, high = 0;
};

enum class Verdict { kBetter, kWorse, kUnchanged, kUnclear };

struct Change {
  Interval percent;  // of the frames for what is found, else of what it was in A
  Verdict verdict = Verdict::kUnclear;
  bool counts = true;  // times do not: they are the machine's as well
  std::string sentence;
};

// The changes of all that both runs know, each in a plain sentence. `samples` are what is drawn anew, with
// replacement, by a generator with a fixed seed: flights, or seconds of a few flights, whose interval then
// speaks of these flights alone. Unchanged: the interval is within the tolerance. Better or worse: it does
// not reach 0, and the change is more than the tolerance. Unclear is the rest.
inline constexpr double kFoundTolerancePercent = 0.1;
inline constexpr double kErrorTolerancePercent = 2;
std::vector<Change> changes_of(std::span<const ComparedFrames> samples);

}  // namespace perch
