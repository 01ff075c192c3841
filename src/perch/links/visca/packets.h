#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace perch::visca {

// Sony's VISCA as the EVI-D30's command list (1.21) has it: packets of 3 to 16 bytes,
//
//   8x ... FF   from the controller (address 0) to camera x, 88 to all
//   z0 ... FF   from camera z - 8
//
// A number of 16 bits travels as four bytes of a nibble each, the highest first.
using Bytes = std::vector<uint8_t>;

constexpr uint8_t kEnd = 0xFF;
constexpr size_t kShortest = 3, kLongest = 16;

// Where the head is, in its own counts.
struct PanTiltCounts {
  int16_t pan = 0;   // positive: to the right
  int16_t tilt = 0;  // positive: up
  bool operator==(const PanTiltCounts&) const = default;
};

// Signs of a drive: -1 left or down, 0 stop, 1 right or up; speeds in the device's steps, from 1.
struct DriveSteps {
  int pan = 0, tilt = 0;  // sign and step
  bool operator==(const DriveSteps&) const = default;
};

struct SpeedSteps {
  uint8_t pan = 0x18, tilt = 0x14;  // the EVI-D30's fastest
};

Bytes address_set();
Bytes if_clear(uint8_t camera);
Bytes if_clear_all();
Bytes cancel(uint8_t camera, uint8_t socket);
Bytes power(uint8_t camera, bool on);

// A stopped axis is sent with the step 1: 0 is a syntax error to some heads.
Bytes pan_tilt_drive(uint8_t camera, const DriveSteps& drive);
Bytes pan_tilt_absolute(uint8_t camera, const SpeedSteps& speed, const PanTiltCounts& to);
Bytes pan_tilt_relative(uint8_t camera, const SpeedSteps& speed, const PanTiltCounts& by);
Bytes pan_tilt_home(uint8_t camera);
Bytes pan_tilt_reset(uint8_t camera);
Bytes zoom_direct(uint8_t camera, uint16_t position);
Bytes zoom_stop(uint8_t camera);

Bytes version_inquiry(uint8_t camera);
Bytes pan_tilt_inquiry(uint8_t camera);
Bytes max_speed_inquiry(uint8_t camera);
Bytes zoom_inquiry(uint8_t camera);

// What a camera answers. Which inquiry an answer belongs to it does not say, and hardly which command.
enum class ReplyKind {
  kAck,            // z0 4y FF: taken into socket y
  kCompletion,     // z0 5y FF: what is in socket y is done
  kAnswer,         // z0 50 ... FF: to the inquiry, or with nothing in it to IF_Clear
  kError,          // z0 6y ee FF
  kNetworkChange,  // z0 38 FF: addresses are to be given anew
  kAddressSet,     // 88 30 0w FF: w - 1 cameras are in the chain
  kBroadcastClear  // 88 01 00 01 FF: what was sent to all, come round
};

enum class ErrorCode : uint8_t {
  kLength = 0x01,
  kSyntax = 0x02,
  kBufferFull = 0x03,
  kCancelled = 0x04,
  kNoSocket = 0x05,
  kNotExecutable = 0x41
};

struct Reply {
  ReplyKind kind = ReplyKind::kAck;
  uint8_t camera = 0;  // who answers
  uint8_t socket = 0;
  uint8_t error = 0;                 // with kError
  std::span<const uint8_t> payload;  // with kAnswer, what follows 50; with kAddressSet the one byte
};

// Of a whole packet; empty when it is none of the above.
std::optional<Reply> read_reply(std::span<const uint8_t> packet);

// Of an answer's payload; empty unless it has that shape to the bit.
std::optional<PanTiltCounts> read_pan_tilt(std::span<const uint8_t> payload);
std::optional<uint16_t> read_zoom(std::span<const uint8_t> payload);
std::optional<SpeedSteps> read_max_speed(std::span<const uint8_t> payload);

struct Version {
  uint16_t vendor = 0, model = 0;  // 0020: Sony; 0402: EVI-D30 and D31
  uint8_t sockets = 0;
};
std::optional<Version> read_version(std::span<const uint8_t> payload);

}  // namespace perch::visca
