#include "perch/links/visca/packets.h"

#include <gtest/gtest.h>

#include "perch/links/visca/ip_framing.h"
#include "perch/links/visca/parser.h"
#include "support/rng.h"

namespace perch::visca {
namespace {

// The bytes of Sony's "EVI-D30/D31 Command List", 1.21.
TEST(Packets, AreTheBytesOfTheCommandList) {
  EXPECT_EQ(address_set(), (Bytes{0x88, 0x30, 0x01, 0xFF}));
  EXPECT_EQ(if_clear(1), (Bytes{0x81, 0x01, 0x00, 0x01, 0xFF}));
  EXPECT_EQ(if_clear_all(), (Bytes{0x88, 0x01, 0x00, 0x01, 0xFF}));
  EXPECT_EQ(cancel(2, 1), (Bytes{0x82, 0x21, 0xFF}));
  EXPECT_EQ(power(1, true), (Bytes{0x81, 0x01, 0x04, 0x00, 0x02, 0xFF}));
  EXPECT_EQ(power(1, false), (Bytes{0x81, 0x01, 0x04, 0x00, 0x03, 0xFF}));
  EXPECT_EQ(pan_tilt_home(1), (Bytes{0x81, 0x01, 0x06, 0x04, 0xFF}));
  EXPECT_EQ(pan_tilt_reset(1), (Bytes{0x81, 0x01, 0x06, 0x05, 0xFF}));
  EXPECT_EQ(zoom_stop(1), (Bytes{0x81, 0x01, 0x04, 0x07, 0x00, 0xFF}));
  EXPECT_EQ(zoom_direct(1, 0x3FF), (Bytes{0x81, 0x01, 0x04, 0x47, 0x00, 0x03, 0x0F, 0x0F, 0xFF}));
  EXPECT_EQ(version_inquiry(1), (Bytes{0x81, 0x09, 0x00, 0x02, 0xFF}));
  EXPECT_EQ(pan_tilt_inquiry(1), (Bytes{0x81, 0x09, 0x06, 0x12, 0xFF}));
  EXPECT_EQ(max_speed_inquiry(1), (Bytes{0x81, 0x09, 0x06, 0x11, 0xFF}));
  EXPECT_EQ(zoom_inquiry(3), (Bytes{0x83, 0x09, 0x04, 0x47, 0xFF}));
}

TEST(Packets, DriveSaysSpeedAndSenseOfEachAxis) {
  EXPECT_EQ(pan_tilt_drive(1, {-5, 0}), (Bytes{0x81, 0x01, 0x06, 0x01, 0x05, 0x01, 0x01, 0x03, 0xFF}));
  EXPECT_EQ(pan_tilt_drive(1, {24, 20}), (Bytes{0x81, 0x01, 0x06, 0x01, 0x18, 0x14, 0x02, 0x01, 0xFF}));
  EXPECT_EQ(pan_tilt_drive(1, {0, -3}), (Bytes{0x81, 0x01, 0x06, 0x01, 0x01, 0x03, 0x03, 0x02, 0xFF}));
  // Beyond what there is: the fastest there is.
  EXPECT_EQ(pan_tilt_drive(1, {99, -99}), pan_tilt_drive(1, {24, -20}));
}

TEST(Packets, PositionsAreNibblesInTwosComplement) {
  EXPECT_EQ(
      pan_tilt_absolute(1, {0x18, 0x14}, {-880, 300}),
      (Bytes{0x81, 0x01, 0x06, 0x02, 0x18, 0x14, 0x0F, 0x0C, 0x09, 0x00, 0x00, 0x01, 0x02, 0x0C, 0xFF}));
  EXPECT_EQ(
      pan_tilt_relative(1, {0x10, 0x0A}, {88, -1}),
      (Bytes{0x81, 0x01, 0x06, 0x03, 0x10, 0x0A, 0x00, 0x00, 0x05, 0x08, 0x0F, 0x0F, 0x0F, 0x0F, 0xFF}));
}

TEST(Packets, RepliesAreToldApart) {
  const auto kind = [](const Bytes& bytes) { return read_reply(bytes).value().kind; };
  EXPECT_EQ(kind({0x90, 0x41, 0xFF}), ReplyKind::kAck);
  EXPECT_EQ(kind({0x90, 0x52, 0xFF}), ReplyKind::kCompletion);
  EXPECT_EQ(kind({0x90, 0x50, 0xFF}), ReplyKind::kAnswer);
  EXPECT_EQ(kind({0x90, 0x60, 0x03, 0xFF}), ReplyKind::kError);
  EXPECT_EQ(kind({0x90, 0x38, 0xFF}), ReplyKind::kNetworkChange);
  EXPECT_EQ(kind({0x88, 0x30, 0x02, 0xFF}), ReplyKind::kAddressSet);
  EXPECT_EQ(kind({0x88, 0x01, 0x00, 0x01, 0xFF}), ReplyKind::kBroadcastClear);
  EXPECT_EQ(read_reply(Bytes{0xF0, 0x42, 0xFF}).value().camera, 7);
  EXPECT_EQ(read_reply(Bytes{0x90, 0x42, 0xFF}).value().socket, 2);
  EXPECT_EQ(read_reply(Bytes{0x90, 0x61, 0x41, 0xFF}).value().error, 0x41);
}

TEST(Packets, WhatIsNoReplyIsNone) {
  for (const Bytes& bytes :
       {Bytes{}, Bytes{0xFF}, Bytes{0x90, 0xFF}, Bytes{0x81, 0x41, 0xFF}, Bytes{0x90, 0x41, 0x00, 0xFF},
        Bytes{0x90, 0x51, 0x00, 0xFF}, Bytes{0x90, 0x60, 0xFF}, Bytes{0x90, 0x39, 0xFF},
        Bytes{0x91, 0x41, 0xFF}, Bytes{0x90, 0x71, 0xFF}, Bytes{0x88, 0x30, 0x09, 0xFF},
        Bytes{0x90, 0x41, 0x41}, Bytes(17, 0x90)})
    EXPECT_FALSE(read_reply(bytes)) << testing::PrintToString(bytes);
}

TEST(Packets, AnswersAreReadToTheBit) {
  const Bytes answer{0x90, 0x50, 0x0F, 0x0C, 0x09, 0x00, 0x00, 0x01, 0x02, 0x0C, 0xFF};
  const auto reply = read_reply(answer);
  ASSERT_TRUE(reply);
  EXPECT_EQ(read_pan_tilt(reply->payload), (PanTiltCounts{-880, 300}));
  EXPECT_FALSE(read_zoom(reply->payload));
  Bytes wrong(reply->payload.begin(), reply->payload.end());
  wrong[3] = 0x10;  // no nibble
  EXPECT_FALSE(read_pan_tilt(wrong));
  EXPECT_EQ(read_zoom(Bytes{0x00, 0x03, 0x0F, 0x0F}), 0x3FF);
  EXPECT_EQ(read_max_speed(Bytes{0x18, 0x14}).value().tilt, 0x14);
  const auto version = read_version(Bytes{0x00, 0x20, 0x04, 0x02, 0x01, 0x21, 0x02});
  ASSERT_TRUE(version);
  EXPECT_EQ(version->model, 0x0402);
  EXPECT_EQ(version->sockets, 2);
}

TEST(IpFraming, HasTypeLengthAndSequence) {
  const Bytes inquiry = pan_tilt_inquiry(1);
  EXPECT_EQ(ip_type_of(inquiry), IpType::kInquiry);
  EXPECT_EQ(ip_type_of(pan_tilt_home(1)), IpType::kCommand);
  EXPECT_EQ(ip_datagram(IpType::kInquiry, 0x01020304, inquiry),
            (Bytes{0x01, 0x10, 0x00, 0x05, 0x01, 0x02, 0x03, 0x04, 0x81, 0x09, 0x06, 0x12, 0xFF}));
  EXPECT_EQ(ip_reset_sequence(), (Bytes{0x02, 0x00, 0x00, 0x01, 0x00, 0x00, 0x00, 0x00, 0x01}));
  const Bytes bytes = ip_datagram(IpType::kReply, 7, Bytes{0x90, 0x41, 0xFF});
  const auto message = read_ip_datagram(bytes);
  ASSERT_TRUE(message);
  EXPECT_EQ(message->sequence, 7U);
  EXPECT_EQ(Bytes(message->payload.begin(), message->payload.end()), (Bytes{0x90, 0x41, 0xFF}));
}

TEST(IpFraming, TakesNoDatagramThatIsNotWhole) {
  const Bytes whole = ip_datagram(IpType::kReply, 7, Bytes{0x90, 0x41, 0xFF});
  for (size_t size = 0; size < whole.size(); ++size)
    EXPECT_FALSE(read_ip_datagram(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))));
  Bytes longer = whole;
  longer.push_back(0);
  EXPECT_FALSE(read_ip_datagram(longer));
  Bytes strange = whole;
  strange[1] = 0x12;
  EXPECT_FALSE(read_ip_datagram(strange));
  const Bytes refused = ip_datagram(IpType::kControlReply, 7, Bytes{0x0F, 0x01});
  EXPECT_TRUE(is_ip_error(*read_ip_datagram(refused)));
}

