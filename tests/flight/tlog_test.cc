#include "perch/flight/tlog.h"

#include <gmock/gmock.h>

#include <vector>

#include "support/rng.h"

namespace perch {
namespace {

using Bytes = std::vector<uint8_t>;

std::string record(int64_t time_us, const Bytes& frame) {
  std::string text;
  for (int shift = 56; shift >= 0; shift -= 8) text += static_cast<char>(time_us >> shift & 0xFF);
  return text + std::string(frame.begin(), frame.end());
}

// Of any content, its first bytes apart.
Bytes frame_of(uint8_t magic, uint8_t payload, bool is_signed, TestRng& rng) {
  const size_t length = magic == 0xFE ? 8u + payload : 12u + payload + (is_signed ? 13u : 0u);
  Bytes frame(length);
  for (uint8_t& byte : frame) byte = static_cast<uint8_t>(rng.bits());
  frame[0] = magic;
  frame[1] = payload;
  if (magic == 0xFD) frame[2] = is_signed ? 1 : 0;
  return frame;
}

TEST(Tlog, ATimeBeforeEachFrameHoweverTheBytesCome) {
  TestRng rng;
  for (int round = 0; round < 200; ++round) {
    TlogFramer framer;
    std::string tlog, expected;
    Bytes stream;
    std::vector<size_t> ends;
    std::vector<Bytes> frames;
    for (int i = 0; i < 5; ++i) {
      frames.push_back(
          frame_of(rng.bits() % 2 ? 0xFD : 0xFE, static_cast<uint8_t>(rng.bits()), rng.bits() % 2, rng));
      stream.insert(stream.end(), frames.back().begin(), frames.back().end());
      ends.push_back(stream.size());
    }
    int64_t time_us = 1'700'000'000'000'000;
    size_t frame = 0;
    for (size_t at = 0; at < stream.size();) {
      const size_t n = std::min<size_t>(rng.bits() % 300 + 1, stream.size() - at);
      framer.add(++time_us, {&stream[at], n}, tlog);
      at += n;
      // A frame's time is that of the read that ended it.
      for (; frame < ends.size() && ends[frame] <= at; ++frame) expected += record(time_us, frames[frame]);
    }
    ASSERT_EQ(tlog, expected);
  }
}

TEST(Tlog, GarbageIsARecordOfItsOwn) {
  TestRng rng;
  const Bytes frame = frame_of(0xFD, 4, false, rng);
  Bytes stream{1, 2, 3};
  stream.insert(stream.end(), frame.begin(), frame.end());
  TlogFramer framer;
  std::string tlog;
  framer.add(7, stream, tlog);
  EXPECT_EQ(tlog, record(7, {1, 2, 3}) + record(7, frame));
}

TEST(Tlog, NoByteIsLost) {
  TestRng rng;
  for (int round = 0; round < 200; ++round) {
    TlogFramer framer;
    std::string tlog;
    Bytes stream(rng.bits() % 2000);
    for (uint8_t& byte : stream) byte = rng.bits() % 20 == 0 ? 0xFD : static_cast<uint8_t>(rng.bits() % 100);
    // The bytes of the time have a value that the stream has not.
    const int64_t time_us = -1;
    framer.add(time_us, stream, tlog);
    EXPECT_GE(tlog.size() + 280, stream.size());
    framer.flush(tlog);
    std::erase(tlog, '\xFF');
    ASSERT_EQ(tlog, std::string(stream.begin(), stream.end()));
  }
}

}  // namespace
}  // namespace perch
