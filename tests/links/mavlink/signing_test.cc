#include "perch/links/mavlink/signing.h"

#include <gtest/gtest.h>

#include "links/mavlink/messages.h"
#include "perch/links/mavlink/messages.h"

namespace perch::mavlink {
namespace {

constexpr uint64_t kNow = 37'700'000'000'000;

SigningOptions options_with_key(uint8_t first, uint8_t link = 0) {
  SigningOptions options;
  options.key.fill(0x5A);
  options.key[0] = first;
  options.link_id = link;
  return options;
}

struct Sender {
  explicit Sender(uint64_t now, uint8_t link = 0, uint8_t system = 1)
      : signing(options_with_key(1, link), now), writer(system, 191, &signing) {}
  Bytes frame() {
    Bytes wire;
    writer.append(wire, Heartbeat{});
    return wire;
  }
  Signing signing;
  FrameWriter writer;
};

struct Receiver {
  explicit Receiver(bool accept_unsigned = false, uint64_t now = kNow)
      : signing(
            [&] {
              SigningOptions options = options_with_key(1);
              options.accept_unsigned = accept_unsigned;
              return options;
            }(),
            now),
        parser(&signing) {}
  size_t accept(const Bytes& wire) { return parsed(parser, wire).size(); }
  Signing signing;
  FrameParser parser;
};

TEST(Signing, WhatOneSignsTheOtherAccepts) {
  Sender sender(kNow);
  Receiver receiver;
  for (int i = 0; i < 300; ++i) EXPECT_EQ(receiver.accept(sender.frame()), 1u);
}

TEST(Signing, TimesRiseStrictlyWhateverTheClockDoes) {
  Sender sender(kNow);
  Receiver receiver;
  for (int i = 0; i < 100; ++i) {
    sender.signing.advance(i % 2 ? kNow - 1000 : kNow);
    EXPECT_EQ(receiver.accept(sender.frame()), 1u);
  }
}

TEST(Signing, AReplayedFrameIsRefusedAndOneOfAnotherLinkIsNot) {
  Sender sender(kNow), other(kNow, 3);
  Receiver receiver;
  const Bytes first = sender.frame(), second = sender.frame();
  EXPECT_EQ(receiver.accept(second), 1u);
  EXPECT_EQ(receiver.accept(second), 0u);
  EXPECT_EQ(receiver.accept(first), 0u);
  EXPECT_EQ(receiver.parser.statistics().replayed, 2u);
  EXPECT_EQ(receiver.accept(other.frame()), 1u);
}

TEST(Signing, ANewStreamMayBeAMinuteBehindAndNoMore) {
  Receiver receiver;
  EXPECT_EQ(receiver.accept(Sender(kNow - 6'000'001, 0, 2).frame()), 0u);
  EXPECT_EQ(receiver.accept(Sender(kNow - 6'000'000, 0, 3).frame()), 1u);
}

TEST(Signing, OurTimeFollowsThatOfAPeer) {
  Receiver receiver;
  EXPECT_EQ(receiver.accept(Sender(kNow + 100'000'000).frame()), 1u);
  FrameWriter writer(1, 191, &receiver.signing);
  Bytes wire;
  writer.append(wire, Heartbeat{});
  uint64_t time = 0;
  for (size_t i = 0; i < 6; ++i) time |= uint64_t{wire[wire.size() - 12 + i]} << (8 * i);
  EXPECT_GE(time, kNow + 100'000'000);
}

TEST(Signing, EveryBitOfASignedFrameCounts) {
  Sender sender(kNow);
  const Bytes good = sender.frame();
  for (size_t bit = 0; bit < good.size() * 8; ++bit) {
    Bytes bad = good;
    bad[bit / 8] ^= static_cast<uint8_t>(1 << (bit % 8));
    Receiver receiver;
    EXPECT_EQ(receiver.accept(bad), 0u) << bit;
  }
}

TEST(Signing, UnsignedFramesPassOnlyByPolicyAndRadiosAlways) {
  Bytes heartbeat, radio;
  FrameWriter writer(1, 1);
  writer.append(heartbeat, Heartbeat{});
  writer.append(radio, RadioStatus{});
  Receiver strict, lenient(true);
  EXPECT_EQ(strict.accept(heartbeat), 0u);
  EXPECT_EQ(strict.parser.statistics().unsigned_refused, 1u);
  EXPECT_EQ(strict.accept(radio), 1u);
  EXPECT_EQ(lenient.accept(heartbeat), 1u);
}

TEST(Signing, TimeCountsTensOfMicrosecondsSince2015) {
  EXPECT_EQ(signing_time(1'420'070'400'000'000'000), 0u);
  EXPECT_EQ(signing_time(1'420'070'401'000'000'000), 100'000u);
  EXPECT_EQ(signing_time(-5), 0u);
}

}  // namespace
}  // namespace perch::mavlink
