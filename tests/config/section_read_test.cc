#include <cmath>
#include <limits>

#include "perch/config/section.h"
#include "perch/geometry/euler.h"
#include "support/config_error.h"
#include "support/near_pose.h"
#include "support/rng.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

template <typename T, typename... Args>
T get(const std::string& text, T value, Args... args) {
  Section root = Section::parse("v: " + text + "\n", "/etc/perch/run.yaml");
  root.read("v", value, args...);
  return value;
}

template <typename T, typename... Args>
std::string refusal(const std::string& text, Args... args) {
  return config_error([&] { get(text, T{}, args...); });
}

// What a default looks like in the resolved file, and that it can be read again.
template <typename T, typename... Args>
std::string resolved(T value, Args... args) {
  const auto once = [&](const std::string& text, T v) {
    Section root = Section::parse(text, "run.yaml");
    root.read("v", v, args...);
    return root.resolved();
  };
  const std::string text = once("", value);
  EXPECT_EQ(once(text, value), text);
  return text;
}

TEST(SectionRead, TakesNumbersAsYamlWritesThem) {
  for (const char* text : {"0.25", "+0.25", ".25", "25e-2", "2.5E-1", "'0.25'", "0.25 # m"}) {
    EXPECT_EQ(get(text, 0.0), 0.25) << text;
  }
  EXPECT_EQ(get("-0", 1.0), 0);
  EXPECT_EQ(get("1e308", 0.0), 1e308);
  EXPECT_EQ(get("010", 0), 10);
  EXPECT_EQ(get("1e3", 0), 1000);
}

TEST(SectionRead, RefusesWhatIsNoFiniteNumber) {
  for (const char* text : {"fast",     "1e400", "-1e400", ".nan", "nan", ".inf", "-.inf",  "inf",
                           "infinity", "0x10",  "1_000",  "1,5",  "1 2", "+-1",  "++1",    "--1",
                           "1.2.3",    "5m",    "''",     "~",    "",    "[1]",  "{a: 1}", "true"}) {
    EXPECT_THAT(refusal<double>(text), StartsWith("/etc/perch/run.yaml:1: v: expected a number, found "))
        << text;
    EXPECT_THAT(refusal<int>(text), StartsWith("/etc/perch/run.yaml:1: v: expected a whole number, found "))
        << text;
  }
}

TEST(SectionRead, RefusesNumbersOutOfRangeAndSaysTheRange) {
  EXPECT_THAT(refusal<double>("0", kPositive), HasSubstr("expected a number above 0, found \"0\""));
  EXPECT_THAT(refusal<double>("-1", kNotNegative),
              HasSubstr("expected a number of at least 0, found \"-1\""));
  EXPECT_THAT(refusal<double>("1.1", kFraction), HasSubstr("expected a number between 0 and 1, found"));
  EXPECT_THAT(refusal<double>("5", Range{.max = 4.5}), HasSubstr("expected a number of at most 4.5, found"));
  EXPECT_THAT(refusal<double>("0", Range{kPositive.min, 2}),
              HasSubstr("a number above 0 and at most 2, found"));
  EXPECT_EQ(get("0", 1.0, kFraction), 0);
  EXPECT_EQ(get("1", 0.0, kFraction), 1);
  EXPECT_EQ(get("5e-324", 1.0, kNotNegative), 5e-324);
}

TEST(SectionRead, RefusesFractionsAndWhatOverflowsForWholeNumbers) {
  EXPECT_THAT(refusal<int>("2.5"), HasSubstr("expected a whole number, found \"2.5\""));
  EXPECT_THAT(refusal<int>("0", kPositive), HasSubstr("expected a whole number above 0, found \"0\""));
  EXPECT_THAT(refusal<int>("3000000000"),
              HasSubstr("expected a whole number between -2147483648 and 2147483647, found"));
  EXPECT_THAT(refusal<int>("1e300", kPositive), HasSubstr("between -2147483648 and 2147483647, found"));
  EXPECT_EQ(get("2147483647", 0), 2147483647);
  EXPECT_EQ(get("-2147483648", 0), std::numeric_limits<int>::min());
}

