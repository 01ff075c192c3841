#pragma once

#include <cstdint>
#include <span>

namespace perch::mavlink {

// CRC-16/MCRF4XX, which MAVLink calls X.25: start 0xFFFF, polynomial 0x1021 reflected (0x8408), no final xor.
inline constexpr uint16_t kCrcStart = 0xFFFF;

constexpr uint16_t crc_add(uint16_t crc, uint8_t byte) {
  uint8_t t = static_cast<uint8_t>(byte ^ (crc & 0xFF));
  t = static_cast<uint8_t>(t ^ (t << 4));
  return static_cast<uint16_t>((crc >> 8) ^ (t << 8) ^ (t << 3) ^ (t >> 4));
}

constexpr uint16_t crc_add(uint16_t crc, std::span<const uint8_t> bytes) {
  for (const uint8_t byte : bytes) crc = crc_add(crc, byte);
  return crc;
}

}  // namespace perch::mavlink
