#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "perch/links/mavlink/frame.h"
#include "perch/links/mavlink/parser.h"
#include "support/rng.h"

namespace perch::mavlink {

using Bytes = std::vector<uint8_t>;

// The memory of a struct of ours, for tests that go over all messages.
inline Bytes blank(const MessageInfo& info) { return Bytes(info.struct_size, 0); }

inline Bytes random_bytes(TestRng& rng, size_t count) {
  Bytes bytes(count);
  for (uint8_t& byte : bytes) byte = static_cast<uint8_t>(rng.index(256));
  return bytes;
}

// Every field random; now and then zeros at the end, which a sender cuts off.
inline Bytes random_message(TestRng& rng, const MessageInfo& info) {
  Bytes message = blank(info);
  const size_t zeros = rng.index(3) == 0 ? static_cast<size_t>(rng.index(8)) : 0;
  for (size_t i = 0; i + zeros < info.fields.size(); ++i) {
    const Bytes value = random_bytes(rng, size_of(info.fields[i]));
    std::memcpy(message.data() + info.fields[i].struct_offset, value.data(), value.size());
  }
  return message;
}

// Field by field: padding between them does not count, and NaNs are equal when their bits are.
inline testing::AssertionResult same_fields(const MessageInfo& info, const Bytes& a, const Bytes& b,
                                            bool extensions = true) {
  for (const FieldInfo& field : info.fields) {
    if (field.extension && !extensions) break;
    if (std::memcmp(a.data() + field.struct_offset, b.data() + field.struct_offset, size_of(field)) != 0)
      return testing::AssertionFailure() << info.name << "." << field.name << " differs";
  }
  return testing::AssertionSuccess();
}

inline Bytes decoded(const Frame& frame) {
  Bytes message = blank(*frame.info);
  read_payload(*frame.info, std::span(frame.payload).first(frame.payload_length), message.data());
  return message;
}

inline std::vector<Frame> parsed(FrameParser& parser, std::span<const uint8_t> bytes) {
  std::vector<Frame> frames;
  parser.parse(bytes, [&](const Frame& frame) { frames.push_back(frame); });
  return frames;
}

}  // namespace perch::mavlink