std::vector<Bytes> packets_of(const Bytes& bytes, size_t piece) {
  Parser parser;
  std::vector<Bytes> packets;
  for (size_t i = 0; i < bytes.size(); i += piece) {
    const auto part = std::span(bytes).subspan(i, std::min(piece, bytes.size() - i));
    parser.parse(part, [&](std::span<const uint8_t> p) { packets.emplace_back(p.begin(), p.end()); });
  }
  return packets;
}

TEST(Parser, CutsAStreamInAnyPieces) {
  const Bytes stream{0x90, 0x41, 0xFF, 0x90, 0x51, 0xFF, 0x90, 0x50, 0x00, 0x03, 0x0F, 0x0F, 0xFF};
  for (size_t piece = 1; piece <= stream.size(); ++piece) {
    const auto packets = packets_of(stream, piece);
    ASSERT_EQ(packets.size(), 3U);
    EXPECT_EQ(packets[2], (Bytes{0x90, 0x50, 0x00, 0x03, 0x0F, 0x0F, 0xFF}));
  }
}

TEST(Parser, FindsTheNextPacketAfterRubbish) {
  const Bytes ack{0x90, 0x41, 0xFF};
  for (const Bytes& rubbish : {Bytes{0x00, 0x12, 0x33}, Bytes{0xFF, 0xFF}, Bytes{0x90, 0x50, 0x01},
                               Bytes{0x90, 0xFF}, Bytes(40, 0x05)}) {
    Bytes stream = rubbish;
    stream.insert(stream.end(), ack.begin(), ack.end());
    EXPECT_EQ(packets_of(stream, stream.size()).back(), ack) << testing::PrintToString(rubbish);
  }
}

