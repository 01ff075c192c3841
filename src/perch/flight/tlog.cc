#include "perch/flight/tlog.h"

namespace perch {
namespace {

constexpr uint8_t kMagic1 = 0xFE, kMagic2 = 0xFD;
constexpr size_t kLongestFrame = 280;

bool begins_frame(uint8_t byte) { return byte == kMagic1 || byte == kMagic2; }

}  // namespace

// The length of the frame that partial_ begins with; 0 while that is not known, or it is none.
size_t TlogFramer::frame_length() const {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(partial_[i]); };
  if (partial_.size() < 3 || !begins_frame(byte(0))) return 0;
  const size_t payload = byte(1);
  if (byte(0) == kMagic1) return 6 + payload + 2;
  const bool is_signed = (byte(2) & 1) != 0;
  return 10 + payload + 2 + (is_signed ? 13 : 0);
}

void TlogFramer::flush(std::string& tlog) {
  if (partial_.empty()) return;
  for (int shift = 56; shift >= 0; shift -= 8) {
    tlog += static_cast<char>(static_cast<uint64_t>(time_us_) >> shift & 0xFF);
  }
  tlog += partial_;
  partial_.clear();
}

void TlogFramer::add(uint8_t byte, std::string& tlog) {
  const bool garbage = !partial_.empty() && !begins_frame(static_cast<uint8_t>(partial_[0]));
  if (garbage && (begins_frame(byte) || partial_.size() == kLongestFrame)) flush(tlog);
  partial_ += static_cast<char>(byte);
}

void TlogFramer::add(int64_t unix_us, std::span<const uint8_t> bytes, std::string& tlog) {
  for (const uint8_t byte : bytes) {
    add(byte, tlog);
    time_us_ = unix_us;
    if (partial_.size() == frame_length()) flush(tlog);
  }
}

}  // namespace perch
