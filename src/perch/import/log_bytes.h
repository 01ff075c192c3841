#pragma once

#include <cstring>
#include <limits>

#include "perch/import/log_tables.h"

namespace perch {

// A number as logs hold it: little-endian, as are the machines that Perch runs on. The caller has checked
// that it lies within the bytes.
template <typename Number>
Number load(LogBytes bytes, size_t offset) {
  Number number;
  std::memcpy(&number, bytes.data() + offset, sizeof number);
  return number;
}

// Text up to its end or a null byte.
inline std::string load_text(LogBytes bytes) {
  const auto* begin = reinterpret_cast<const char*>(bytes.data());
  return {begin, strnlen(begin, bytes.size())};
}

// How a field becomes a column's number.
template <typename Number>
double load_as_double(LogBytes bytes, size_t offset) {
  return static_cast<double>(load<Number>(bytes, offset));
}
inline double no_number(LogBytes, size_t) { return std::numeric_limits<double>::quiet_NaN(); }

}  // namespace perch
