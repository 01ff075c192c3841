#pragma once

#include <cstdint>
#include <cstring>
#include <string>

namespace perch {

// Values one after the other, little-endian, as ULog and DataFlash have them.
template <typename... Numbers>
std::string packed(Numbers... numbers) {
  std::string bytes;
  const auto append = [&](auto number) {
    char raw[sizeof number];
    std::memcpy(raw, &number, sizeof number);
    bytes.append(raw, sizeof number);
  };
  (append(numbers), ...);
  return bytes;
}

// Writes a ULog from its format's specification alone, so that it and the reader can accuse each other.
class UlogWriter {
 public:
  explicit UlogWriter(uint64_t start_us = 0) {
    bytes = std::string("ULog\x01\x12\x35", 7) + '\x01' + packed(start_us);
    message('B', std::string(40, '\0'));
    message('I', std::string("\x11") + "char[4] sys_namePX4 ");
  }
  // "uint64_t timestamp;float[4] q;"
  void format(const std::string& topic, const std::string& fields) { message('F', topic + ":" + fields); }
  void subscribe(uint16_t id, const std::string& topic, uint8_t instance = 0) {
    message('A', packed(instance, id) + topic);
  }
  template <typename... Numbers>
  void row(uint16_t id, Numbers... numbers) {
    message('D', packed(id, numbers...));
  }
  void message(char type, const std::string& body) {
    bytes += packed(static_cast<uint16_t>(body.size())) + type + body;
  }

  std::string bytes;
};

}  // namespace perch