// Whatever comes: packets of 3 to 16 bytes, never more memory than one, every byte read is one of theirs or
// counted as skipped, and a good packet after it is found.
TEST(Parser, SurvivesAnyBytes) {
  TestRng rng;
  for (int run = 0; run < 300; ++run) {
    Bytes bytes;
    const bool visca_like = run % 2 == 0;
    for (int i = 0; i < 400; ++i) {
      const auto any = static_cast<uint8_t>(rng.bits());
      const uint8_t likely[] = {0x90, 0x50, 0x41, 0xFF, 0x00, 0x0F, 0x88, 0x30, 0x02, 0x60};
      bytes.push_back(visca_like ? likely[rng.index(10)] : any);
    }
    for (const int byte : {0x7F, 0xFF, 0x90, 0x41, 0xFF}) bytes.push_back(static_cast<uint8_t>(byte));
    Parser parser;
    size_t in_packets = 0;
    Bytes last;
    parser.parse(bytes, [&](std::span<const uint8_t> packet) {
      ASSERT_GE(packet.size(), kShortest);
      ASSERT_LE(packet.size(), kLongest);
      in_packets += packet.size();
      last.assign(packet.begin(), packet.end());
      if (const auto reply = read_reply(packet)) {
        (void)read_pan_tilt(reply->payload);
        (void)read_zoom(reply->payload);
        (void)read_version(reply->payload);
        (void)read_max_speed(reply->payload);
      }
      (void)read_ip_datagram(packet);
    });
    EXPECT_EQ(in_packets + parser.bytes_skipped(), bytes.size());
    EXPECT_EQ(last, (Bytes{0x90, 0x41, 0xFF}));
    (void)read_ip_datagram(bytes);
  }
}

}  // namespace
}  // namespace perch::visca
