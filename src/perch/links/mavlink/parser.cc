#include "perch/links/mavlink/parser.h"

#include <algorithm>

#include "perch/links/mavlink/crc.h"
#include "perch/links/mavlink/messages_system.h"

namespace perch::mavlink {
namespace {

constexpr uint8_t kMagic1 = 0xFE;
constexpr uint8_t kMagic2 = 0xFD;
constexpr uint8_t kSignedFlag = 1;  // the only incompatibility flag there is

// More would come only from someone who makes them up; the statistics must not grow without end.
constexpr size_t kMaxSources = 256;

bool is_magic(uint8_t byte) { return byte == kMagic1 || byte == kMagic2; }

}  // namespace

void FrameParser::parse(std::span<const uint8_t> bytes, const OnFrame& on_frame) {
  buffer_.erase(buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(read_));
  read_ = 0;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  statistics_.bytes += bytes.size();
  run(false, on_frame);
}

void FrameParser::parse_datagram(std::span<const uint8_t> bytes, const OnFrame& on_frame) {
  give_up_waiting(on_frame);
  in_step_ = true;
  buffer_.assign(bytes.begin(), bytes.end());
  read_ = 0;
  statistics_.bytes += bytes.size();
  run(true, on_frame);
}

void FrameParser::give_up_waiting(const OnFrame& on_frame) { run(true, on_frame); }

void FrameParser::run(bool complete, const OnFrame& on_frame) {
  while (read_ < buffer_.size()) {
    const auto rest = std::span<const uint8_t>(buffer_).subspan(read_);
    Candidate found;
    switch (judge(rest, complete, found)) {
      case Step::kWait:
        return;
      case Step::kSkipByte:
        ++read_;
        ++statistics_.skipped_bytes;
        in_step_ = false;
        break;
      case Step::kSkipFrame:
        read_ += found.size;
        in_step_ = true;
        break;
      case Step::kDeliver:
        read_ += found.size;
        in_step_ = true;
        ++statistics_.good;
        on_frame(found.frame);
        break;
    }
  }
}

// The frame that begins at the first byte, as its header has it; none before the header is complete.
std::optional<FrameParser::Candidate> FrameParser::candidate(std::span<const uint8_t> bytes) const {
  const bool v2 = bytes[0] == kMagic2;
  const size_t header = v2 ? 10 : 6;
  if (bytes.size() < header) return std::nullopt;

  Candidate found;
  Frame& frame = found.frame;
  frame.version = v2 ? 2 : 1;
  frame.payload_length = bytes[1];
  found.incompatible = v2 ? bytes[2] : 0;
  frame.is_signed = found.incompatible & kSignedFlag;
  const auto from_sequence = bytes.subspan(v2 ? 4 : 2);
  frame.sequence = from_sequence[0];
  frame.system = from_sequence[1];
  frame.component = from_sequence[2];
  found.id = from_sequence[3];
  if (v2) found.id |= (uint32_t{bytes[8]} << 8) | (uint32_t{bytes[9]} << 16);
  found.signed_size = header + frame.payload_length + 2;
  found.size = found.signed_size + (frame.is_signed ? kSignatureSize : 0);
  frame.info = find_message(found.id);
  return found;
}

FrameParser::Step FrameParser::judge(std::span<const uint8_t> bytes, bool complete, Candidate& out) {
  if (!is_magic(bytes[0])) return Step::kSkipByte;
  const auto begun = candidate(bytes);
  if (!begun || bytes.size() < begun->size) return complete ? Step::kSkipByte : Step::kWait;
  out = *begun;
  if (!out.frame.info) return judge_unknown(bytes, complete, out);

  const size_t crc_at = out.signed_size - 2;
  const uint16_t crc = crc_add(crc_add(kCrcStart, bytes.subspan(1, crc_at - 1)), out.frame.info->crc_extra);
  if (crc != (bytes[crc_at] | (bytes[crc_at + 1] << 8))) {
    ++statistics_.bad_crc;
    return Step::kSkipByte;
  }
  count_source(out);
  if (out.incompatible & ~kSignedFlag) {
    ++statistics_.incompatible;
    return Step::kSkipFrame;
  }
  if (!accept_signature(bytes, out)) return Step::kSkipFrame;

  // MAVLink 1 has no extensions; what some senders append there is not looked at.
  size_t length = out.frame.payload_length;
  if (out.frame.version == 1) length = std::min(length, out.frame.info->min_length);
  const auto payload = bytes.subspan(out.frame.version == 2 ? 10 : 6, length);
  std::copy(payload.begin(), payload.end(), out.frame.payload.begin());
  out.frame.payload_length = static_cast<uint8_t>(length);
  return Step::kDeliver;
}

// The CRC of an unknown message cannot be checked. One that stands right between two others is taken for a
// frame and skipped as a whole: its payload is not searched, where a false magic would hold back what
// follows, and its sequence number counts. Anything else is searched.
FrameParser::Step FrameParser::judge_unknown(std::span<const uint8_t> bytes, bool complete,
                                             const Candidate& found) {
  const bool plausible = in_step_ && found.frame.system != 0 && found.frame.component != 0 &&
                         !(found.incompatible & ~kSignedFlag);
  if (!plausible) return Step::kSkipByte;
  if (bytes.size() == found.size && !complete) return Step::kWait;
  if (bytes.size() > found.size && !is_magic(bytes[found.size])) return Step::kSkipByte;
  ++statistics_.unknown;
  count_source(found);
  return Step::kSkipFrame;
}

bool FrameParser::accept_signature(std::span<const uint8_t> bytes, const Candidate& found) {
  if (!signing_) return true;
  if (!found.frame.is_signed) {
    if (signing_->options().accept_unsigned || found.id == RadioStatus::kId) return true;
    ++statistics_.unsigned_refused;
    return false;
  }
  const auto signature = bytes.subspan(found.signed_size).first<kSignatureSize>();
  switch (
      signing_->check(bytes.first(found.signed_size), signature, found.frame.system, found.frame.component)) {
    case SignatureVerdict::kGood:
      return true;
    case SignatureVerdict::kBad:
      ++statistics_.bad_signature;
      return false;
    case SignatureVerdict::kReplayed:
      ++statistics_.replayed;
      return false;
  }
  return false;
}

void FrameParser::count_source(const Candidate& found) {
  auto& sources = statistics_.sources;
  const std::pair key(found.frame.system, found.frame.component);
  auto source = sources.find(key);
  if (source == sources.end()) {
    if (sources.size() >= kMaxSources) return;
    source = sources.emplace(key, SourceStatistics{1, 0, 0, found.frame.sequence}).first;
    return;
  }
  SourceStatistics& seen = source->second;
  ++seen.received;
  const auto step = static_cast<uint8_t>(found.frame.sequence - seen.last_sequence);
  if (step == 0 || step >= 128) {
    // Behind: it was counted as lost when its successor came.
    ++seen.late;
    if (step != 0 && seen.lost > 0) --seen.lost;
    return;
  }
  seen.lost += step - 1u;
  seen.last_sequence = found.frame.sequence;
}

}  // namespace perch::mavlink
