#include "calib/camera/numpy_archive.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace perch {
namespace {

static_assert(std::endian::native == std::endian::little,
              "the types below are written as they are in memory");

template <typename T>
std::string raw(const T* values, size_t count) {
  return std::string(reinterpret_cast<const char*>(values), count * sizeof(T));
}

template <typename... T>
void append(std::string& to, const T&... values) {
  ((to += raw(&values, 1)), ...);
}

uint32_t crc32(const std::string& data) {
  uint32_t crc = ~0u;
  for (const char c : data) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320u : 0u);
  }
  return ~crc;
}

}  // namespace

void NumpyArchive::add(const std::string& name, const Shape& shape, const std::vector<double>& values) {
  add_array(name, "<f8", shape, raw(values.data(), values.size()));
}

void NumpyArchive::add(const std::string& name, const Shape& shape, const std::vector<int32_t>& values) {
  add_array(name, "<i4", shape, raw(values.data(), values.size()));
}

void NumpyArchive::add_bool(const std::string& name, bool value) {
  add_array(name, "|b1", {}, std::string(1, value ? '\1' : '\0'));
}

void NumpyArchive::add(const std::string& name, const Shape& shape, const std::vector<std::string>& values) {
  size_t longest = 1;
  for (const auto& value : values) longest = std::max(longest, value.size());
  std::string data;
  for (const auto& value : values) {
    for (size_t i = 0; i < longest; ++i) {
      // UTF-32; what is not ASCII, in a file's name, is shown as a question mark.
      const auto c = i < value.size() ? static_cast<unsigned char>(value[i]) : 0u;
      append(data, uint32_t{c < 128 ? c : '?'});
    }
  }
  add_array(name, "<U" + std::to_string(longest), shape, data);
}

// https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html
void NumpyArchive::add_array(const std::string& name, const std::string& type, const Shape& shape,
                             const std::string& data) {
  std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (";
  for (const size_t n : shape) header += std::to_string(n) + ",";
  header += "), }";
  while ((10 + header.size() + 1) % 64 != 0) header += ' ';
  header += '\n';
  std::string file = "\x93NUMPY\x01";
  file += '\0';
  append(file, static_cast<uint16_t>(header.size()));
  file += header + data;

  // A local header and one for the directory at the end; the date is 1 January 1980.
  const std::string file_name = name + ".npy";
  const auto size = static_cast<uint32_t>(file.size());
  const auto offset = static_cast<uint32_t>(bytes_.size());
  std::string common;
  append(common, uint16_t{20}, uint16_t{0}, uint16_t{0}, uint16_t{0}, uint16_t{0x21}, crc32(file), size, size,
         static_cast<uint16_t>(file_name.size()), uint16_t{0});
  bytes_ += "PK\x03\x04" + common + file_name + file;
  directory_ += "PK\x01\x02";
  append(directory_, uint16_t{20});
  directory_ += common;
  append(directory_, uint16_t{0}, uint16_t{0}, uint16_t{0}, uint32_t{0}, offset);
  directory_ += file_name;
  ++count_;
}

std::string NumpyArchive::finish() {
  const auto offset = static_cast<uint32_t>(bytes_.size());
  bytes_ += directory_ + "PK\x05\x06";
  append(bytes_, uint32_t{0}, count_, count_, static_cast<uint32_t>(directory_.size()), offset, uint16_t{0});
  return bytes_;
}

std::string base85(const std::string& bytes) {
  constexpr char kDigits[] =
      "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;<=>?@^_`{|}~";
  std::string text;
  for (size_t i = 0; i < bytes.size(); i += 4) {
    uint32_t group = 0;
    for (size_t k = 0; k < 4; ++k)
      group = group << 8 | (i + k < bytes.size() ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    char digits[5];
    for (size_t k = 5; k-- > 0; group /= 85) digits[k] = kDigits[group % 85];
    text.append(digits, std::min<size_t>(5, bytes.size() - i + 1));
  }
  return text;
}

}  // namespace perch
