#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "perch/links/visca/packets.h"

namespace perch::visca {

// VISCA over IP (Sony's later models, UDP port 52381): the same packets, each in a datagram behind
//
//   type (2 bytes)   length (2)   sequence (4)      big-endian
//
// An answer bears the sequence number of what it answers, so that a late one is known as such.
enum class IpType : uint16_t {
  kCommand = 0x0100,
  kInquiry = 0x0110,
  kReply = 0x0111,
  kDeviceSetting = 0x0120,
  kControl = 0x0200,
  kControlReply = 0x0201
};

struct IpMessage {
  IpType type = IpType::kReply;
  uint32_t sequence = 0;
  std::span<const uint8_t> payload;
};

Bytes ip_datagram(IpType type, uint32_t sequence, std::span<const uint8_t> payload);
// The type that a packet of the controller's is sent with.
IpType ip_type_of(std::span<const uint8_t> packet);
// The control message that starts the numbers anew; the sequence number after it is 0.
Bytes ip_reset_sequence();
// Empty when the datagram is not one whole message.
std::optional<IpMessage> read_ip_datagram(std::span<const uint8_t> datagram);
// A control message by which the device says that it missed a sequence number (0F 01) or the message (0F 02).
bool is_ip_error(const IpMessage& message);

}  // namespace perch::visca
