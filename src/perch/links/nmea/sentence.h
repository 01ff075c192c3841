#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace perch::nmea {

// One NMEA 0183 sentence whose checksum is right. Valid during the call alone.
//
//   $GPHDT,271.4,T*2B    address GPHDT, fields 271.4 and T
struct Sentence {
  std::string_view address;
  std::span<const std::string_view> fields;  // without the address
  int64_t arrival_ns = 0;                    // of its '$', on CLOCK_MONOTONIC

  // "GGA" of any talker.
  bool is(std::string_view formatter) const {
    return address.size() == 5 && address[0] != 'P' && address.substr(2) == formatter;
  }
};

struct SentenceStatistics {
  uint64_t good = 0;
  uint64_t bad_checksum = 0;
  uint64_t broken = 0;  // without a checksum, too long, cut off by the next one or by a byte that is no text
  uint64_t skipped_bytes = 0;  // outside of sentences
};

// Bytes of a stream, cut anywhere, to sentences. A sentence without a checksum is refused: nothing else tells
// whether what came is what was sent, and of one the parser sees only that an even number of flips in one bit
// column can hide.
class SentenceParser {
 public:
  // NMEA's own limit is 82; attitude sentences of several makers are longer.
  static constexpr size_t kLongest = 160;
  static constexpr size_t kMostFields = 40;

  using OnSentence = std::function<void(const Sentence&)>;
  void parse(std::span<const uint8_t> bytes, int64_t arrival_ns, const OnSentence& on_sentence);

  const SentenceStatistics& statistics() const { return statistics_; }

 private:
  void end(const OnSentence& on_sentence);
  void give_up();

  std::string text_;  // from its '$' on; empty between sentences
  size_t star_ = std::string::npos;
  int64_t arrival_ns_ = 0;
  SentenceStatistics statistics_;
};

}  // namespace perch::nmea
