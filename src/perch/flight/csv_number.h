#pragma once

#include <charconv>
#include <string>

namespace perch {

// Appends the shortest text that reads back as the same number; a format where it is to be another.
template <typename... Format>
void append_number(std::string& text, auto value, Format... format) {
  char buffer[512];  // 1e308 in fixed format has 309 digits
  const auto [end, error] = std::to_chars(buffer, buffer + sizeof(buffer), value, format...);
  text.append(buffer, end);
}

// With the comma before it.
inline void append_field(std::string& csv, double value) {
  csv += ',';
  append_number(csv, value);
}

}  // namespace perch
