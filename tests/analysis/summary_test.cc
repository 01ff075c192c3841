#include "perch/analysis/summary.h"

#include "analysis/flights.h"
#include "perch/analysis/error_table.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::HasSubstr;
using testing::Not;

// Flights that are all some program will hand over one day.
std::vector<FlightResult> odd_flights() {
  TestRng rng;
  std::vector<FlightResult> flights(1);                               // no frame
  flights.push_back(make_flight({.frames = 1, .noise = 0.01}, rng));  // one
  flights.push_back(make_flight({.frames = 20, .noise = 0}, rng));    // no covariance
  flights.push_back(make_flight({.frames = 5, .noise = 0.01}, rng));  // nothing detected
  for (size_t i = 0; i < 5; ++i) lose(flights.back(), i, EstimateStatus::kUnreadable);
  flights.push_back(make_flight({.frames = 5, .noise = 0.01}, rng));  // no navigation
  flights.back().flight.nav.samples.clear();
  flights.push_back(make_flight({.frames = 5, .noise = 0.01}, rng));  // a pose that is none
  flights.back().estimates[3].pad_from_body->mean.translation.z() = INFINITY;
  flights.push_back(make_flight({.frames = 5, .noise = 0.01}, rng));  // a name of bytes, not of UTF-8
  flights.back().flight.name = "n\xff\"\\\n";
  flights.back().problems.push_back("\xc3 broken");
  return flights;
}

void expect_no_nan(const nlohmann::json& json) {
  if (json.is_number_float()) {
    EXPECT_TRUE(std::isfinite(json.get<double>()));
  }
  if (json.is_structured()) {
    for (const auto& inner : json) expect_no_nan(inner);
  }
}

TEST(Summary, IsJsonWithoutNanWhateverTheFlight) {
  for (const FlightResult& flight : odd_flights()) {
    const nlohmann::ordered_json made = summary_json(score_flight(flight));
    expect_no_nan(nlohmann::json(made));
    const auto read = nlohmann::json::parse(to_text(made, 2));
    EXPECT_EQ(read["frames"], flight.estimates.size());
  }
}

TEST(Summary, SaysWhatTheScoreSays) {
  TestRng rng;
  MadeUpFlight made{.frames = 40};
  made.offset << 0.25, 0, 0, 0, 0, 0;
  FlightResult flight = make_flight(made, rng);
  lose(flight, 7, EstimateStatus::kPartial);
  flight.flight.problems = {"nav0/data.csv:3: nine numbers expected"};
  flight.problems = {"17.png: truncated"};
  const auto json = summary_json(score_flight(flight));
  EXPECT_NEAR(json["errors"]["x"]["dc_offset"].get<double>(), 0.25, 1e-12);
  EXPECT_EQ(json["errors"]["yaw"]["unit"], "rad");
  EXPECT_EQ(json["detection"]["counts"]["ok"], 39);
  EXPECT_EQ(json["detection"]["counts"]["partial"], 1);
  EXPECT_EQ(json["detection"]["gaps"][0]["reasons"]["partial"], 1);
  EXPECT_EQ(json["compared_frames"], 39);
  EXPECT_EQ(json["comparison"], "compared");
  EXPECT_EQ(json["stages"][1]["stage"], "segmentation");
  EXPECT_EQ(json["problems"].size(), 2u);
}

size_t columns(const std::string& line) {
  return static_cast<size_t>(std::count(line.begin(), line.end(), ','));
}

TEST(Summary, CsvHasAsManyFieldsAsItsHeader) {
  for (const FlightResult& flight : odd_flights()) {
    FlightScore score = score_flight(flight);
    score.name = "plain";
    const std::string row = summary_csv_row(summary_json(score));
    EXPECT_EQ(columns(row), columns(summary_csv_header())) << row;
    EXPECT_EQ(row.back(), '\n');
    EXPECT_THAT(row, Not(HasSubstr("nan")));
    EXPECT_THAT(row, Not(HasSubstr("inf")));
    // From the file it is the same row.
    EXPECT_EQ(summary_csv_row(nlohmann::ordered_json::parse(to_text(summary_json(score), 2))), row);
  }
}

TEST(Summary, CsvCountsAFlightThatFailed) {
  const std::string row = summary_csv_row(summary_json(failed_flight("a", "a: no flight")));
  EXPECT_EQ(row.rfind("a,not estimated,0,0,", 0), 0u) << row;
  EXPECT_EQ(columns(row), columns(summary_csv_header()));
  EXPECT_TRUE(row.ends_with(",1\n")) << row;
}

TEST(Summary, CsvQuotesANameWithAComma) {
  FlightScore score;
  score.name = "a,\"b\"";
  EXPECT_EQ(summary_csv_row(summary_json(score)).rfind("\"a,\"\"b\"\"\",", 0), 0u);
}

TEST(Summary, ErrorsAreARowForEachComparedFrame) {
  TestRng rng;
  MadeUpFlight made{.frames = 3};
  made.offset << 0.5, 0, 0, 0, 0, 0;
  FlightResult flight = make_flight(made, rng);
  lose(flight, 1, EstimateStatus::kNoTarget);
  std::istringstream csv(errors_csv(score_flight(flight)));
  std::vector<std::string> lines;
  for (std::string line; std::getline(csv, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[0], "#timestamp [ns],x [m],y [m],z [m],yaw [rad],pitch [rad],roll [rad],range [m],nees []");
  EXPECT_EQ(lines[1].rfind(std::to_string(kStartNs) + ",0.5,", 0), 0u) << lines[1];
  EXPECT_EQ(columns(lines[2]), columns(lines[0]));
  EXPECT_EQ(lines[2].back(), ',');  // no covariance, no NEES
}

TEST(ErrorTable, ShowsCentimetresAndDegreesInColumns) {
  TestRng rng;
  MadeUpFlight made{.frames = 10};
  made.offset << 0.0123, 0, 0, kRadFromDeg, 0, 0;
  const std::string table = error_table(score_flight(make_flight(made, rng)));
  EXPECT_THAT(table, HasSubstr("x            1.230 cm      +1.230 cm       0.000 cm       1.230 cm\n"));
  EXPECT_THAT(table, HasSubstr("yaw          1.000 deg     +1.000 deg      0.000 deg      1.000 deg\n"));
}

TEST(ErrorTable, CallsNeesHonestAgainstTruthOnly) {
  TestRng rng;
  FlightResult flight = make_flight({.frames = 10, .noise = 0.01}, rng);
  EXPECT_THAT(error_table(score_flight(flight)),
              HasSubstr(", with navigation's noise counted as vision's\n"));
  flight.flight.truth = flight.flight.nav;
  const std::string table = error_table(score_flight(flight));
  EXPECT_THAT(table, HasSubstr("  against the flight's truth: position "));
  EXPECT_THAT(table, HasSubstr(", honest within "));
  EXPECT_EQ(summary_json(score_flight(flight))["consistency"]["reference"], "truth");
}

TEST(ErrorTable, SaysWhyThereIsNone) {
  TestRng rng;
  FlightResult flight = make_flight({.frames = 10}, rng);
  flight.flight.nav.samples.clear();
  EXPECT_EQ(error_table(score_flight(flight)),
            "made_up: 10 of 10 frames with a pose (100.0 %); nothing to compare with: no navigation\n");
}

}  // namespace
}  // namespace perch
