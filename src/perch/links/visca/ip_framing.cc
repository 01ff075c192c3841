#include "perch/links/visca/ip_framing.h"

namespace perch::visca {
namespace {

constexpr size_t kHeader = 8;

}  // namespace

Bytes ip_datagram(IpType type, uint32_t sequence, std::span<const uint8_t> payload) {
  Bytes bytes;
  const auto append = [&](uint32_t value, int size) {
    for (int shift = 8 * (size - 1); shift >= 0; shift -= 8)
      bytes.push_back(static_cast<uint8_t>((value >> shift) & 0xFF));
  };
  append(static_cast<uint16_t>(type), 2);
  append(static_cast<uint32_t>(payload.size()), 2);
  append(sequence, 4);
  bytes.insert(bytes.end(), payload.begin(), payload.end());
  return bytes;
}

IpType ip_type_of(std::span<const uint8_t> packet) {
  return packet.size() > 1 && packet[1] == 0x09 ? IpType::kInquiry : IpType::kCommand;
}

Bytes ip_reset_sequence() {
  constexpr uint8_t kReset[] = {0x01};
  return ip_datagram(IpType::kControl, 0, kReset);
}

std::optional<IpMessage> read_ip_datagram(std::span<const uint8_t> datagram) {
  if (datagram.size() < kHeader) return std::nullopt;
  const auto number = [&](size_t at, size_t size) {
    uint32_t value = 0;
    for (size_t i = 0; i < size; ++i) value = value << 8 | datagram[at + i];
    return value;
  };
  if (number(2, 2) != datagram.size() - kHeader) return std::nullopt;
  const uint32_t type = number(0, 2);
  switch (static_cast<IpType>(type)) {
    case IpType::kCommand:
    case IpType::kInquiry:
    case IpType::kReply:
    case IpType::kDeviceSetting:
    case IpType::kControl:
    case IpType::kControlReply:
      return IpMessage{static_cast<IpType>(type), number(4, 4), datagram.subspan(kHeader)};
  }
  return std::nullopt;
}

bool is_ip_error(const IpMessage& message) {
  const bool control = message.type == IpType::kControl || message.type == IpType::kControlReply;
  return control && message.payload.size() == 2 && message.payload[0] == 0x0F;
}

}  // namespace perch::visca
