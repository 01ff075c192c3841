#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "perch/links/mavlink/message_table.h"
#include "perch/links/mavlink/signing.h"

namespace perch::mavlink {

inline constexpr size_t kLongestFrameSize = 280;  // MAVLink 2, 255 bytes of payload, signed

// A received frame of a known message whose CRC (and signature, with a key) was right. The system may still
// be 0, which is no one's, and a float may be NaN: whoever uses the values looks at them.
struct Frame {
  const MessageInfo* info = nullptr;
  uint8_t version = 2;
  uint8_t sequence = 0;
  uint8_t system = 0;
  uint8_t component = 0;
  bool is_signed = false;
  uint8_t payload_length = 0;  // as received, truncated or longer than we know
  std::array<uint8_t, kMaxPayload> payload{};

  uint32_t id() const { return info->id; }
};

// The frame's message, when it is one of type Message.
//
//   if (const auto heartbeat = decode<Heartbeat>(frame)) ...
template <class Message>
std::optional<Message> decode(const Frame& frame) {
  if (frame.id() != Message::kId) return std::nullopt;
  Message message;
  read_payload(*frame.info, std::span(frame.payload).first(frame.payload_length), &message);
  return message;
}

struct FrameHeader {
  uint8_t version = 2;
  uint8_t sequence = 0;
  uint8_t system = 0;
  uint8_t component = 0;
};

// Appends the frame of one message. MAVLink 2 is truncated and, with `signing`, signed; MAVLink 1 carries
// neither extensions nor signatures.
void append_frame(std::vector<uint8_t>& out, const FrameHeader& header, const MessageInfo& info,
                  const void* message, Signing* signing = nullptr);

// Frames of one sender, numbered.
class FrameWriter {
 public:
  // `signing` may be null and must outlive the writer.
  FrameWriter(uint8_t system, uint8_t component, Signing* signing = nullptr)
      : header_{2, 0, system, component}, signing_(signing) {}

  template <class Message>
  void append(std::vector<uint8_t>& out, const Message& message) {
    append_frame(out, header_, *find_message(Message::kId), &message, signing_);
    ++header_.sequence;
  }

  void set_system(uint8_t system) { header_.system = system; }
  uint8_t system() const { return header_.system; }
  uint8_t component() const { return header_.component; }

 private:
  FrameHeader header_;
  Signing* signing_;
};

}  // namespace perch::mavlink
