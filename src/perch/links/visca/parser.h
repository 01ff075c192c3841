#pragma once

#include <cstdint>
#include <functional>
#include <span>

#include "perch/links/visca/packets.h"

namespace perch::visca {

// Packets out of a stream of bytes, whatever the bytes are: a packet is what begins with the first byte of
// one (8x or z0) and ends with FF. A first byte in the middle of another packet means that its end was lost,
// for nothing inside a packet of ours is 80 or above; what grows beyond 16 bytes is none.
class Parser {
 public:
  using OnPacket = std::function<void(std::span<const uint8_t>)>;

  void parse(std::span<const uint8_t> bytes, const OnPacket& on_packet);
  // What is there does not go on: a line that was silent.
  void drop() { packet_.clear(); }
  bool waiting() const { return !packet_.empty(); }

  uint64_t packets() const { return packets_; }
  uint64_t bytes_skipped() const { return skipped_; }

 private:
  Bytes packet_;
  uint64_t packets_ = 0, skipped_ = 0;
};

}  // namespace perch::visca
