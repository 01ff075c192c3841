#include "perch/links/visca/parser.h"

namespace perch::visca {

void Parser::parse(std::span<const uint8_t> bytes, const OnPacket& on_packet) {
  for (const uint8_t byte : bytes) {
    if (byte == kEnd) {
      if (packet_.size() + 1 < kShortest) {
        skipped_ += packet_.size() + 1;
      } else {
        packet_.push_back(byte);
        ++packets_;
        on_packet(packet_);
      }
      packet_.clear();
    } else if (byte >= 0x80) {
      skipped_ += packet_.size();
      packet_.assign(1, byte);
    } else if (packet_.empty() || packet_.size() + 1 >= kLongest) {
      skipped_ += packet_.size() + 1;
      packet_.clear();
    } else {
      packet_.push_back(byte);
    }
  }
}

}  // namespace perch::visca
