// Golden frames, byte by byte and in both directions, and malformed streams with what must come of them.
#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>

#include "links/mavlink/messages.h"
#include "perch/links/mavlink/messages.h"

namespace perch::mavlink {
namespace {

using nlohmann::json;

const json& vectors() {
  static const json file =
      json::parse(std::ifstream(std::string(PERCH_SOURCE_DIR) + "/tests/links/mavlink/vectors.json"));
  return file;
}

Bytes from_hex(const std::string& hex) {
  Bytes bytes;
  for (size_t i = 0; i < hex.size(); i += 2)
    bytes.push_back(static_cast<uint8_t>(std::stoi(hex.substr(i, 2), nullptr, 16)));
  return bytes;
}

template <class T>
void put(uint8_t* to, const json& value) {
  const T number = value.get<T>();
  std::memcpy(to, &number, sizeof(T));
}

void put_float(uint8_t* to, const json& value) {
  float number = 0;
  if (value.is_string()) {
    number =
        value == "nan" ? std::numeric_limits<float>::quiet_NaN() : std::numeric_limits<float>::infinity();
    if (value == "-inf") number = -number;
  } else {
    number = static_cast<float>(value.get<double>());
  }
  std::memcpy(to, &number, sizeof(number));
}

void put_number(WireType type, uint8_t* to, const json& value) {
  switch (type) {
    case WireType::kUint8:
    case WireType::kChar:
      return put<uint8_t>(to, value);
    case WireType::kInt8:
      return put<int8_t>(to, value);
    case WireType::kUint16:
      return put<uint16_t>(to, value);
    case WireType::kInt16:
      return put<int16_t>(to, value);
    case WireType::kUint32:
      return put<uint32_t>(to, value);
    case WireType::kInt32:
      return put<int32_t>(to, value);
    case WireType::kUint64:
      return put<uint64_t>(to, value);
    case WireType::kInt64:
      return put<int64_t>(to, value);
    case WireType::kFloat:
      return put_float(to, value);
  }
}

// The struct that the vector's fields describe.
Bytes message_of(const MessageInfo& info, const json& fields) {
  Bytes message = blank(info);
  for (const FieldInfo& field : info.fields) {
    uint8_t* to = message.data() + field.struct_offset;
    const auto given = fields.find(std::string(field.name));
    if (given == fields.end()) {
      ADD_FAILURE() << info.name << "." << field.name << " is not in the vector";
    } else if (field.type == WireType::kChar) {
      const std::string text = *given;
      std::copy(text.begin(), text.end(), to);
    } else if (field.array_length) {
      for (size_t i = 0; i < field.array_length; ++i)
        put_number(field.type, to + i * size_of(field.type), (*given)[i]);
    } else {
      put_number(field.type, to, *given);
    }
  }
  EXPECT_EQ(fields.size(), info.fields.size()) << info.name;
  return message;
}

SigningOptions key_of(const json& hex) {
  SigningOptions options;
  const Bytes key = from_hex(hex);
  std::copy(key.begin(), key.end(), options.key.begin());
  return options;
}

TEST(Vectors, GoldenFramesComeOutOfTheirFields) {
  int count = 0;
  for (const json& vector : vectors()["vectors"]) {
    SCOPED_TRACE(vector["name"].get<std::string>());
    const MessageInfo* info = find_message(vector["msgid"]);
    ASSERT_TRUE(info);
    EXPECT_EQ(info->name, vector["msg"].get<std::string>());
    EXPECT_EQ(info->crc_extra, vector["crc_extra"].get<int>());
    EXPECT_EQ(info->length, vector["payload_len_full"].get<size_t>());

    std::optional<Signing> signing;
    if (vector["signed"]) {
      SigningOptions options = key_of(vectors()["signing"]["key_hex"]);
      options.link_id = vector["signature"]["link_id"];
      signing.emplace(options, vector["signature"]["timestamp"].get<uint64_t>());
    }
    Bytes wire;
    append_frame(wire, {vector["version"], vector["seq"], vector["sysid"], vector["compid"]}, *info,
                 message_of(*info, vector["fields"]).data(), signing ? &*signing : nullptr);
    EXPECT_EQ(wire, from_hex(vector["hex"]));
    ++count;
  }
  EXPECT_EQ(count, 45);
}

TEST(Vectors, GoldenFramesGiveTheirFields) {
  for (const json& vector : vectors()["vectors"]) {
    SCOPED_TRACE(vector["name"].get<std::string>());
    FrameParser parser;
    const auto frames = parsed(parser, from_hex(vector["hex"]));
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(frames[0].id(), vector["msgid"].get<uint32_t>());
    EXPECT_EQ(frames[0].sequence, vector["seq"].get<int>());
    EXPECT_EQ(frames[0].system, vector["sysid"].get<int>());
    EXPECT_EQ(frames[0].component, vector["compid"].get<int>());
    EXPECT_EQ(frames[0].version, vector["version"].get<int>());
    EXPECT_EQ(frames[0].is_signed, vector["signed"].get<bool>());
    EXPECT_EQ(frames[0].payload_length, vector["payload_len_wire"].get<int>());
    EXPECT_TRUE(
        same_fields(*frames[0].info, decoded(frames[0]), message_of(*frames[0].info, vector["fields"])));
  }
}

TEST(Vectors, ExtensionsInAMavlink1FrameAreNotLookedAt) {
  for (const json& vector : vectors()["vectors"]) {
    if (!vector.contains("hex_pymavlink_nonconforming")) continue;
    FrameParser parser;
    const auto frames = parsed(parser, from_hex(vector["hex_pymavlink_nonconforming"]));
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_TRUE(
        same_fields(*frames[0].info, decoded(frames[0]), message_of(*frames[0].info, vector["fields"])));
  }
}

// [id, sequence] of what a parser delivers when the bytes come in pieces of `chunk`.
std::vector<std::pair<uint32_t, int>> delivered(const json& stream, size_t chunk) {
  std::optional<Signing> signing;
  if (stream.contains("key_hex"))
    signing.emplace(key_of(stream["key_hex"]), 377'000'000'000);  // the time of the signed vectors
  FrameParser parser(signing ? &*signing : nullptr);
  std::vector<std::pair<uint32_t, int>> accepted;
  const auto on_frame = [&](const Frame& frame) { accepted.emplace_back(frame.id(), frame.sequence); };
  const Bytes bytes = from_hex(stream["hex"]);
  for (size_t i = 0; i < bytes.size(); i += chunk)
    parser.parse(std::span(bytes).subspan(i, std::min(chunk, bytes.size() - i)), on_frame);
  parser.give_up_waiting(on_frame);
  return accepted;
}

TEST(Vectors, MalformedStreamsLoseNoGoodFrameAndDeliverNoBadOne) {
  int count = 0;
  for (const json& stream : vectors()["malformed"]) {
    SCOPED_TRACE(stream["name"].get<std::string>());
    std::vector<std::pair<uint32_t, int>> expected;
    for (const json& frame : stream["accept"]) expected.emplace_back(frame[0], frame[1]);
    for (const size_t chunk : {1u, 7u, 11u, 12u, 13u, 1000u})
      EXPECT_EQ(delivered(stream, chunk), expected) << chunk;
    ++count;
  }
  EXPECT_EQ(count, 28);
}

}  // namespace
}  // namespace perch::mavlink
