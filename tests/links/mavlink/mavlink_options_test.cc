#include "perch/links/mavlink/mavlink_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/config/error.h"
#include "support/temp_folder.h"

namespace perch::mavlink {
namespace {

using testing::HasSubstr;

class MavlinkOptionsTest : public testing::Test {
 protected:
  MavlinkOptions read(const std::string& yaml) const {
    Section root = Section::parse(yaml, folder_ / "run.yaml");
    Section outputs = root.section("outputs");
    const MavlinkOptions options = read_mavlink_options(outputs);
    outputs.done();
    root.done();
    return options;
  }
  std::string error_of(const std::string& yaml) const {
    try {
      read(yaml);
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "(no error)";
  }
  TempFolder folder_;
};

TEST_F(MavlinkOptionsTest, WithoutTheSectionNothingIsSent) {
  EXPECT_FALSE(read("outputs: {}").send);
  EXPECT_TRUE(read("outputs: {mavlink: {}}").send);
  EXPECT_FALSE(read("outputs: {mavlink: {send: false}}").send);
}

TEST_F(MavlinkOptionsTest, ReadsEveryKey) {
  folder_.write("key", std::string(32, 'k'));
  const auto options = read(
      "outputs: {mavlink: {profile: px4-vte, max_age: 0.3, system: 3, component: 192, attitude_hz: 50,"
      " position_hz: 20, signing: {key: key, link_id: 7, accept_unsigned: true}}}");
  EXPECT_EQ(options.landing.profile, LandingProfile::kPx4Vte);
  EXPECT_EQ(options.landing.max_age, 0.3);
  EXPECT_EQ(options.link.system, 3);
  EXPECT_EQ(options.link.component, 192);
  EXPECT_EQ(options.link.attitude_hz, 50);
  EXPECT_EQ(options.link.position_hz, 20);
  ASSERT_TRUE(options.signing);
  EXPECT_EQ(options.signing->key[31], 'k');
  EXPECT_EQ(options.signing->link_id, 7);
  EXPECT_TRUE(options.signing->accept_unsigned);
  EXPECT_FALSE(read("outputs: {mavlink: {profile: auto}}").landing.profile);
}

TEST_F(MavlinkOptionsTest, RefusesWhatItDoesNotKnow) {
  EXPECT_THAT(error_of("outputs: {mavlink: {profil: px4}}"),
              HasSubstr("run.yaml:1: outputs.mavlink.profil: expected one of"));
  EXPECT_THAT(error_of("outputs: {mavlink: {profile: pixhawk}}"), HasSubstr("found \"pixhawk\""));
  EXPECT_THAT(error_of("outputs: {mavlink: {system: 256}}"), HasSubstr("between 0 and 255"));
  EXPECT_THAT(error_of("outputs: {mavlink: {signing: {}}}"),
              HasSubstr("outputs.mavlink.signing.key: expected a file"));
  EXPECT_THAT(error_of("outputs: {mavlink: {signing: {key: none}}}"), HasSubstr("none: cannot be read"));
}

TEST_F(MavlinkOptionsTest, AKeyIsBytesOrDigits) {
  std::string digits;
  for (int i = 0; i < 32; ++i) digits += "0f";
  folder_.write("digits", digits + "\n");
  for (const uint8_t byte : read_signing_key(folder_ / "digits")) EXPECT_EQ(byte, 15);
  for (const std::string& wrong : {std::string(), std::string("password"), digits.substr(2), digits + "00",
                                   "xx" + digits.substr(2), std::string(31, '\0')}) {
    folder_.write("wrong", wrong);
    EXPECT_THROW(read_signing_key(folder_ / "wrong"), ConfigError) << wrong;
  }
  EXPECT_THROW(read_signing_key(folder_.path()), ConfigError);  // a folder
}

}  // namespace
}  // namespace perch::mavlink
