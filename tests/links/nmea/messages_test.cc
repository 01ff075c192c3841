#include "perch/links/nmea/messages.h"

#include <gtest/gtest.h>

#include <cmath>

#include "links/nmea/fake_receiver.h"
#include "support/rng.h"

namespace perch::nmea {
namespace {

Message decoded(const std::string& text) {
  SentenceParser parser;
  Message message;
  parser.parse({reinterpret_cast<const uint8_t*>(text.data()), text.size()}, 0,
               [&](const Sentence& sentence) { message = decode(sentence); });
  EXPECT_EQ(parser.statistics().good, 1u) << text;
  return message;
}
// Of a body without '$' and checksum.
Message of(const std::string& body) { return decoded(sentence_of(body)); }
bool malformed(const std::string& body) { return std::holds_alternative<Malformed>(of(body)); }

constexpr int64_t kSecond = 1'000'000'000;

// As receivers and their manuals have them.
TEST(NmeaMessages, ReadsGolden) {
  const auto gga =
      std::get<Gga>(decoded("$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47"));
  EXPECT_EQ(gga.of_day_ns, (12 * 3600 + 35 * 60 + 19) * kSecond);
  EXPECT_NEAR(gga.place.latitude * kDegFromRad, 48 + 7.038 / 60, 1e-12);
  EXPECT_NEAR(gga.place.longitude * kDegFromRad, 11 + 31.0 / 60, 1e-12);
  EXPECT_NEAR(gga.place.height, 545.4 + 46.9, 1e-9);
  EXPECT_EQ(gga.quality, FixQuality::kGnss);
  EXPECT_EQ(gga.satellites, 8);
  EXPECT_EQ(gga.hdop, 0.9);

  const auto south = std::get<Gga>(
      decoded("$INGGA,163611.11,7849.766185,N,00543.603403,W,2,07,1.2,2.95,M,36.08,M,2.0,0123*4D"));
  EXPECT_LT(south.place.longitude, 0);
  EXPECT_EQ(south.of_day_ns % kSecond, 110'000'000);
  EXPECT_EQ(south.quality, FixQuality::kDifferential);

  const auto pashr =
      std::get<Attitude>(decoded("$PASHR,163029.000,158.09,T,-0.30,+0.31,+0.01,0.029,0.029,0.059,1,1*3B"));
  EXPECT_EQ(pashr.of_day_ns, (16 * 3600 + 30 * 60 + 29) * kSecond);
  EXPECT_NEAR(*pashr.heading * kDegFromRad, 158.09, 1e-9);
  EXPECT_NEAR(pashr.roll * kDegFromRad, -0.30, 1e-9);
  EXPECT_NEAR(pashr.pitch * kDegFromRad, 0.31, 1e-9);
  EXPECT_NEAR(*pashr.sigma * kDegFromRad, 0.059, 1e-9);

  const auto psxn = std::get<Attitude>(decoded("$PSXN,23,-2.82,1.00,235.18,-1.66*3D"));
  EXPECT_NEAR(psxn.roll * kDegFromRad, -2.82, 1e-9);
  EXPECT_NEAR(psxn.pitch * kDegFromRad, 1.00, 1e-9);
  EXPECT_NEAR(*psxn.heading * kDegFromRad, 235.18, 1e-9);
  EXPECT_FALSE(psxn.of_day_ns);

  const auto prdid = std::get<Attitude>(of("PRDID,-1.31,7.81,47.31"));
  EXPECT_NEAR(prdid.pitch * kDegFromRad, -1.31, 1e-9);
  EXPECT_NEAR(prdid.roll * kDegFromRad, 7.81, 1e-9);

  const auto rmc = std::get<Rmc>(of("GPRMC,081836.75,A,3751.65,S,14507.36,E,010.0,090.0,130998,011.3,E"));
  EXPECT_TRUE(rmc.valid);
  EXPECT_NEAR(*rmc.speed, 18520.0 / 3600, 1e-9);
  EXPECT_NEAR(*rmc.course * kDegFromRad, 90, 1e-9);
  EXPECT_EQ(std::get<TrueHeading>(decoded("$INHDT,66.99,T*25")).heading, 66.99 * kRadFromDeg);
  EXPECT_FALSE(std::get<TrueHeading>(of("GPTHS,77.1,V")).heading);
  EXPECT_EQ(std::get<Gst>(of("GPGST,024603.00,3.2,6.6,4.7,47.3,5.8,5.6,22.0")).up, 22.0);
}

TEST(NmeaMessages, WithoutAFixMostIsEmptyAndNothingIsWrong) {
  EXPECT_EQ(std::get<Gga>(of("GNGGA,,,,,,0,00,99.99,,,,,,")).quality, FixQuality::kNone);
  EXPECT_FALSE(std::get<Rmc>(of("GNRMC,,V,,,,,,,,,,N")).valid);
  EXPECT_FALSE(std::get<TrueHeading>(of("GPHDT,,")).heading);
  EXPECT_FALSE(std::get<Gst>(of("GPGST,,,,,,,,")).up);
  EXPECT_TRUE(std::holds_alternative<Unknown>(of("PASHR,163029.000,,,,,,,,,0,0")));
  // A receiver that stands has no course.
  EXPECT_FALSE(std::get<Rmc>(of("GNRMC,120000.00,A,4807.038,N,01131.000,E,0.004,,080326,,,A,V")).course);
}

TEST(NmeaMessages, WhatIsNoMeasurementIsNoFix) {
  for (const char* quality : {"6", "7", "8"}) {  // dead reckoning, by hand, simulated
    EXPECT_EQ(std::get<Gga>(of("GPGGA,123519,4807.038,N,01131.000,E," + std::string(quality) +
                               ",08,0.9,545.4,M,46.9,M,,"))
                  .quality,
              FixQuality::kNone);
  }
}

TEST(NmeaMessages, OthersAreUnknown) {
  for (const char* body : {"GPGSV,3,1,11,03,03,111,00", "PASHR,ACK", "PASHR,POS,1,2", "PSXN,20,1,0,0,0",
                           "GGA,1", "PUBX,00,1", "GPZDA,163611.11,10,09,2019,,", ""}) {
    EXPECT_TRUE(std::holds_alternative<Unknown>(of(body))) << body;
  }
}

TEST(NmeaMessages, RefusesFieldsThatCannotBe) {
  const std::vector<std::string> gga = {"123519", "4807.038", "N", "01131.000", "E", "4",   "08",
                                        "0.9",    "545.4",    "M", "46.9",      "M", "1.0", "0001"};
  const auto with = [&](size_t i, const std::string& field) {
    std::string body = "GPGGA";
    for (size_t k = 0; k < gga.size(); ++k) body += "," + (k == i ? field : gga[k]);
    return body;
  };
  ASSERT_TRUE(std::holds_alternative<Gga>(of(with(99, ""))));
  for (const auto& [i, field] : std::vector<std::pair<size_t, std::string>>{
           {0, "12351"},    {0, "243519"},     {0, "126019"},    {0, "123561"},   {0, "123519x"},
           {0, "12.3519"},  {0, "123519.1e3"}, {0, "-12351"},    {0, ""},         {1, "9000.001"},
           {1, "4860.000"}, {1, "807.038"},    {1, "04807.038"}, {1, "-807.038"}, {1, "4807.03e"},
           {1, "4807,038"}, {1, "nan"},        {1, ""},          {1, "48 7.038"}, {2, "E"},
           {2, ""},         {2, "NN"},         {3, "18000.001"}, {3, "1131.000"}, {4, "N"},
           {5, ""},         {5, "9"},          {5, "-1"},        {5, "4.0"},      {6, ""},
           {6, "100"},      {7, "-1"},         {7, "0x1"},       {8, ""},         {8, "inf"},
           {8, "1e3"},      {8, "545.4M"},     {8, "--1"},       {8, "+-1"},      {9, "F"},
           {10, "400"}}) {
    EXPECT_TRUE(malformed(with(i, field))) << with(i, field);
  }
  EXPECT_TRUE(malformed(with(99, "") + ",1"));  // a field too many
  EXPECT_TRUE(malformed("GPGGA,123519,4807.038,N"));
  EXPECT_TRUE(malformed("GPHDT,361,T"));
  EXPECT_TRUE(malformed("GPHDT,36,M"));  // magnetic
  EXPECT_TRUE(malformed("PASHR,163029.000,158.09,M,-0.30,+0.31,+0.01,0.029,0.029,0.059,1,1"));
  EXPECT_TRUE(malformed("PASHR,163029.000,158.09,T,-0.30,+90.31,+0.01,0.029,0.029,0.059,1,1"));
  EXPECT_TRUE(malformed("PSXN,23,-2.82,1.00,235.18"));
  EXPECT_TRUE(malformed("PRDID,95,0,0"));
  EXPECT_TRUE(malformed("GPRMC,081836,X,3751.65,S,14507.36,E,000.0,360.0,130998,011.3,E"));
}

// A fuzzer: good sentences with any fields exchanged, and checksums that are right. Whatever is decoded is in
// range.
TEST(NmeaMessages, WhatIsReadIsAlwaysInRange) {
  TestRng rng;
  const FakeReceiver receiver;
  const ReceiverTruth truth{rng.pose(20), rng.normal3()};
  const std::vector<std::string> good = {receiver.gga(1, truth), receiver.rmc(1, truth),
                                         FakeReceiver::pashr(1, truth), "$PSXN,23,-2.82,1.00,235.18,-1.66*",
                                         "$GPGST,024603.00,3.2,6.6,4.7,47.3,5.8,5.6,22.0*"};
  const std::string alphabet = "0123456789.,+-eNSEWMTAxinf";
  size_t read = 0;
  for (int round = 0; round < 30000; ++round) {
    std::string body = good[static_cast<size_t>(rng.index(static_cast<int>(good.size())))];
    body = body.substr(1, body.find('*') - 1);
    for (int i = rng.index(4); i > 0; --i) {
      const auto at = static_cast<size_t>(5 + rng.index(static_cast<int>(body.size()) - 5));
      const char c = alphabet[static_cast<size_t>(rng.index(static_cast<int>(alphabet.size())))];
      if (rng.uniform(0, 1) < 0.7) {
        body[at] = c;
      } else {
        rng.uniform(0, 1) < 0.5 ? body.erase(at, 1) : body.insert(at, 1, c);
      }
    }
    const Message message = of(body);
    if (const auto* m = std::get_if<Gga>(&message); m && m->quality != FixQuality::kNone) {
      ++read;
      ASSERT_LE(std::abs(m->place.latitude), 1.5708) << body;
      ASSERT_LE(std::abs(m->place.longitude), 3.1416) << body;
      ASSERT_LE(std::abs(m->place.height), 1.01e5) << body;
      ASSERT_TRUE(m->of_day_ns >= 0 && m->of_day_ns < 86'401 * kSecond) << body;
    } else if (const auto* a = std::get_if<Attitude>(&message)) {
      ++read;
      ASSERT_LE(std::abs(a->roll), 3.1416) << body;
      ASSERT_LE(std::abs(a->pitch), 1.5708) << body;
      ASSERT_TRUE(!a->heading || (*a->heading >= 0 && *a->heading < 6.2832)) << body;
    } else if (const auto* r = std::get_if<Rmc>(&message)) {
      ASSERT_TRUE(!r->speed || (*r->speed >= 0 && *r->speed < 515)) << body;
    }
  }
  EXPECT_GT(read, 2000u);
}

}  // namespace
}  // namespace perch::nmea