TEST(SectionRead, TakesTrueAndFalseAloneAsBooleans) {
  EXPECT_TRUE(get("true", false));
  EXPECT_FALSE(get("false", true));
  for (const char* text : {"on", "off", "yes", "no", "True", "FALSE", "1", "0", "y", "", "[true]"}) {
    EXPECT_THAT(refusal<bool>(text), HasSubstr("v: expected true or false, found ")) << text;
  }
}

TEST(SectionRead, TakesTextsAsTheyAre) {
  for (const char* text : {"a b", "'x: y'", "12", "no"}) EXPECT_THAT(refusal<std::string>(text), "no error");
  EXPECT_EQ(get("'x: y'", std::string()), "x: y");
  EXPECT_EQ(get("''", std::string("default")), "");
  EXPECT_THAT(refusal<std::string>("[a]"), HasSubstr("expected a text, found a list of 1"));
  EXPECT_THAT(refusal<std::string>("~"), HasSubstr("expected a text, found nothing"));
}

TEST(SectionRead, TakesListsOfTheLengthAsked) {
  using List = std::vector<double>;
  EXPECT_EQ(get("[1, 2, 3]", List{}), List({1, 2, 3}));
  EXPECT_EQ(get("[]", List{1}), List{});
  EXPECT_THAT(refusal<List>("3"), HasSubstr("v: expected a list of numbers, found \"3\""));
  EXPECT_THAT(refusal<List>("[1, 2]", 3), HasSubstr("v: expected a list of 3 numbers, found a list of 2"));
  EXPECT_THAT(refusal<List>("[1, [2]]"), HasSubstr("v[1]: expected a number, found a list of 1"));
  EXPECT_THAT(refusal<List>("[1, -2]", 0, kPositive),
              HasSubstr("v[1]: expected a number above 0, found \"-2\""));
}

TEST(SectionRead, TakesOneOfTheChoices) {
  enum class Colour { kRed, kBlue };
  Colour colour = Colour::kBlue;
  const auto read = [&](const std::string& text) {
    Section root = Section::parse(text, "run.yaml");
    root.read_choice("v", colour, {{"red", Colour::kRed}, {"blue", Colour::kBlue}});
    return root.resolved();
  };
  EXPECT_EQ(read(""), "v: blue\n");
  EXPECT_EQ(read("v: red\n"), "v: red\n");
  EXPECT_EQ(colour, Colour::kRed);
  EXPECT_EQ(config_error([&] { read("v: Red\n"); }),
            "run.yaml:1: v: expected one of red, blue, found \"Red\"");
  EXPECT_EQ(colour, Colour::kRed);
}

TEST(SectionRead, PathsAreRelativeToTheFileOrFromSetToTheWorkingDirectory) {
  EXPECT_EQ(get("targets/sharp.yaml", fs::path()), "/etc/perch/targets/sharp.yaml");
  EXPECT_EQ(get("../x.yaml", fs::path()), "/etc/x.yaml");
  EXPECT_EQ(get("/x.yaml", fs::path()), "/x.yaml");
  EXPECT_THAT(refusal<fs::path>("''"), HasSubstr("expected a path, found \"\""));
  EXPECT_THAT(refusal<fs::path>("[a]"), HasSubstr("expected a path, found a list of 1"));

  fs::path model;
  for (const char* set : {"camera.model=x.cameramodel", "camera={model: x.cameramodel}"}) {
    Section root = Section::parse("", "/etc/perch/run.yaml", {set});
    root.section("camera").read("model", model);
    EXPECT_EQ(model, fs::current_path() / "x.cameramodel") << set;
  }
}

