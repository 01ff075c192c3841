#include "perch/station/station_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/config/error.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::HasSubstr;

class StationOptionsTest : public testing::Test {
 protected:
  StationOptions read(const std::string& station) const {
    Section root = Section::parse("station: " + station + "\n", folder_ / "run.yaml");
    return read_station_options(root);
  }
  std::string error_of(const std::string& station) const {
    try {
      read(station);
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "none";
  }
  TempFolder folder_;
};

TEST_F(StationOptionsTest, IsOffWithoutItsSection) {
  Section root = Section::parse("record: x\n", "run.yaml");
  EXPECT_FALSE(read_station_options(root).on);
}

TEST_F(StationOptionsTest, ListensOnThisMachineAloneUnlessTold) {
  const StationOptions options = read("{}");
  EXPECT_TRUE(options.on);
  EXPECT_EQ(options.address, "127.0.0.1");
  EXPECT_EQ(options.port, 8080);
  EXPECT_FALSE(options.control);
  EXPECT_EQ(read("{listen: '[::1]:81'}").address, "::1");
}

TEST_F(StationOptionsTest, WantsATokenWhereOthersCanReachIt) {
  EXPECT_THAT(error_of("{listen: '0.0.0.0:8080'}"),
              HasSubstr("run.yaml:1: station.listen: expected 127.0.0.1, or a `token`"));
  EXPECT_THAT(error_of("{listen: '[::]:8080'}"), HasSubstr("token"));
  folder_.write("token", "correct-horse-battery\n");
  EXPECT_EQ(read("{listen: '0.0.0.0:8080', token: token}").token, "correct-horse-battery");
}

TEST_F(StationOptionsTest, SaysWhatIsWrong) {
  for (const char* listen :
       {"8080", "localhost:8080", "::1:80", "127.0.0.1:", "127.0.0.1:70000", "127.0.0.1:80x", "[127.0.0.1]"})
    EXPECT_THAT(error_of("{listen: '" + std::string(listen) + "'}"), HasSubstr("expected ADDRESS:PORT"))
        << listen;
  folder_.write("short", "secret");
  folder_.write("long", std::string(300, 'a'));
  EXPECT_THAT(error_of("{token: short}"), HasSubstr("expected a token of 16"));
  EXPECT_THAT(error_of("{token: short}"), testing::Not(HasSubstr("secret")));
  EXPECT_THAT(error_of("{token: long}"), HasSubstr("expected a token of 16"));
  EXPECT_THAT(error_of("{token: none}"), HasSubstr("cannot be read"));
  EXPECT_THAT(error_of("{bandwidth: 1}"), HasSubstr("bandwidth"));
  EXPECT_THAT(error_of("{open: true}"), HasSubstr("open"));
}

}  // namespace
}  // namespace perch
