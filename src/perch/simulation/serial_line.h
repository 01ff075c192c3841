#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <vector>

#include "perch/simulation/random.h"

namespace perch {

// One direction of a serial line: a byte takes ten bits, and waits for those before it. On request some are
// garbled: one bit of theirs turns over.
class SerialLine {
 public:
  // `flipped`: part of the bytes; a `baud` of 0 takes no time.
  SerialLine(double baud, double flipped, uint64_t seed);

  void send(std::span<const uint8_t> bytes, int64_t time_ns);
  // What has arrived by then.
  std::vector<uint8_t> receive(int64_t time_ns);

 private:
  struct Byte {
    int64_t time_ns;
    uint8_t value;
  };
  double byte_ns_;
  double flipped_;
  RandomStream random_;
  std::deque<Byte> under_way_;
  int64_t free_ns_ = 0;
};

}  // namespace perch