TEST(SectionRead, SourcesThatAreFilesAreRelativeToTheFile) {
  const auto source = [](const std::string& text) {
    std::string value;
    Section root = Section::parse("v: " + text + "\n", "/etc/perch/run.yaml");
    root.read_source("v", value, {"flight", "images"});
    return value;
  };
  EXPECT_EQ(source("flight:flights/1"), "flight:/etc/perch/flights/1");
  EXPECT_EQ(source("images:/data/*.png"), "images:/data/*.png");
  EXPECT_EQ(source("gst:videotestsrc ! appsink"), "gst:videotestsrc ! appsink");
  EXPECT_EQ(source("v4l2:/dev/video0"), "v4l2:/dev/video0");
  for (const char* text : {"flight", ":x", "'flight:'", "[a]", "~"}) {
    EXPECT_THAT(config_error([&] { source(text); }), HasSubstr("v: expected a source, KIND:WHAT, found"))
        << text;
  }
}

TEST(SectionRead, TakesAPoseByAnglesByQuaternionOrAsIdentity) {
  const Rigid3 other{Eigen::Quaterniond(0, 1, 0, 0), {9, 9, 9}};
  const Rigid3 turned{Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)), {1, 2, 3}};
  EXPECT_THAT(get("identity", other), IsNearPose(Rigid3{}, 0.0, 0.0));
  EXPECT_THAT(get("{}", other), IsNearPose(Rigid3{}, 0.0, 0.0));
  EXPECT_THAT(get("{position: [1, 2, 3], rotation: {ypr_deg: [90, 0, 0]}}", other),
              IsNearPose(turned, 4 * kEpsilon, 0.0));
  // Written with three digits.
  EXPECT_THAT(get("{position: [1, 2, 3], rotation: {quaternion_wxyz: [0.707, 0, 0, 0.707]}}", other),
              IsNearPose(turned, 4 * kEpsilon, 0.0));
  EXPECT_THAT(get("{position: [1, 2, 3], rotation: {quaternion_wxyz: [-0.707, 0, 0, -0.707]}}", other),
              IsNearPose(turned, 4 * kEpsilon, 0.0));
  EXPECT_TRUE(get("identity", std::optional<Rigid3>()));
}

TEST(SectionRead, RefusesPosesThatAreNone) {
  const std::string place = "/etc/perch/run.yaml:1: v";
  EXPECT_THAT(refusal<Rigid3>("none"), StartsWith(place + ": expected identity or {position: "));
  EXPECT_THAT(refusal<Rigid3>("[1, 2, 3]"), HasSubstr("found a list of 3"));
  EXPECT_THAT(refusal<std::optional<Rigid3>>("~"), HasSubstr("found nothing"));
  EXPECT_THAT(refusal<Rigid3>("{position: [1, 2]}"),
              place + ".position: expected a list of 3 numbers, found a list of 2");
  EXPECT_THAT(refusal<Rigid3>("{rotation: {ypr_deg: [0, 0, .nan]}}"),
              StartsWith(place + ".rotation.ypr_deg[2]: "));
  EXPECT_THAT(refusal<Rigid3>("{rotation: {quaternion_wxyz: [1, 1, 0, 0]}}"),
              place + ".rotation.quaternion_wxyz: expected a quaternion of length 1, found a list of 4");
  EXPECT_THAT(refusal<Rigid3>("{rotation: {quaternion_wxyz: [0, 0, 0, 0]}}"), HasSubstr("of length 1"));
  EXPECT_THAT(refusal<Rigid3>("{rotation: {quaternion_wxyz: [1e200, 0, 0, 0]}}"), HasSubstr("of length 1"));
  EXPECT_THAT(refusal<Rigid3>("{rotation: {ypr_deg: [0, 0, 0], quaternion_wxyz: [1, 0, 0, 0]}}"),
              place + ".rotation: expected ypr_deg or quaternion_wxyz, found both");
  EXPECT_THAT(refusal<Rigid3>("{rotation: {rpy: [0, 0, 0]}}"), HasSubstr("v.rotation.rpy: expected one of "));
  EXPECT_THAT(refusal<Rigid3>("{positon: [0, 0, 0]}"),
              HasSubstr("v.positon: expected one of position, rotation"));
}

