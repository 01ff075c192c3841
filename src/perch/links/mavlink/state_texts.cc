#include "perch/links/mavlink/state_texts.h"

#include <string>

#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {

std::string_view name_of(PadState state) {
  constexpr std::string_view kNames[] = {"SEARCH", "TRACK", "COAST", "LOST"};
  return kNames[static_cast<size_t>(state)];
}

std::optional<Statustext> StateTexts::update(PadState state, int64_t now_ns) {
  constexpr int64_t kPeriod = 1'000'000'000;
  if (told_ && (*told_ == state || now_ns - told_ns_ < kPeriod)) return std::nullopt;
  told_ = state;
  told_ns_ = now_ns;
  Statustext text;
  // A ground station speaks a warning aloud: one is enough.
  text.severity = state == PadState::kLost ? mav_severity::kWarning : mav_severity::kInfo;
  set_text(text.text, "Perch: pad " + std::string(name_of(state)));
  return text;
}

}  // namespace perch::mavlink
