#include "perch/analysis/report.h"

#include <nlohmann/json.hpp>
#include <regex>

#include "analysis/flights.h"
#include "perch/analysis/season.h"
#include "perch/analysis/summary.h"
#include "support/near_pose.h"

namespace perch {
namespace {

using testing::HasSubstr;
using testing::Not;

size_t count(const std::string& text, const std::string& part) {
  size_t found = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++found;
  return found;
}

// The flights' JSON, cut out of the page as a browser does: up to the next end tag.
std::vector<nlohmann::json> embedded(const std::string& html) {
  std::vector<nlohmann::json> all;
  const std::string start = "<script class=\"flight\" type=\"application/json\">";
  for (size_t at = html.find(start); at != std::string::npos; at = html.find(start, at)) {
    at += start.size();
    all.push_back(nlohmann::json::parse(html.substr(at, html.find("</script>", at) - at)));
  }
  return all;
}

ReportFlight report_flight(const FlightResult& result) { return {score_flight(result), {}}; }

// A page of one flight with one picture of these bytes.
std::string page_with_picture(const FlightResult& result, const std::string& bytes,
                              const std::string& configuration) {
  std::vector<ReportFlight> flights = {report_flight(result)};
  ReportPicture& picture = flights[0].pictures.emplace_back();
  picture.shown.frame = 0;
  picture.jpeg.assign(bytes.begin(), bytes.end());
  return flight_html(flights[0], configuration);
}

TEST(Report, HoldsItsFlightsAsJson) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 30, .noise = 0.01}, rng);
  lose(result, 3, EstimateStatus::kPartial);
  const std::vector<ReportFlight> flights = {report_flight(result), report_flight({})};
  const std::vector<std::string> texts = {flight_data(flights[0]), flight_data(flights[1])};
  const auto data = embedded(season_html(nullptr, nullptr, texts, "target: a.yaml\n"));
  ASSERT_EQ(data.size(), 2u);
  const auto& frames = data[0]["frames"];
  EXPECT_EQ(frames["status"], "000200000000000000000000000000");
  for (const char* name : {"time_s", "nees", "range_m", "total_us", "reprojection_px", "position_error_cm"}) {
    EXPECT_EQ(frames[name].size(), 30u) << name;
  }
  for (const char* name : {"vision", "navigation", "error_cm_deg", "sigma_cm_deg"}) {
    ASSERT_EQ(frames[name].size(), 6u) << name;
    for (const auto& column : frames[name]) EXPECT_EQ(column.size(), 30u) << name;
  }
  EXPECT_TRUE(frames["vision"][0][3].is_null());
  EXPECT_FALSE(frames["navigation"][0][3].is_null());
  EXPECT_NEAR(frames["vision"][2][0].get<double>(), (*flights[0].score.frames[0].vision)[2], 0.5e-5);
  EXPECT_NEAR(frames["error_cm_deg"][3][5].get<double>(),
              flights[0].score.frames[5].error->difference[3] * kDegFromRad, 0.5e-4);
  EXPECT_EQ(data[1]["summary"]["frames"], 0);
}

TEST(Report, AFlightsDataComesOutOfItsPageAsItWentIn) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 3}, rng);
  result.flight.name = "</script>\n<b>";
  const std::vector<ReportFlight> flights = {report_flight(result)};
  EXPECT_EQ(flight_data_of_page(flight_html(flights[0], "</script>")), flight_data(flights[0]));
  EXPECT_EQ(flight_data_of_page(""), "");
  EXPECT_EQ(flight_data_of_page("<script class=\"flight\" type=\"application/json\">{"), "");
}

TEST(Report, ASeasonOfThousandsIsSmall) {
  TestRng rng;
  const auto summary = summary_json(score_flight(make_flight({.frames = 30, .noise = 0.01}, rng)));
  Season season;
  for (int i = 0; i < 5000; ++i) season.add(summary);
  // Each flight some 20 columns of 8 characters, twice.
  EXPECT_LE(season_html(season.json(), season.json(), {}, "").size(), 700'000u + 2 * 5000 * 25 * 8);
}

TEST(Report, AsksTheNetworkForNothing) {
  TestRng rng;
  const ReportFlight flight = report_flight(make_flight({}, rng));
  const std::string data = flight_data(flight);
  const std::string season = season_html(nullptr, nullptr, {&data, 1}, "");
  const std::string page = flight_html(flight, "");
  const std::string html = season + page + std::string(report_script());
  // Where a page loads from; an address in a comment or a string loads nothing.
  const std::regex loads(
      R"((src|href|action)\s*=\s*["']?\s*(https?:)?//|url\(\s*["']?\s*(https?:)?//|@import)"
      R"(|\bfetch\s*\(|XMLHttpRequest|WebSocket|sendBeacon|import\s*\()");
  std::smatch found;
  EXPECT_FALSE(std::regex_search(html, found, loads)) << found.str();
  // And the browser is told to refuse what slipped through.
  EXPECT_THAT(
      season,
      HasSubstr("content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
                "img-src data:\""));
  EXPECT_THAT(page,
              HasSubstr("content=\"default-src 'none'; style-src 'unsafe-inline'; script-src 'self' file:; "
                        "img-src data:\""));
}

