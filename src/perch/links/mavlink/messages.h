#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include "perch/links/mavlink/messages_gimbal.h"
#include "perch/links/mavlink/messages_landing.h"
#include "perch/links/mavlink/messages_system.h"
#include "perch/links/mavlink/messages_vehicle.h"

namespace perch::mavlink {

// A char array is text up to its first NUL, or all of it: 50 characters of STATUSTEXT have none.
template <std::size_t N>
std::string text_of(const std::array<char, N>& field) {
  return {field.begin(), std::find(field.begin(), field.end(), '\0')};
}

// The text, cut to what the field holds, the rest NUL.
template <std::size_t N>
void set_text(std::array<char, N>& field, std::string_view text) {
  field.fill('\0');
  std::copy_n(text.begin(), std::min(text.size(), N), field.begin());
}

}  // namespace perch::mavlink
