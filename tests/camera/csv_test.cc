#include "perch/camera/csv.h"

#include <gmock/gmock.h>

#include <array>
#include <cmath>
#include <limits>

#include "perch/camera/clock_order.h"
#include "support/rng.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

std::vector<std::vector<std::string>> rows(const std::string& text) {
  const TempFolder folder;
  CsvReader csv(folder.write("data.csv", text));
  std::vector<std::vector<std::string>> result;
  while (csv.next()) result.emplace_back(csv.fields().begin(), csv.fields().end());
  return result;
}

TEST(Csv, TakesWhatEditorsAndLoggersLeave) {
  const auto expected = ElementsAre(ElementsAre("1", "a.png"), ElementsAre("2", "b.png"));
  EXPECT_THAT(rows("#timestamp [ns],filename\n1,a.png\n2,b.png\n"), expected);
  EXPECT_THAT(rows("1,a.png\n2,b.png"), expected);
  EXPECT_THAT(rows("\xEF\xBB\xBF#timestamp [ns],filename\r\n1,a.png\r\n2,b.png\r\n"), expected);
  EXPECT_THAT(rows("timestamp [ns],filename\n\n 1 ,\ta.png \n# note, of someone\n\n2,b.png\n\n"), expected);
  EXPECT_THAT(rows(""), ElementsAre());
  EXPECT_THAT(rows("#timestamp [ns],filename"), ElementsAre());
  EXPECT_THAT(rows("1,\n,\n,,"),
              ElementsAre(ElementsAre("1", ""), ElementsAre("", ""), ElementsAre("", "", "")));
}

TEST(Csv, DamagedFirstRowIsARowNotAHeader) {
  EXPECT_THAT(rows("garbage,a.png\n2,b.png\n"),
              ElementsAre(ElementsAre("garbage", "a.png"), ElementsAre("2", "b.png")));
}

TEST(Csv, PlacesCountEveryLine) {
  const TempFolder folder;
  const auto file = folder.write("data.csv", "# a comment\n\n#timestamp\n1\n\n2\n");
  CsvReader csv(file);
  ASSERT_TRUE(csv.next());
  EXPECT_EQ(csv.place(), file.string() + ":4");
  ASSERT_TRUE(csv.next());
  EXPECT_EQ(csv.place(), file.string() + ":6");
}

TEST(Csv, ColumnsAreFoundByName) {
  const TempFolder folder;
  const std::array<ColumnName, 3> names{"timestamp [ns]", "x [m]", "v [m/s]"};
  const auto columns = [&](const std::string& text) {
    return CsvReader(folder.write("data.csv", text)).columns(names);
  };
  EXPECT_THAT(columns("1,2,3\n"), ElementsAre(0, 1, 2));
  EXPECT_THAT(columns("#timestamp, v [m s^-1], extra, x [m]\n"), ElementsAre(0, 3, 1));
  EXPECT_THAT(columns("#time(ns),x,v\n"), ElementsAre(0, 1, 2));
  EXPECT_THAT(
      [&] { columns("\n#timestamp [ns],x [mm],v [m/s]\n"); },
      ThrowsMessage<std::runtime_error>(HasSubstr("data.csv:2: expected the column x [m], found x [mm]")));
  EXPECT_THAT([&] { columns("#timestamp [ns],x [m]\n"); },
              ThrowsMessage<std::runtime_error>(
                  HasSubstr("data.csv:1: expected the column v [m/s], found none of that name")));
  EXPECT_THROW(columns("#timestamp [s],x [m],v [m/s]\n"), std::runtime_error);
}

TEST(Csv, SaysWhichFileCannotBeRead) {
  const TempFolder folder;
  EXPECT_THAT([&] { CsvReader csv(folder / "absent.csv"); },
              ThrowsMessage<std::runtime_error>(HasSubstr("absent.csv: cannot be read")));
  EXPECT_THROW(CsvReader csv(folder.path()), std::runtime_error);
}

