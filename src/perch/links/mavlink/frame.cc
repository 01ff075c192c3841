#include "perch/links/mavlink/frame.h"

#include "perch/links/mavlink/crc.h"

namespace perch::mavlink {

void append_frame(std::vector<uint8_t>& out, const FrameHeader& header, const MessageInfo& info,
                  const void* message, Signing* signing) {
  std::array<uint8_t, kMaxPayload> payload{};
  write_payload(info, message, payload);
  const bool v1 = header.version == 1;
  size_t length = v1 ? info.min_length : info.length;
  // Trailing zeros are not sent, but for the first byte.
  while (!v1 && length > 1 && payload[length - 1] == 0) --length;

  const size_t start = out.size();
  const uint8_t incompatible = signing && !v1 ? 1 : 0;
  const auto byte = [](size_t value) { return static_cast<uint8_t>(value); };
  if (v1) {
    out.insert(out.end(),
               {0xFE, byte(length), header.sequence, header.system, header.component, byte(info.id)});
  } else {
    out.insert(out.end(), {0xFD, byte(length), incompatible, 0, header.sequence, header.system,
                           header.component, byte(info.id), byte(info.id >> 8), byte(info.id >> 16)});
  }
  out.insert(out.end(), payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(length));
  const uint16_t crc = crc_add(crc_add(kCrcStart, std::span(out).subspan(start + 1)), info.crc_extra);
  out.insert(out.end(), {byte(crc), byte(crc >> 8)});
  if (incompatible) {
    std::array<uint8_t, kSignatureSize> signature{};
    signing->sign(std::span(out).subspan(start), signature);
    out.insert(out.end(), signature.begin(), signature.end());
  }
}

}  // namespace perch::mavlink
