#pragma once

#include <string>

#include "support/ulog_writer.h"

namespace perch {

// Writes a DataFlash log from ArduPilot's description of it alone.
class DataflashWriter {
 public:
  DataflashWriter() { format(0x80, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"); }
  void format(uint8_t id, const std::string& name, const std::string& characters, const std::string& labels) {
    size_t length = 3;
    for (const char c : characters) length += size_of(c);
    bytes += head(0x80) + packed(id, static_cast<uint8_t>(length)) + padded(name, 4) +
             padded(characters, 16) + padded(labels, 64);
  }
  // The numbers as they are stored.
  template <typename... Numbers>
  void row(uint8_t id, Numbers... numbers) {
    bytes += head(id) + packed(numbers...);
  }
  void units(uint8_t id, uint64_t time_us, uint8_t of, const std::string& units,
             const std::string& multipliers) {
    bytes += head(id) + packed(time_us, of) + padded(units, 16) + padded(multipliers, 16);
  }

  std::string bytes;

 private:
  static std::string head(uint8_t id) { return std::string("\xA3\x95") + static_cast<char>(id); }
  static std::string padded(std::string text, size_t size) {
    text.resize(size, '\0');
    return text;
  }
  static size_t size_of(char c) {
    switch (c) {
      case 'b':
      case 'B':
      case 'M':
        return 1;
      case 'h':
      case 'H':
      case 'c':
      case 'C':
        return 2;
      case 'q':
      case 'Q':
      case 'd':
        return 8;
      case 'N':
        return 16;
      case 'Z':
      case 'a':
        return 64;
      default:
        return 4;
    }
  }
};

}  // namespace perch
