#include "perch/camera/picture_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <optional>
#include <string_view>

namespace perch {

namespace {

// Cameras of today have up to 48 million; 16 bits with alpha then take 400 MB. A file of 1 kB can claim more.
constexpr uint64_t kMaxPixels = 50'000'000;

const char* const kTruncated = "truncated";

std::string size_problem(uint64_t width, uint64_t height) {
  if (width == 0 || height == 0) return "a picture without pixels";
  if (width > kMaxPixels || height > kMaxPixels || width * height > kMaxPixels) {
    return "too large: " + std::to_string(width) + " x " + std::to_string(height);
  }
  return "";
}

uint32_t big_endian(const uint8_t* bytes, int count) {
  uint32_t value = 0;
  for (int i = 0; i < count; ++i) value = value << 8 | bytes[i];
  return value;
}

constexpr std::array<uint32_t, 256> kCrcTable = [] {
  std::array<uint32_t, 256> table{};
  for (uint32_t n = 0; n < 256; ++n) {
    uint32_t c = n;
    for (int bit = 0; bit < 8; ++bit) c = c & 1 ? 0xEDB88320U ^ (c >> 1) : c >> 1;
    table[n] = c;
  }
  return table;
}();

uint32_t crc(std::span<const uint8_t> bytes) {
  uint32_t c = 0xFFFFFFFFU;
  for (const uint8_t byte : bytes) c = kCrcTable[(c ^ byte) & 0xFF] ^ (c >> 8);
  return ~c;
}

// Signature, then chunks: length, type, data, CRC of type and data; the last is IEND.
std::string png_problem(std::span<const uint8_t> bytes) {
  for (size_t at = 8;;) {
    if (bytes.size() - at < 12) return kTruncated;
    const size_t length = big_endian(&bytes[at], 4);
    if (bytes.size() - at - 12 < length) return kTruncated;
    if (big_endian(&bytes[at + 8 + length], 4) != crc(bytes.subspan(at + 4, length + 4))) return "damaged";
    const bool is_header = std::memcmp(&bytes[at + 4], "IHDR", 4) == 0;
    if (at == 8 && (!is_header || length != 13)) return "damaged";
    if (is_header) {
      const auto problem = size_problem(big_endian(&bytes[at + 8], 4), big_endian(&bytes[at + 12], 4));
      if (!problem.empty()) return problem;
    }
    if (std::memcmp(&bytes[at + 4], "IEND", 4) == 0) return "";
    at += 12 + length;
  }
}

// Markers FF xx, most with a length and data; after a start of scan (DA) comes coded data, in which FF is
// followed by 00 or a restart marker; the last is the end of image (D9). What follows it is no concern of
// ours.
std::string jpeg_problem(std::span<const uint8_t> bytes) {
  size_t at = 2;
  bool scanning = false;
  while (at + 1 < bytes.size()) {
    const uint8_t marker = bytes[at + 1];
    if (scanning && (bytes[at] != 0xFF || marker == 0 || (marker >= 0xD0 && marker <= 0xD7))) {
      const auto next = std::find(bytes.begin() + static_cast<std::ptrdiff_t>(at) + 1, bytes.end(), 0xFF);
      at = static_cast<size_t>(next - bytes.begin());
      continue;
    }
    if (bytes[at] != 0xFF) return "damaged";
    if (marker == 0xFF) {  // fill
      ++at;
      continue;
    }
    if (marker == 0xD9) return scanning ? "" : "damaged";
    if (at + 4 > bytes.size()) return kTruncated;
    const size_t length = big_endian(&bytes[at + 2], 2);
    const bool is_frame =
        marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (length < (is_frame ? 8 : 2)) return "damaged";
    if (bytes.size() - at - 2 < length) return kTruncated;
    if (is_frame) {
      const auto problem = size_problem(big_endian(&bytes[at + 7], 2), big_endian(&bytes[at + 5], 2));
      if (!problem.empty()) return problem;
    }
    scanning = scanning || marker == 0xDA;
    at += 2 + length;
  }
  return kTruncated;
}

// "P5 width height maxval", separated by white space and # comments, one white space, then the pixels.
std::string pnm_problem(std::span<const uint8_t> bytes) {
  size_t at = 2;
  const auto number = [&]() -> std::optional<uint64_t> {
    while (at < bytes.size() && (std::isspace(bytes[at]) || bytes[at] == '#')) {
      if (bytes[at++] != '#') continue;
      while (at < bytes.size() && bytes[at] != '\n') ++at;
    }
    std::optional<uint64_t> value;
    for (; at < bytes.size() && std::isdigit(bytes[at]) && value.value_or(0) < kMaxPixels; ++at) {
      value = value.value_or(0) * 10 + (bytes[at] - '0');
    }
    return value;
  };
  const auto width = number(), height = number(), white = number();
  if (!width || !height || !white) return at >= bytes.size() ? kTruncated : "damaged";
  const auto problem = size_problem(*width, *height);
  if (!problem.empty()) return problem;
  const uint64_t samples = *width * *height * (bytes[1] == '6' ? 3 : 1) * (*white > 255 ? 2 : 1);
  return bytes.size() - std::min(bytes.size(), at + 1) < samples ? kTruncated : "";
}

bool starts_with(std::span<const uint8_t> bytes, std::string_view magic) {
  return bytes.size() >= magic.size() && std::memcmp(bytes.data(), magic.data(), magic.size()) == 0;
}

}  // namespace

std::string picture_file_problem(std::span<const uint8_t> bytes) {
  if (bytes.empty()) return "empty";
  if (starts_with(bytes, "\x89PNG\r\n\x1a\n")) return png_problem(bytes);
  if (starts_with(bytes, "\xFF\xD8\xFF")) return jpeg_problem(bytes);
  if (starts_with(bytes, "P5") || starts_with(bytes, "P6")) return pnm_problem(bytes);
  return "";
}

}  // namespace perch
