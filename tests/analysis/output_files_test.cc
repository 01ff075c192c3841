#include "perch/analysis/output_files.h"

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "analysis/flights.h"
#include "support/near_pose.h"

namespace perch {
namespace {

std::string text_of(const std::filesystem::path& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

class OutputFiles : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    folder_ = std::filesystem::path(testing::TempDir()) / ("perch_output_files." + std::string(info->name()));
    std::filesystem::remove_all(folder_);
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_;
};

TEST_F(OutputFiles, AreThoseOfTheFormatsAndNothingElse) {
  TestRng rng;
  const FlightScore score = score_flight(make_flight({.frames = 8, .noise = 0.01}, rng));
  write_flight_files(folder_, {score, {}}, "");
  std::set<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder_))
    names.insert(entry.path().filename());
  EXPECT_EQ(names, (std::set<std::string>{"errors.csv", "summary.json", "report.html"}));

  EXPECT_EQ(nlohmann::json::parse(text_of(folder_ / "summary.json"))["frames"], 8);
  const std::string errors = text_of(folder_ / "errors.csv");
  EXPECT_EQ(std::count(errors.begin(), errors.end(), '\n'), 9);
}

TEST_F(OutputFiles, SayWhichFileCannotBeWritten) {
  try {
    write_flight_files(folder_ / "missing", {}, "");
    FAIL() << "wrote into a folder that is not there";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("errors.csv"));
  }
}

}  // namespace
}  // namespace perch
