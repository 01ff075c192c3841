// Logs come off SD cards that were pulled while they were written to. Whatever is in them, a reader ends with
// what was good or an error that says why: never a crash (build with PERCH_SANITIZE to see more of those).

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/import/autopilot_log.h"
#include "perch/import/log_tables.h"
#include "support/flight_logs.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::string_view kUlogTopics[] = {"vehicle_attitude", "vehicle_local_position", "sensor_combined"};
constexpr std::string_view kDataflashMessages[] = {"ATT", "XKF1", "IMU", "GPS"};

struct Format {
  std::string log;
  std::string counted;  // the message whose rows are counted
  LogTables (*parse)(const std::string&);
};

LogBytes bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

LoggedMoment hover(double t) {
  LoggedMoment m;
  m.world_from_body.translation = {1, 2, -3 - 0.1 * t};
  m.velocity = {0, 0, -0.1};
  return m;
}

const std::vector<Format>& formats() {
  static const std::vector<Format> all{
      {ulog_of(hover, 1, 3, 1'700'000'000'000'000).bytes, "sensor_combined",
       [](const std::string& log) { return parse_ulog(bytes_of(log), "log", kUlogTopics); }},
      {dataflash_of(hover, 1, 3, 2288, 1000).bytes, "IMU",
       [](const std::string& log) { return parse_dataflash(bytes_of(log), "log", kDataflashMessages); }}};
  return all;
}

size_t rows(const LogTables& log, const std::string& name) {
  const LogTable* table = log.find(name);
  return table ? table->rows() : 0;
}

// Reads it whole, up to the motion. What is thrown is a runtime_error that names the file.
void read_all(const TempFolder& folder, const std::string& log) {
  const auto file = folder.write("log", log);
  try {
    for (const auto& sample : read_autopilot_log(file).nav.samples) {
      ASSERT_TRUE(sample.world_from_body.translation.allFinite());
      ASSERT_NEAR(sample.world_from_body.rotation.norm(), 1, 1e-6);
    }
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr(file.string() + ": "));
  }
}

TEST(LogFuzz, ATruncatedLogKeepsWhatIsBefore) {
  const TempFolder folder;
  for (const Format& format : formats()) {
    const size_t all = rows(format.parse(format.log), format.counted);
    ASSERT_GT(all, 400u);
    TestRng rng;
    size_t last = 0;
    for (size_t length = 16; length < format.log.size(); length += 97) {
      const std::string cut = format.log.substr(0, length);
      const LogTables log = format.parse(cut);
      const size_t now = rows(log, format.counted);
      EXPECT_GE(now, last);
      // A row's bytes are spread over the log evenly: none but the last one's is lost.
      EXPECT_NEAR(static_cast<double>(now) / static_cast<double>(all),
                  static_cast<double>(length) / static_cast<double>(format.log.size()), 0.06);
      last = now;
      if (length % 5 == 0) read_all(folder, cut);
    }
    EXPECT_GT(last, all - 3);
  }
}

TEST(LogFuzz, AfterAHoleTheMessagesGoOn) {
  for (const Format& format : formats()) {
    const size_t all = rows(format.parse(format.log), format.counted);
    TestRng rng;
    for (int i = 0; i < 100; ++i) {
      // Of 1000 bytes, which are 3 to 4 % of the log, missing or random.
      std::string log = format.log;
      const size_t at = log.size() / 8 + static_cast<size_t>(rng.index(static_cast<int>(log.size() / 2)));
      if (i % 2) {
        log.erase(at, 1000);
      } else {
        for (size_t k = 0; k < 1000; ++k) log[at + k] = static_cast<char>(rng.bits());
      }
      const LogTables read = format.parse(log);
      EXPECT_GT(rows(read, format.counted), all * 92 / 100) << i;
      EXPECT_LT(rows(read, format.counted), all) << i;
      ASSERT_THAT(read.problems, testing::Not(IsEmpty())) << i;
      EXPECT_THAT(read.problems.front(), HasSubstr("bytes that are no messages, the first at byte "));
    }
  }
}

TEST(LogFuzz, FlippedBitsCostLittle) {
  const TempFolder folder;
  for (const Format& format : formats()) {
    const size_t all = rows(format.parse(format.log), format.counted);
    TestRng rng;
    for (int i = 0; i < 300; ++i) {
      std::string log = format.log;
      const int flips = 1 + rng.index(20);
      for (int k = 0; k < flips; ++k) {
        // Formats first: a log whose definitions are broken has lost what they define.
        const size_t begin = i % 2 ? 16 : log.size() / 8;
        const size_t at = begin + static_cast<size_t>(rng.index(static_cast<int>(log.size() - begin)));
        log[at] = static_cast<char>(log[at] ^ (1 << rng.index(8)));
      }
      if (i % 2 == 0) {
        EXPECT_GT(rows(format.parse(log), format.counted), all - 10 * static_cast<size_t>(flips)) << i;
      }
      read_all(folder, log);
    }
  }
}