TEST(Report, NoTextBreaksOutOfItsPlace) {
  TestRng rng;
  FlightResult plain = make_flight({.frames = 2}, rng);
  FlightResult hostile = plain;
  const std::string attack =
      "</script><script>alert(1)</script><!--<script><img src=x onerror=alert(1)>\"'\\";
  hostile.flight.name = hostile.target = hostile.frame_names[0] = attack;
  hostile.problems = {attack};
  const std::string html = page_with_picture(hostile, "x", attack), calm = page_with_picture(plain, "x", "x");
  for (const char* tag : {"<script", "</script", "<!--", "<img"})
    EXPECT_EQ(count(html, tag), count(calm, tag)) << tag;
  const auto data = embedded(html);
  ASSERT_EQ(data.size(), 1u);
  EXPECT_EQ(data[0]["summary"]["flight"], attack);
  EXPECT_EQ(data[0]["summary"]["problems"][0], attack);
  EXPECT_EQ(data[0]["pictures"][0]["name"], attack);
}

TEST(Report, PicturesAreBase64) {
  TestRng rng;
  const FlightResult result = make_flight({.frames = 3}, rng);
  const auto encoded = [&](const std::string& bytes) {
    return embedded(page_with_picture(result, bytes, ""))[0]["pictures"][0]["jpeg"];
  };
  // The vectors of RFC 4648.
  EXPECT_EQ(encoded("f"), "Zg==");
  EXPECT_EQ(encoded("fo"), "Zm8=");
  EXPECT_EQ(encoded("foo"), "Zm9v");
  EXPECT_EQ(encoded("foobar"), "Zm9vYmFy");
  EXPECT_EQ(encoded("\xff\xfe\xfd"), "//79");
}

TEST(Report, TimeAscendsWhereTheClockWentBack) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 5}, rng);
  result.estimates[3].timestamp_ns = kStartNs - 1'000'000'000;
  lose(result, 3, EstimateStatus::kRejected);
  const auto frames = embedded(flight_html(report_flight(result), ""))[0]["frames"];
  const auto times = frames["time_s"].get<std::vector<double>>();
  EXPECT_TRUE(std::is_sorted(times.begin(), times.end()));
  EXPECT_EQ(frames["status"], "40000");
}

TEST(Report, StaysSmallForALongFlight) {
  TestRng rng;
  const ReportFlight flight = report_flight(make_flight({.frames = 3000, .noise = 0.01}, rng));
  // 37 numbers of some 7 characters a frame, and the page's style.
  EXPECT_LE(flight_html(flight, "").size(), 15'000u + 3000 * 37 * 8);
}

TEST(Report, OfAVeryLongFlightTheWorstFramesAreShown) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 13'000, .noise = 0.01}, rng);
  lose(result, 7777, EstimateStatus::kPartial);
  result.estimates[5000].pad_from_body->mean.translation.x() += 1;
  const auto frames = embedded(flight_html(report_flight(result), ""))[0]["frames"];
  EXPECT_EQ(frames["each"], 2);
  EXPECT_EQ(frames["time_s"].size(), 6500u);
  EXPECT_EQ(frames["status"].get<std::string>()[7777 / 2], '2');
  EXPECT_GT(frames["position_error_cm"][5000 / 2].get<double>(), 90);
}

TEST(Report, ShowsGreyLevelsAsLettersOfTheirShares) {
  TestRng rng;
  FlightResult result = make_flight({.frames = 1000}, rng);
  result.greys.resize(1000);
  for (GreyHistogram& grey : result.greys) grey.share[3] = 65535;
  result.greys[7] = {};  // could not be read
  const auto grey = embedded(flight_html(report_flight(result), ""))[0]["frames"]["grey"];
  // 999 pictures in at most 240 columns: five each, the last of four.
  ASSERT_EQ(grey["from_s"].size(), 200u);
  const std::string levels = grey["levels"];
  ASSERT_EQ(levels.size(), 200 * GreyHistogram::kBins);
  EXPECT_EQ(levels.substr(0, 6), "000z00");
  EXPECT_TRUE(embedded(flight_html(report_flight(make_flight({}, rng)), ""))[0]["frames"]["grey"].is_null());
}

}  // namespace
}  // namespace perch
