#include "perch/simulation/serial_line.h"

#include <algorithm>
#include <cmath>

namespace perch {

SerialLine::SerialLine(double baud, double flipped, uint64_t seed)
    : byte_ns_(baud > 0 ? 1e10 / baud : 0), flipped_(flipped), random_(seed) {}

void SerialLine::send(std::span<const uint8_t> bytes, int64_t time_ns) {
  for (uint8_t byte : bytes) {
    if (random_.uniform() < flipped_) byte = static_cast<uint8_t>(byte ^ (1U << (random_.bits() % 8)));
    free_ns_ = std::max(free_ns_, time_ns) + std::llround(byte_ns_);
    under_way_.push_back({free_ns_, byte});
  }
}

std::vector<uint8_t> SerialLine::receive(int64_t time_ns) {
  std::vector<uint8_t> bytes;
  for (; !under_way_.empty() && under_way_.front().time_ns <= time_ns; under_way_.pop_front())
    bytes.push_back(under_way_.front().value);
  return bytes;
}

}  // namespace perch