TEST(LogFuzz, RandomBytesAfterARightBeginningAreNoMessages) {
  const TempFolder folder;
  for (const Format& format : formats()) {
    TestRng rng;
    for (int i = 0; i < 200; ++i) {
      std::string log = format.log.substr(0, i % 2 ? 16 : 2000);
      for (int k = 0; k < 3000; ++k) log += static_cast<char>(rng.bits());
      format.parse(log);
      read_all(folder, log);
    }
  }
}

TEST(LogFuzz, WrongMagicIsSaid) {
  EXPECT_THROW(parse_ulog(bytes_of("ULoG\x01\x12\x35 and more of it"), "a", kUlogTopics), std::runtime_error);
  EXPECT_THROW(parse_ulog(bytes_of("ULog"), "a", kUlogTopics), std::runtime_error);
  EXPECT_THROW(parse_dataflash(bytes_of("\xA3\x94\x80"), "a", kDataflashMessages), std::runtime_error);
}

TEST(Ulog, AFormatThatHoldsItselfIsRefused) {
  UlogWriter w;
  w.format("a", "uint64_t timestamp;a inner;");
  w.format("b", "uint64_t timestamp;c[60000] inner;");
  w.format("c", "float[60000] x;");
  w.subscribe(1, "a");
  w.subscribe(2, "b");
  const std::string_view wanted[] = {"a", "b"};
  EXPECT_THAT(parse_ulog(bytes_of(w.bytes), "log", wanted).problems,
              ElementsAre(HasSubstr("topic a: its format is not in the log"),
                          HasSubstr("topic b: its format is not in the log")));
}

TEST(Ulog, NestedTypesAndInstancesAndAppendedData) {
  UlogWriter w;
  w.format("point", "float x;float y;");
  w.format("topic", "uint64_t timestamp;point[2] corners;int16_t after;uint8_t[2] _padding0;");
  w.subscribe(1, "topic");
  w.subscribe(2, "topic", 1);
  w.row(1, uint64_t{10}, 1.0F, 2.0F, 3.0F, 4.0F, int16_t{-7});
  w.row(2, uint64_t{11}, 1.0F, 2.0F, 3.0F, 4.0F, int16_t{99});
  // The logger stopped amid a message; a crash dump was appended behind it.
  w.bytes += std::string(
                 "\x40\x00"
                 "D",
                 3) +
             "half";
  const std::string offset = packed(static_cast<uint64_t>(w.bytes.size()));
  w.bytes.replace(16 + 3 + 16, 8, offset);
  w.bytes[16 + 3 + 8] = 1;
  w.row(1, uint64_t{12}, 1.0F, 2.0F, 3.0F, 4.0F, int16_t{-8});
  const std::string_view wanted[] = {"topic"};
  const LogTables log = parse_ulog(bytes_of(w.bytes), "log", wanted);
  const LogTable* table = log.find("topic");
  ASSERT_TRUE(table);
  EXPECT_THAT(table->columns, ElementsAre("timestamp", "after"));
  EXPECT_THAT(table->numbers, ElementsAre(10, -7, 12, -8));
  // A flag that this reader does not know: the format says not to go on.
  w.bytes[16 + 3 + 8] = 3;
  EXPECT_THROW(parse_ulog(bytes_of(w.bytes), "log", wanted), std::runtime_error);
}

TEST(Dataflash, TheLogsOwnMultipliersTakeThePlaceOfTheFormats) {
  DataflashWriter w;
  w.format(1, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds");
  w.format(2, "MULT", "Qbd", "TimeUS,Id,Mult");
  w.format(3, "X", "Qcch", "TimeUS,A,B,C");
  w.row(2, uint64_t{0}, int8_t{'B'}, 1e-2);
  w.row(2, uint64_t{0}, int8_t{'C'}, 1e-3);
  w.row(3, uint64_t{5}, int16_t{100}, int16_t{100}, int16_t{100});
  w.units(1, 0, 3, "s???", "?BC?");
  w.units(1, 0, 3, "s???", "?CBB");
  const std::string_view wanted[] = {"X"};
  const LogTables log = parse_dataflash(bytes_of(w.bytes), "log", wanted);
  ASSERT_TRUE(log.find("X"));
  EXPECT_THAT(log.find("X")->numbers,
              ElementsAre(5, testing::DoubleEq(0.1), testing::DoubleEq(1), testing::DoubleEq(1)));
}

}  // namespace
}  // namespace perch