TEST(Csv, NumbersAreTheWholeField) {
  EXPECT_EQ(parse_integer("1403636579763555584"), 1403636579763555584);
  EXPECT_EQ(parse_integer("+5"), 5);
  for (const char* bad : {"", "1.5", "1e9", "nan", "0x10", "1 2", "99999999999999999999", "1,5"}) {
    EXPECT_FALSE(parse_integer(bad)) << bad;
  }
  EXPECT_EQ(parse_finite("-1.5e-3"), -1.5e-3);
  for (const char* bad : {"", "nan", "inf", "1e999", "1.5m", "--1"}) EXPECT_FALSE(parse_finite(bad)) << bad;
}

TEST(ClockOrder, LosesTheFewestRows) {
  const auto kept = [](std::vector<int64_t> times) {
    const auto keep = keep_increasing(times);
    std::vector<int64_t> result;
    for (size_t i = 0; i < times.size(); ++i) {
      if (keep[i]) result.push_back(times[i]);
    }
    return result;
  };
  EXPECT_THAT(kept({}), ElementsAre());
  EXPECT_THAT(kept({1, 2, 3}), ElementsAre(1, 2, 3));
  EXPECT_THAT(kept({1, 2, 2, 3}), ElementsAre(1, 2, 3));
  EXPECT_THAT(kept({1, 2, 0, 3, 4}), ElementsAre(1, 2, 3, 4));                    // back once
  EXPECT_THAT(kept({1, 2, 9000000000000, 3, 4, 5}), ElementsAre(1, 2, 3, 4, 5));  // ahead once
  EXPECT_THAT(kept({100, 101, 102, 103, 1, 2}), ElementsAre(100, 101, 102, 103));
  EXPECT_EQ(keep_increasing(std::vector<int64_t>{1, 2, 2, 3}), (std::vector<bool>{true, true, false, true}));
}

TEST(ClockOrder, KeepsAnIncreasingSequenceOfAnyTimes) {
  TestRng rng;
  for (int i = 0; i < 200; ++i) {
    std::vector<int64_t> times;
    for (int n = rng.index(50); n > 0; --n) times.push_back(rng.index(60));
    const auto keep = keep_increasing(times);
    int64_t last = -1;
    for (size_t row = 0; row < times.size(); ++row) {
      if (!keep[row]) continue;
      EXPECT_GT(times[row], last);
      last = times[row];
    }
  }
}

TEST(CsvReader, WithoutItsEndTheLastLineIsARowOrCutOff) {
  const TempFolder folder;
  const std::string whole = "#timestamp [ns],x\n1,25\n2,37\n";
  const auto rows = [&](const std::string& text, LastLine last_line, std::vector<std::string>& problems) {
    CsvReader csv(folder.write("a.csv", text), last_line);
    std::vector<std::string> found;
    while (csv.next()) found.emplace_back(csv.fields().back());
    csv.note_torn(problems);
    return found;
  };
  std::vector<std::string> problems;
  EXPECT_THAT(rows(whole.substr(0, whole.size() - 2), LastLine::kMayLackEnd, problems),
              testing::ElementsAre("25", "3"));
  EXPECT_THAT(rows(whole, LastLine::kMustEnd, problems), testing::ElementsAre("25", "37"));
  EXPECT_THAT(rows("", LastLine::kMustEnd, problems), testing::IsEmpty());
  EXPECT_THAT(problems, testing::IsEmpty());
  EXPECT_THAT(rows(whole.substr(0, whole.size() - 2), LastLine::kMustEnd, problems),
              testing::ElementsAre("25"));
  EXPECT_THAT(problems, testing::ElementsAre((folder / "a.csv").string() +
                                             ":3: the file was cut off within this row, row skipped"));
  EXPECT_THAT(rows("#timestam", LastLine::kMustEnd, problems), testing::IsEmpty());
}

}  // namespace
}  // namespace perch
