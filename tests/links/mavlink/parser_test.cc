#include "perch/links/mavlink/parser.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "links/mavlink/messages.h"
#include "perch/links/mavlink/crc.h"
#include "perch/links/mavlink/messages.h"

namespace perch::mavlink {
namespace {

Bytes heartbeat_frame(uint8_t sequence, uint8_t system = 1) {
  Bytes wire;
  Heartbeat heartbeat;
  heartbeat.autopilot = 3;
  heartbeat.mavlink_version = 3;
  append_frame(wire, {2, sequence, system, 1}, *find_message(0), &heartbeat);
  return wire;
}

// A frame of message 12345, which nobody knows, with a payload of our choice.
Bytes unknown_frame(uint8_t sequence, const Bytes& payload) {
  Bytes wire;
  for (const int byte : {0xFD, static_cast<int>(payload.size()), 0, 0, int{sequence}, 1, 1, 0x39, 0x30, 0})
    wire.push_back(static_cast<uint8_t>(byte));
  for (const uint8_t byte : payload) wire.push_back(byte);
  wire.push_back(0x12);
  wire.push_back(0x34);
  return wire;
}

void append(Bytes& to, const Bytes& bytes) { to.insert(to.end(), bytes.begin(), bytes.end()); }

// Good frames, frames with a flipped bit, cut frames, unknown ones and garbage, in any order.
Bytes random_stream(TestRng& rng) {
  Bytes stream;
  for (int piece = 0; piece < 12; ++piece) {
    const auto& info =
        known_messages()[static_cast<size_t>(rng.index(static_cast<int>(known_messages().size())))];
    Bytes frame;
    const bool v1 = info.id < 256 && rng.index(4) == 0;
    append_frame(frame, {static_cast<uint8_t>(v1 ? 1 : 2), static_cast<uint8_t>(rng.index(256)), 1, 1}, info,
                 random_message(rng, info).data());
    switch (rng.index(6)) {
      case 0:
        frame[static_cast<size_t>(rng.index(static_cast<int>(frame.size())))] ^=
            static_cast<uint8_t>(1 << rng.index(8));
        break;
      case 1:
        frame.resize(static_cast<size_t>(rng.index(static_cast<int>(frame.size()))));
        break;
      case 2:
        frame = random_bytes(rng, static_cast<size_t>(rng.index(300)));
        break;
      case 3:
        frame = unknown_frame(3, random_bytes(rng, static_cast<size_t>(rng.index(255))));
        break;
      default:
        break;
    }
    append(stream, frame);
  }
  return stream;
}

std::vector<Bytes> all_payloads(FrameParser& parser, const Bytes& stream, const std::vector<size_t>& cuts) {
  std::vector<Bytes> payloads;
  const auto on_frame = [&](const Frame& frame) { payloads.push_back(decoded(frame)); };
  size_t from = 0;
  for (const size_t cut : cuts) {
    parser.parse(std::span(stream).subspan(from, cut - from), on_frame);
    from = cut;
  }
  parser.parse(std::span(stream).subspan(from), on_frame);
  parser.give_up_waiting(on_frame);
  return payloads;
}

TEST(FrameParser, AnyCutOfAnyStreamGivesTheSameMessages) {
  TestRng rng;
  size_t delivered = 0;
  for (int round = 0; round < 3000; ++round) {
    const Bytes stream = random_stream(rng);
    FrameParser whole, pieces;
    const auto expected = all_payloads(whole, stream, {});
    std::vector<size_t> cuts(static_cast<size_t>(rng.index(20)));
    for (size_t& cut : cuts) cut = static_cast<size_t>(rng.index(static_cast<int>(stream.size()) + 1));
    std::sort(cuts.begin(), cuts.end());
    ASSERT_EQ(all_payloads(pieces, stream, cuts), expected) << round;
    EXPECT_EQ(whole.statistics().good, pieces.statistics().good);
    EXPECT_EQ(whole.statistics().skipped_bytes, pieces.statistics().skipped_bytes);
    delivered += expected.size();
  }
  // A third of the pieces are whole frames, of which few are swallowed by an unknown "frame" in front of
  // them.
  EXPECT_GT(delivered, 3000u * 12 / 4);
}

TEST(FrameParser, NoBytesHarmIt) {
  TestRng rng;
  FrameParser parser, datagrams;
  for (int round = 0; round < 3000; ++round) {
    Bytes bytes = random_bytes(rng, static_cast<size_t>(rng.index(600)));
    // Magics, and ids that are known: else nearly all ends at the first look.
    for (size_t i = 0; i + 10 < bytes.size(); i += 20) bytes[i] = rng.index(2) ? 0xFD : 0xFE;
    for (size_t i = 7; i + 3 < bytes.size(); i += 20) bytes[i] = 149, bytes[i + 1] = 0, bytes[i + 2] = 0;
    parser.parse(bytes, [](const Frame& frame) { EXPECT_TRUE(frame.info); });
    datagrams.parse_datagram(bytes, [](const Frame& frame) { EXPECT_TRUE(frame.info); });
    EXPECT_FALSE(datagrams.waiting());
  }
  EXPECT_GT(parser.statistics().bad_crc, 1000u);
}

TEST(FrameParser, OfOneFlippedBitNothingGetsThrough) {
  const Bytes good = heartbeat_frame(5);
  for (size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<uint8_t>(1 << (bit % 8));
    FrameParser parser;
    int frames = 0;
    parser.parse_datagram(bad, [&](const Frame&) { ++frames; });
    EXPECT_EQ(frames, 0) << bit;
  }
}

TEST(FrameParser, ADatagramEndsWhatTheOneBeforeBegan) {
  FrameParser parser;
  const Bytes frame = heartbeat_frame(1);
  int frames = 0;
  const auto on_frame = [&](const Frame&) { ++frames; };
  parser.parse_datagram(std::span(frame).first(12), on_frame);
  parser.parse_datagram(std::span(frame).subspan(12), on_frame);
  EXPECT_EQ(frames, 0);
  parser.parse_datagram(frame, on_frame);
  EXPECT_EQ(frames, 1);
}

TEST(FrameParser, AFalseMagicIsGivenUpAndWhatItHidIsFound) {
  FrameParser parser;
  Bytes stream = {0xFD, 0xFF, 0, 0, 0, 1, 1, 0, 0, 0};  // a heartbeat of 255 bytes
  append(stream, heartbeat_frame(1));
  EXPECT_TRUE(parsed(parser, stream).empty());
  EXPECT_TRUE(parser.waiting());
  int frames = 0;
  parser.give_up_waiting([&](const Frame&) { ++frames; });
  EXPECT_EQ(frames, 1);
  EXPECT_FALSE(parser.waiting());
}

TEST(FrameParser, AnUnknownMessageBetweenOthersIsSkippedAsAWhole) {
  FrameParser parser;
  Bytes stream = heartbeat_frame(1);
  append(stream, unknown_frame(2, Bytes(40, 0xFD)));  // full of false magics
  append(stream, heartbeat_frame(3));
  EXPECT_EQ(parsed(parser, stream).size(), 2u);
  EXPECT_EQ(parser.statistics().unknown, 1u);
  EXPECT_EQ(parser.statistics().skipped_bytes, 0u);
  EXPECT_EQ(parser.statistics().sources.at({1, 1}).lost, 0u);
  EXPECT_EQ(parser.statistics().sources.at({1, 1}).received, 3u);
}

TEST(FrameParser, WhatLooksLikeAnUnknownMessageOutOfStepIsSearched) {
  FrameParser parser;
  Bytes stream = heartbeat_frame(1);
  stream.push_back(0);  // a byte too many: what follows is no frame
  append(stream, unknown_frame(2, heartbeat_frame(2)));
  append(stream, heartbeat_frame(3));
  EXPECT_EQ(parsed(parser, stream).size(), 3u);
  EXPECT_EQ(parser.statistics().unknown, 0u);
}

TEST(FrameParser, Mavlink1HasNoExtensionsWhateverItsSenderAppends) {
  LandingTarget target;
  target.distance = 7;
  target.x = 5;
  target.position_valid = 1;
  std::array<uint8_t, kMaxPayload> payload{};
  const MessageInfo& info = *find_message(LandingTarget::kId);
  write_payload(info, &target, payload);
  Bytes wire;
  for (const int byte : {0xFE, 60, 0, 1, 191, 149}) wire.push_back(static_cast<uint8_t>(byte));
  for (size_t i = 0; i < 60; ++i) wire.push_back(payload[i]);
  const uint16_t crc = crc_add(crc_add(kCrcStart, std::span(wire).subspan(1)), info.crc_extra);
  wire.push_back(static_cast<uint8_t>(crc & 0xFF));
  wire.push_back(static_cast<uint8_t>(crc >> 8));
  FrameParser parser;
  const auto frames = parsed(parser, wire);
  ASSERT_EQ(frames.size(), 1u);
  const auto received = decode<LandingTarget>(frames[0]);
  EXPECT_EQ(received->distance, 7);
  EXPECT_EQ(received->x, 0);
  EXPECT_EQ(received->position_valid, 0);
}

TEST(FrameParser, CountsGapsOfTheSequenceForEachSource) {
  FrameParser parser;
  Bytes stream;
  for (const int sequence : {250, 251, 254, 255, 0, 1, 5})
    append(stream, heartbeat_frame(static_cast<uint8_t>(sequence)));
  for (const int sequence : {9, 10}) append(stream, heartbeat_frame(static_cast<uint8_t>(sequence), 2));
  EXPECT_EQ(parsed(parser, stream).size(), 9u);
  EXPECT_EQ(parser.statistics().sources.at({1, 1}).lost, 2u + 3u);
  EXPECT_EQ(parser.statistics().sources.at({2, 1}).lost, 0u);
}

TEST(FrameParser, AFrameThatComesLateWasNotLost) {
  FrameParser parser;
  Bytes stream;
  for (const int sequence : {1, 3, 2, 2, 4}) append(stream, heartbeat_frame(static_cast<uint8_t>(sequence)));
  parsed(parser, stream);
  EXPECT_EQ(parser.statistics().sources.at({1, 1}).late, 2u);
  EXPECT_EQ(parser.statistics().sources.at({1, 1}).lost, 0u);
}

TEST(FrameParser, KeepsNothingOfWhatItHasJudged) {
  FrameParser parser;
  Bytes stream;
  for (int i = 0; i < 20; ++i) append(stream, heartbeat_frame(static_cast<uint8_t>(i)));
  for (int round = 0; round < 100; ++round) {
    EXPECT_EQ(parsed(parser, stream).size(), 20u);
    EXPECT_FALSE(parser.waiting());
  }
}

TEST(Text, HasNoNulAndNoMoreThanItsField) {
  Statustext text;
  set_text(text.text, std::string(60, 'A'));
  EXPECT_EQ(text_of(text.text), std::string(50, 'A'));
  set_text(text.text, "TRACK");
  EXPECT_EQ(text_of(text.text), "TRACK");
}

}  // namespace
}  // namespace perch::mavlink
