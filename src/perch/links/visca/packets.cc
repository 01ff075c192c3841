#include "perch/links/visca/packets.h"

#include <algorithm>
#include <cstdlib>

namespace perch::visca {
namespace {

uint8_t to(uint8_t camera) { return static_cast<uint8_t>(0x80 | camera); }

void append_nibbles(Bytes& bytes, int value) {
  const auto bits = static_cast<uint16_t>(value);
  for (int shift = 12; shift >= 0; shift -= 4) bytes.push_back(static_cast<uint8_t>((bits >> shift) & 0x0F));
}

std::optional<uint16_t> nibbles(std::span<const uint8_t> four) {
  unsigned value = 0;
  for (const uint8_t byte : four) {
    if (byte > 0x0F) return std::nullopt;
    value = value << 4 | byte;
  }
  return static_cast<uint16_t>(value);
}

Bytes pan_tilt_move(uint8_t camera, uint8_t how, const SpeedSteps& speed, const PanTiltCounts& counts) {
  Bytes bytes{to(camera), 0x01, 0x06, how, speed.pan, speed.tilt};
  append_nibbles(bytes, counts.pan);
  append_nibbles(bytes, counts.tilt);
  bytes.push_back(kEnd);
  return bytes;
}

uint8_t step_of(int drive) { return static_cast<uint8_t>(std::clamp(std::abs(drive), 1, 0x18)); }
uint8_t sense_of(int drive, uint8_t positive, uint8_t negative) {
  return drive > 0 ? positive : drive < 0 ? negative : uint8_t{0x03};
}

}  // namespace

Bytes address_set() { return {0x88, 0x30, 0x01, kEnd}; }
Bytes if_clear(uint8_t camera) { return {to(camera), 0x01, 0x00, 0x01, kEnd}; }
Bytes if_clear_all() { return {0x88, 0x01, 0x00, 0x01, kEnd}; }
Bytes cancel(uint8_t camera, uint8_t socket) {
  return {to(camera), static_cast<uint8_t>(0x20 | socket), kEnd};
}
Bytes power(uint8_t camera, bool on) {
  return {to(camera), 0x01, 0x04, 0x00, static_cast<uint8_t>(on ? 0x02 : 0x03), kEnd};
}

Bytes pan_tilt_drive(uint8_t camera, const DriveSteps& drive) {
  return {to(camera),
          0x01,
          0x06,
          0x01,
          step_of(drive.pan),
          std::min<uint8_t>(step_of(drive.tilt), 0x14),
          sense_of(drive.pan, 0x02, 0x01),
          sense_of(drive.tilt, 0x01, 0x02),
          kEnd};
}
Bytes pan_tilt_absolute(uint8_t camera, const SpeedSteps& speed, const PanTiltCounts& position) {
  return pan_tilt_move(camera, 0x02, speed, position);
}
Bytes pan_tilt_relative(uint8_t camera, const SpeedSteps& speed, const PanTiltCounts& by) {
  return pan_tilt_move(camera, 0x03, speed, by);
}
Bytes pan_tilt_home(uint8_t camera) { return {to(camera), 0x01, 0x06, 0x04, kEnd}; }
Bytes pan_tilt_reset(uint8_t camera) { return {to(camera), 0x01, 0x06, 0x05, kEnd}; }
Bytes zoom_direct(uint8_t camera, uint16_t position) {
  Bytes bytes{to(camera), 0x01, 0x04, 0x47};
  append_nibbles(bytes, position);
  bytes.push_back(kEnd);
  return bytes;
}
Bytes zoom_stop(uint8_t camera) { return {to(camera), 0x01, 0x04, 0x07, 0x00, kEnd}; }

Bytes version_inquiry(uint8_t camera) { return {to(camera), 0x09, 0x00, 0x02, kEnd}; }
Bytes pan_tilt_inquiry(uint8_t camera) { return {to(camera), 0x09, 0x06, 0x12, kEnd}; }
Bytes max_speed_inquiry(uint8_t camera) { return {to(camera), 0x09, 0x06, 0x11, kEnd}; }
Bytes zoom_inquiry(uint8_t camera) { return {to(camera), 0x09, 0x04, 0x47, kEnd}; }

std::optional<Reply> read_reply(std::span<const uint8_t> packet) {
  if (packet.size() < kShortest || packet.size() > kLongest || packet.back() != kEnd) return std::nullopt;
  const std::span<const uint8_t> body = packet.subspan(1, packet.size() - 2);
  Reply reply;
  if (packet[0] == 0x88) {
    if (body.size() == 2 && body[0] == 0x30 && body[1] >= 1 && body[1] <= 8) {
      reply.kind = ReplyKind::kAddressSet;
      reply.payload = body.subspan(1);
      return reply;
    }
    reply.kind = ReplyKind::kBroadcastClear;
    constexpr uint8_t kClear[] = {0x01, 0x00, 0x01};
    return std::ranges::equal(body, kClear) ? std::optional(reply) : std::nullopt;
  }
  if ((packet[0] & 0x8F) != 0x80 || packet[0] < 0x90) return std::nullopt;
  reply.camera = static_cast<uint8_t>((packet[0] >> 4) - 8);
  reply.socket = body[0] & 0x0F;
  switch (body[0] & 0xF0) {
    case 0x30:
      reply.kind = ReplyKind::kNetworkChange;
      return body.size() == 1 && body[0] == 0x38 ? std::optional(reply) : std::nullopt;
    case 0x40:
      reply.kind = ReplyKind::kAck;
      return body.size() == 1 ? std::optional(reply) : std::nullopt;
    case 0x50:
      reply.kind = reply.socket == 0 ? ReplyKind::kAnswer : ReplyKind::kCompletion;
      reply.payload = body.subspan(1);
      return reply.socket == 0 || body.size() == 1 ? std::optional(reply) : std::nullopt;
    case 0x60:
      reply.kind = ReplyKind::kError;
      if (body.size() != 2) return std::nullopt;
      reply.error = body[1];
      return reply;
    default:
      return std::nullopt;
  }
}

std::optional<PanTiltCounts> read_pan_tilt(std::span<const uint8_t> payload) {
  if (payload.size() != 8) return std::nullopt;
  const auto pan = nibbles(payload.first(4)), tilt = nibbles(payload.last(4));
  if (!pan || !tilt) return std::nullopt;
  return PanTiltCounts{static_cast<int16_t>(*pan), static_cast<int16_t>(*tilt)};
}

std::optional<uint16_t> read_zoom(std::span<const uint8_t> payload) {
  return payload.size() == 4 ? nibbles(payload) : std::nullopt;
}

std::optional<SpeedSteps> read_max_speed(std::span<const uint8_t> payload) {
  if (payload.size() != 2 || payload[0] == 0 || payload[1] == 0) return std::nullopt;
  return SpeedSteps{payload[0], payload[1]};
}

std::optional<Version> read_version(std::span<const uint8_t> payload) {
  if (payload.size() != 7) return std::nullopt;
  return Version{static_cast<uint16_t>(payload[0] << 8 | payload[1]),
                 static_cast<uint16_t>(payload[2] << 8 | payload[3]), payload[6]};
}

}  // namespace perch::visca
