#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "perch/links/mavlink/frame.h"
#include "perch/links/mavlink/signing.h"

namespace perch::mavlink {

// What was heard of one (system, component).
struct SourceStatistics {
  uint64_t received = 0;  // frames, those of unknown messages too
  uint64_t lost = 0;      // by gaps of the sequence numbers
  uint64_t late = 0;      // out of order or doubled: a step of half a turn or more
  uint8_t last_sequence = 0;
};

struct ParserStatistics {
  uint64_t good = 0;          // delivered
  uint64_t bad_crc = 0;       // what began like a frame of a known message and was none
  uint64_t unknown = 0;       // messages not in our table
  uint64_t incompatible = 0;  // with an incompatibility flag nobody knows
  uint64_t bad_signature = 0;
  uint64_t replayed = 0;
  uint64_t unsigned_refused = 0;
  uint64_t skipped_bytes = 0;  // outside of frames
  uint64_t bytes = 0;
  std::map<std::pair<uint8_t, uint8_t>, SourceStatistics> sources;  // by system, component
};

// Finds MAVLink frames in bytes that come in pieces of any size, and may be garbage.
//
//   FrameParser parser;
//   parser.parse(bytes, [&](const Frame& frame) { ... });
//
// After a wrong CRC the search goes on at the byte after the false magic, so that no good frame is lost to a
// bad one before it. How a stream is cut into pieces changes nothing.
class FrameParser {
 public:
  using OnFrame = std::function<void(const Frame&)>;

  // With `signing` (it must outlive the parser) frames have to be signed; without, signatures are not looked
  // at.
  explicit FrameParser(Signing* signing = nullptr) : signing_(signing) {}

  // Bytes of a stream: a frame may go on in the next piece.
  void parse(std::span<const uint8_t> bytes, const OnFrame& on_frame);
  // A datagram holds whole frames: nothing goes from one to the next.
  void parse_datagram(std::span<const uint8_t> bytes, const OnFrame& on_frame);
  // The rest of a frame that began will not come any more: looks for others in what is there. A false magic
  // could otherwise hold back up to 280 bytes, which is a long time on a quiet link.
  void give_up_waiting(const OnFrame& on_frame);
  bool waiting() const { return read_ < buffer_.size(); }

  const ParserStatistics& statistics() const { return statistics_; }

 private:
  enum class Step { kWait, kSkipByte, kSkipFrame, kDeliver };
  struct Candidate {
    Frame frame;
    uint32_t id = 0;
    uint8_t incompatible = 0;
    size_t size = 0;         // bytes, with signature
    size_t signed_size = 0;  // bytes from the magic to the CRC
  };

  void run(bool complete, const OnFrame& on_frame);
  std::optional<Candidate> candidate(std::span<const uint8_t> bytes) const;
  Step judge(std::span<const uint8_t> bytes, bool complete, Candidate& candidate);
  Step judge_unknown(std::span<const uint8_t> bytes, bool complete, const Candidate& candidate);
  bool accept_signature(std::span<const uint8_t> bytes, const Candidate& candidate);
  void count_source(const Candidate& candidate);

  Signing* signing_;
  std::vector<uint8_t> buffer_;
  size_t read_ = 0;       // the first byte not yet judged
  bool in_step_ = false;  // a frame ended right before it
  ParserStatistics statistics_;
};

}  // namespace perch::mavlink
