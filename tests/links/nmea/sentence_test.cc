#include "perch/links/nmea/sentence.h"

#include <gtest/gtest.h>

#include "links/nmea/fake_receiver.h"
#include "support/rng.h"

namespace perch::nmea {
namespace {

std::span<const uint8_t> bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

struct Heard {
  std::string address;
  std::vector<std::string> fields;
  int64_t arrival_ns;
};

// Hands `text` over in pieces of `piece` bytes, one a nanosecond.
std::vector<Heard> heard(const std::string& text, size_t piece, SentenceStatistics* statistics = nullptr) {
  SentenceParser parser;
  std::vector<Heard> all;
  int64_t now_ns = 0;
  for (size_t i = 0; i < text.size(); i += piece) {
    parser.parse(bytes_of(text).subspan(i, std::min(piece, text.size() - i)), now_ns++,
                 [&](const Sentence& s) {
                   all.push_back({std::string(s.address), {s.fields.begin(), s.fields.end()}, s.arrival_ns});
                 });
  }
  if (statistics) *statistics = parser.statistics();
  return all;
}

// Sentences as receivers' manuals print them.
const std::string kGolden =
    "$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"
    "$INHDT,235.18,T*18\r\n"
    "$PSXN,23,-2.82,1.00,235.18,-1.66*3D\r\n";

TEST(SentenceParser, TakesSentencesFromPiecesOfAnySize) {
  for (size_t piece = 1; piece < 200; ++piece) {
    const auto all = heard(kGolden, piece);
    ASSERT_EQ(all.size(), 3u) << piece;
    EXPECT_EQ(all[0].address, "GPGGA");
    ASSERT_EQ(all[0].fields.size(), 14u);
    EXPECT_EQ(all[0].fields[8], "545.4");
    EXPECT_EQ(all[0].fields[13], "");
    EXPECT_EQ(all[1].fields, (std::vector<std::string>{"235.18", "T"}));
    EXPECT_EQ(all[2].fields[1], "-2.82");
    // The '$' is in this piece.
    EXPECT_EQ(all[1].arrival_ns, static_cast<int64_t>(kGolden.find("$INHDT") / piece));
  }
}

TEST(SentenceParser, RefusesWhatIsNotWhole) {
  SentenceStatistics s;
  EXPECT_TRUE(heard("$INHDT,235.19,T*18\r\n", 7, &s).empty());
  EXPECT_EQ(s.bad_checksum, 1u);
  EXPECT_TRUE(heard("$INHDT,235.18,T*1G\r\n", 7, &s).empty());
  EXPECT_EQ(s.bad_checksum, 1u);
  EXPECT_TRUE(heard("$INHDT,235.18,T\r\n", 7, &s).empty());  // no checksum
  EXPECT_EQ(s.broken, 1u);
  EXPECT_TRUE(heard("$" + std::string(500, 'A') + "*00\r\n", 7, &s).empty());
  EXPECT_EQ(s.broken, 1u);
  EXPECT_TRUE(heard("$INHDT,23\xff"
                    "5.18,T*18\r\n",
                    7, &s)
                  .empty());
  EXPECT_EQ(s.broken, 1u);
  // Its end was lost: the next one is whole.
  EXPECT_EQ(heard("$INHDT,23$INHDT,235.18,T*18", 7, &s).size(), 1u);
  EXPECT_EQ(s.broken, 1u);
  EXPECT_EQ(heard("\xb5\x62\x01\x07 RTCM $INHDT,235.18,T*18", 7, &s).size(), 1u);  // u-blox between
  EXPECT_GT(s.skipped_bytes, 5u);
}

TEST(SentenceParser, MoreFieldsThanAnySentenceHasAreCutOff) {
  const auto all = heard(sentence_of("GPGSV" + std::string(120, ',')), 9);
  ASSERT_EQ(all.size(), 1u);
  EXPECT_EQ(all[0].fields.size(), SentenceParser::kMostFields);
}

TEST(SentenceParser, OneWrongByteIsAlwaysFound) {
  const std::string good = "$INHDT,235.18,T*18";
  for (size_t i = 0; i < good.size(); ++i) {
    for (int wrong = 0; wrong < 256; ++wrong) {
      if (wrong == good[i]) continue;
      std::string bad = good;
      bad[i] = static_cast<char>(wrong);
      EXPECT_TRUE(heard(bad, 3).empty()) << bad;
    }
  }
}

// A fuzzer: whatever comes, nothing breaks, and a good sentence after it and a '$' or line end is heard.
TEST(SentenceParser, AnyBytesDoNoHarm) {
  TestRng rng;
  const std::string alphabet = "$*,\r\n0123456789ABCDEFGHPSXNT.-+";
  for (int round = 0; round < 3000; ++round) {
    std::string text;
    for (int i = rng.index(300); i > 0; --i) {
      text += rng.uniform(0, 1) < 0.2
                  ? static_cast<char>(rng.index(256))
                  : alphabet[static_cast<size_t>(rng.index(static_cast<int>(alphabet.size())))];
    }
    const auto all = heard(text + "\r\n" + "$INHDT,235.18,T*18\r\n", static_cast<size_t>(1 + rng.index(50)));
    ASSERT_FALSE(all.empty());
    EXPECT_EQ(all.back().address, "INHDT");
  }
}

}  // namespace
}  // namespace perch::nmea
