// perch-batch over many flights: what is finished is not done again, shards and kills change nothing, to the
// byte.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "support/rng.h"
#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

constexpr char kSimulation[] =
    "camera: {width: 160, height: 120, lens: LENSMODEL_PINHOLE, intrinsics: [113, 113, 79.5, 59.5],"
    " rate_hz: 10}\n"
    "flight: {start_height: 3, start_aside: 0.3, touchdown_height: 2, duration: 0.7, hover: 0}\n";
constexpr int kFlights = 6;

using Files = std::map<std::string, std::string>;

class PerchBatchSeason : public testing::Test {
 protected:
  // Flights f0 to f5: one simulated, and copies whose pictures come in another order. The last two are
  // broken.
  static void SetUpTestSuite() {
    flown_ = std::make_unique<TempFolder>();
    flown_->write("landing.yaml",
                  "target: " + std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml\n" + kSimulation);
    const Outcome made = run_program_in(*flown_, PERCH_SIMULATE, "--config landing.yaml --output f0");
    EXPECT_EQ(made.code, 0) << made.err;
  }
  static void TearDownTestSuite() { flown_.reset(); }

  PerchBatchSeason() {
    fs::copy(*flown_ / "f0", folder_ / "f0", fs::copy_options::recursive);
    std::string manifest = "# the season\n";
    for (int i = 0; i < kFlights; ++i) {
      const std::string name = "f" + std::to_string(i);
      if (i > 0) fs::copy(folder_ / "f0", folder_ / name, fs::copy_options::recursive);
      manifest += name + "\n";
    }
    std::ofstream(folder_ / "f3/mav0/cam0/data.csv", std::ios::app) << "1800000000000000000,none.png\n";
    fs::remove(folder_ / "f4/mav0/cam0/sensor.yaml");
    fs::remove(folder_ / "f5/mav0/cam0/data.csv");
    folder_.write("manifest", manifest);
  }
  static std::string arguments(const std::string& output, const std::string& more) {
    return "--config f0/perch.yaml --manifest manifest --notimes --output " + output + ' ' + more;
  }
  Outcome run(const std::string& output, const std::string& more = "") const {
    return run_program_in(folder_, PERCH_BATCH, arguments(output, more));
  }
  // One that goes on by itself; its process id.
  pid_t begin(const std::string& output, const std::string& more = "") const {
    const pid_t child = fork();
    if (child != 0) return child;
    const std::string command =
        std::string("exec ") + PERCH_BATCH + ' ' + arguments(output, more) + " >/dev/null 2>&1";
    if (chdir(folder_.path().c_str()) == 0) execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  Files files(const std::string& output) const {
    Files all;
    for (const auto& entry : fs::recursive_directory_iterator(folder_ / output)) {
      if (!entry.is_directory())
        all[entry.path().lexically_relative(folder_ / output)] = read_file(entry.path());
    }
    return all;
  }
  // Names the files that differ instead of printing them.
  static void expect_equal(const Files& a, const Files& b) {
    for (const auto& [name, content] : a) EXPECT_TRUE(b.contains(name) && b.at(name) == content) << name;
    for (const auto& [name, content] : b) EXPECT_TRUE(a.contains(name)) << name;
  }
  static inline std::unique_ptr<TempFolder> flown_;
  TempFolder folder_;
};

TEST_F(PerchBatchSeason, ShardsAndJobsChangeNotAByte) {
  const Outcome single = run("single", "--jobs 1");
  EXPECT_EQ(single.code, 1);
  EXPECT_THAT(single.err, HasSubstr("perch-batch: f5: no flight: "));
  for (const char* shard : {"--shard 2/3 --jobs 2", "--shard 3/3", "--shard 1/3"}) {
    EXPECT_LE(run("shards", shard).code, 1);
    EXPECT_FALSE(fs::exists(folder_ / "shards/summary.csv")) << shard;
  }
  const Outcome merge = run("shards");
  EXPECT_EQ(merge.code, 1);
  EXPECT_THAT(merge.out, HasSubstr("4 of 6 flights finished before\n"));
  expect_equal(files("single"), files("shards"));
  const std::string csv = read_file(folder_ / "single/summary.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), kFlights + 1);
}

TEST_F(PerchBatchSeason, DoesAgainWhatIsNoLongerTrueAndNothingElse) {
  run("out");
  const auto redone = [&](const std::string& more = "") {
    const std::string err = run("out", more).err;
    std::string names;
    for (int i = 0; i < kFlights; ++i) {
      if (err.find("f" + std::to_string(i) + ": done") != std::string::npos) names += std::to_string(i);
    }
    return names;
  };
  EXPECT_EQ(redone(), "");
  fs::last_write_time(folder_ / "f1/mav0/cam0/data.csv", fs::file_time_type::clock::now());
  EXPECT_EQ(redone(), "1");
  fs::remove(folder_ / "f2/mav0/nav0/data.csv");
  EXPECT_EQ(redone(), "2");
  fs::resize_file(folder_ / "out/f3/estimates.csv", 100);  // as a power cut leaves it
  EXPECT_EQ(redone(), "3");
  folder_.write("out/f0/complete.json", "{\"key\": 1, \"files\"");
  EXPECT_EQ(redone(), "0");
  EXPECT_EQ(redone("--set detection.follow=false"), "0123");
  EXPECT_EQ(redone("--set detection.follow=false --times"), "0123");
  std::ofstream(folder_ / "f0/target.yaml", std::ios::app) << "# moved\n";
  EXPECT_EQ(redone("--times --set detection.follow=false"), "0123");
}

TEST_F(PerchBatchSeason, AFlightThatBrokeHasNoResultAnyMore) {
  run("out");
  fs::remove(folder_ / "f1/mav0/cam0/data.csv");
  EXPECT_EQ(run("out").code, 1);
  EXPECT_FALSE(fs::exists(folder_ / "out/f1/complete.json"));
  EXPECT_THAT(read_file(folder_ / "out/summary.csv"), HasSubstr("\nf1,not estimated,"));
}

TEST_F(PerchBatchSeason, KilledAtAnyMomentNothingIsLostOrDoubled) {
  run("undisturbed");
  TestRng rng;
  // Whole runs and pairs of shards, killed ever later: in the first flight, between flights, in the report.
  for (int kill_number = 0; kill_number < 20; ++kill_number) {
    std::vector<pid_t> children;
    if (kill_number % 2 == 0) {
      children = {begin("out")};
    } else {
      children = {begin("out", "--shard 1/2"), begin("out", "--shard 2/2")};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(rng.index(10 + 10 * kill_number)));
    for (const pid_t child : children) kill(child, SIGKILL);
    for (const pid_t child : children) waitpid(child, nullptr, 0);
    // So that later kills find work, too.
    if (kill_number % 5 == 4) fs::remove(folder_ / "out/f0/complete.json");
  }
  EXPECT_EQ(run("out").code, 1);
  expect_equal(files("undisturbed"), files("out"));
}

TEST_F(PerchBatchSeason, TwoAtOnceDoNotDisturbEachOther) {
  run("undisturbed");
  const std::vector<pid_t> children = {begin("out"), begin("out"), begin("out", "--shard 1/2")};
  for (const pid_t child : children) waitpid(child, nullptr, 0);
  expect_equal(files("undisturbed"), files("out"));
}

TEST_F(PerchBatchSeason, NeverWritesIntoAFlight) {
  const Outcome result = run_program_in(folder_, PERCH_BATCH, "--config f0/perch.yaml --output . f0");
  EXPECT_EQ(result.code, 2);
  EXPECT_THAT(result.err, HasSubstr("would write into the flight"));
}

TEST_F(PerchBatchSeason, TheDatabaseHasAllFlights) {
  run("out");
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((folder_ / "out/results.sqlite").c_str(), &database), SQLITE_OK);
  const auto ask = [&](const char* sql) {
    std::string answer;
    const auto take = [](void* text, int columns, char** values, char**) {
      for (int i = 0; i < columns; ++i)
        *static_cast<std::string*>(text) += std::string(values[i] ? values[i] : "null") + ' ';
      return 0;
    };
    EXPECT_EQ(sqlite3_exec(database, sql, take, &answer, nullptr), SQLITE_OK) << sql;
    return answer;
  };
  EXPECT_EQ(ask("SELECT count(*), sum(frames), sum(ok = frames) FROM flights"), "6 33 5 ");
  EXPECT_EQ(ask("SELECT flight FROM flights WHERE comparison = 'not estimated'"), "f4 f5 ");
  EXPECT_EQ(ask("SELECT flight, count(*) FROM problems GROUP BY flight"), "f3 1 f4 1 f5 1 ");
  EXPECT_EQ(ask("SELECT flight, frames FROM gaps"), "f3 1 ");
  EXPECT_THAT(ask("SELECT position_rms_m, start_ns, truth_position_rms_m FROM flights WHERE flight = 'f0'"),
              Not(HasSubstr("null")));
  sqlite3_close(database);
}

}  // namespace
}  // namespace perch
