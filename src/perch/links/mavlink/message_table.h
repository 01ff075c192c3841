#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace perch::mavlink {

enum class WireType : uint8_t {
  kUint8,
  kInt8,
  kChar,
  kUint16,
  kInt16,
  kUint32,
  kInt32,
  kFloat,
  kUint64,
  kInt64
};

// One field of a message: where it lies in our struct and where on the wire.
struct FieldInfo {
  std::string_view name;
  WireType type = WireType::kUint8;
  uint8_t array_length = 0;  // 0: no array
  bool extension = false;
  size_t struct_offset = 0;  // bytes
  size_t wire_offset = 0;    // bytes into the payload
};

// What the codec knows of one message. Lengths and CRC_EXTRA are computed from the fields.
struct MessageInfo {
  uint32_t id = 0;
  std::string_view name;
  std::span<const FieldInfo> fields;  // in wire order
  size_t struct_size = 0;
  size_t min_length = 0;  // of the payload without extensions: what MAVLink 1 carries
  size_t length = 0;      // of the whole payload
  uint8_t crc_extra =
      0;  // a hash of names and types, so that two ideas of a message do not understand another
};

inline constexpr size_t kMaxPayload = 255;

size_t size_of(WireType type);
// "uint8_t", "float", …
std::string_view name_of(WireType type);
// The bytes of a field on the wire.
size_t size_of(const FieldInfo& field);

// All messages, by rising id.
std::span<const MessageInfo> known_messages();
// nullptr when the id is not one of ours.
const MessageInfo* find_message(uint32_t id);

// Fills the struct of `info` from a payload: what is missing is zero, what is beyond its length is ignored.
void read_payload(const MessageInfo& info, std::span<const uint8_t> payload, void* message);
// Writes all info.length bytes of the payload.
void write_payload(const MessageInfo& info, const void* message, std::span<uint8_t, kMaxPayload> payload);

}  // namespace perch::mavlink
