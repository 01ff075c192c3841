#include "perch/target/png_resolution.h"

#include <cmath>
#include <cstdint>
#include <string_view>

namespace perch {
namespace {

// Most significant byte first, as all numbers in a PNG.
std::string big_endian(uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes.push_back(static_cast<char>((value >> shift) & 0xff));
  return bytes;
}

// CRC-32 (ISO 3309), bit by bit: a chunk is a dozen bytes.
uint32_t crc32(std::string_view bytes) {
  uint32_t crc = 0xffffffff;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? 0xedb88320 : 0);
  }
  return ~crc;
}

}  // namespace

std::string with_resolution(const std::string& png, double dpi) {
  const auto per_metre = static_cast<uint32_t>(std::lround(dpi / 0.0254));
  const std::string chunk = "pHYs" + big_endian(per_metre) + big_endian(per_metre) + '\x01';  // 1: per metre
  // After the signature of 8 bytes and IHDR, always the first chunk: length, name, 13 bytes, CRC.
  constexpr size_t kAfterHeader = 8 + 4 + 4 + 13 + 4;
  const std::string length = big_endian(static_cast<uint32_t>(chunk.size() - 4));
  return png.substr(0, kAfterHeader) + length + chunk + big_endian(crc32(chunk)) + png.substr(kAfterHeader);
}

}  // namespace perch