TEST(SectionRead, ARefusedPoseLeavesTheVariableAlone) {
  Rigid3 value{Eigen::Quaterniond(0, 1, 0, 0), {9, 9, 9}};
  Section root = Section::parse("v: {position: [1, 2, 3], rotation: {ypr_deg: [x, 0, 0]}}\n", "run.yaml");
  EXPECT_NE(config_error([&] { root.read("v", value); }), "no error");
  EXPECT_EQ(value.translation.x(), 9);
}

TEST(SectionRead, PosesComeBackFromTheResolvedFileBitForBit) {
  // A replay of the recorded configuration must give the live run's numbers.
  TestRng rng;
  for (int i = 0; i < 300; ++i) {
    const auto number = [&] { return std::to_string(rng.uniform(-360, 360)); };
    const std::string ypr = "[" + number() + ", " + number() + ", " + number() + "]";
    const auto read = [](const std::string& text, Rigid3& pose) {
      Section root = Section::parse(text, "run.yaml");
      root.read("v", pose);
      return root.resolved();
    };
    Rigid3 live, replayed;
    const std::string printed = read("v: {position: " + ypr + ", rotation: {ypr_deg: " + ypr + "}}\n", live);
    EXPECT_EQ(read(printed, replayed), printed);
    EXPECT_EQ(replayed.rotation.coeffs(), live.rotation.coeffs());
    EXPECT_EQ(replayed.translation, live.translation);
  }
}

TEST(SectionRead, ResolvedNumbersAreShortAndExact) {
  EXPECT_EQ(resolved(0.1), "v: 0.1\n");
  EXPECT_EQ(resolved(1e-9), "v: 1e-09\n");
  EXPECT_EQ(resolved(-2147483647), "v: -2147483647\n");
  EXPECT_EQ(resolved(std::vector<double>{0.1, 3}), "v: [0.1, 3]\n");
  EXPECT_EQ(resolved(std::vector<double>{}), "v: []\n");
  EXPECT_EQ(resolved(fs::path("/x/y.yaml")), "v: /x/y.yaml\n");
  TestRng rng;
  for (int i = 0; i < 1000; ++i) {
    const double value = std::ldexp(rng.normal(), rng.index(600) - 300);
    EXPECT_EQ(get(resolved(value).substr(3), 0.0), value);
  }
}

TEST(SectionRead, DefaultsThatMeanNotGivenAreNotPrinted) {
  const std::string nothing = "{}\n";
  EXPECT_EQ(resolved(fs::path()), nothing);
  EXPECT_EQ(resolved(kNan), nothing);
  EXPECT_EQ(resolved(0.0, kPositive), nothing);
  EXPECT_EQ(resolved(-1, kNotNegative), nothing);
  EXPECT_EQ(resolved(std::vector<double>{}, size_t{3}), nothing);
  EXPECT_EQ(resolved(std::optional<Rigid3>()), nothing);
}

TEST(SectionRead, TextsComeBackFromTheResolvedFile) {
  for (const char* text : {"",    "~",    "null", "true", "5", " x ", "a: b", "# c",      "- d", "---",
                           "...", "x\ny", "\t",   "\"",   "'", "[1",  "{",    "&a",       "*a",  "!t",
                           "%d",  "@e",   "`f",   "|",    ">", "? g", "g:",   "\xC3\xA4", "\x7f"}) {
    EXPECT_THAT(resolved(std::string(text)), Not(testing::IsEmpty()));
    EXPECT_EQ(get(resolved(std::string(text)).substr(3), std::string("default")), text);
  }
}

}  // namespace
}  // namespace perch
