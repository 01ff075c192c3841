#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "perch/links/mavlink/messages_system.h"

namespace perch::mavlink {

// What the pilot is told of the pad.
//   search: not seen yet; track: seen; coast: not seen, but known well enough for now; lost: was seen, and is
//   no more
enum class PadState { kSearch, kTrack, kCoast, kLost };

std::string_view name_of(PadState state);  // "SEARCH", ...

// A STATUSTEXT for each change of state, at most one a second: of what flickers faster only where it ended is
// told.
class StateTexts {
 public:
  // To be called with the state as it is, changed or not.
  std::optional<Statustext> update(PadState state, int64_t now_ns);

 private:
  std::optional<PadState> told_;
  int64_t told_ns_ = 0;
};

}  // namespace perch::mavlink
