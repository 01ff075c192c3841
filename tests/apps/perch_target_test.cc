#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "support/run_program.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class PerchTarget : public testing::Test {
 protected:
  Outcome run(const std::string& arguments) const { return run_program_in(folder_, PERCH_TARGET, arguments); }
  const std::string sharp_ = std::string(PERCH_SOURCE_DIR) + "/configs/targets/sharp.yaml";
  TempFolder folder_;
};

TEST_F(PerchTarget, DrawsAPdfAndSaysItsName) {
  const Outcome result = run(sharp_ + " --output pad.pdf");
  EXPECT_EQ(result.code, 0);
  EXPECT_EQ(result.out, "pad.pdf\n");
  EXPECT_EQ(result.err, "");
  EXPECT_THAT(read_file(folder_ / "pad.pdf"), StartsWith("%PDF-"));
}

TEST_F(PerchTarget, TakesFlagsInEveryUsualSpelling) {
  EXPECT_EQ(run("--output=a.svg " + sharp_ + " -paper a3 --nobare").out.substr(0, 15), "a-overview.svg\n");
  EXPECT_EQ(run("--dpi 20 --bare --output b.png -- " + sharp_).out, "b.png\n");
  EXPECT_EQ(run("--paper letter --output c.pdf " + sharp_).code, 0);
}

TEST_F(PerchTarget, HelpListsItsOwnFlagsOnStdout) {
  for (const char* flag : {"--help", "-h", "-help"}) {
    const Outcome result = run(flag);
    EXPECT_EQ(result.code, 0);
    EXPECT_EQ(result.err, "");
    EXPECT_THAT(result.out, StartsWith("usage: perch-target TARGET.yaml --output pad.pdf"));
    EXPECT_THAT(result.out, HasSubstr("--paper TEXT"));
    EXPECT_THAT(result.out, Not(HasSubstr("flagfile")));  // gflags' own
    EXPECT_THAT(result.out, Not(HasSubstr("logtostderr")));
  }
}

TEST_F(PerchTarget, VersionIsOneLine) {
  const Outcome result = run("--version");
  EXPECT_EQ(result.code, 0);
  EXPECT_THAT(result.out, testing::MatchesRegex("perch-target [0-9]+\\.[0-9]+\\.[0-9]+\n"));
}

TEST_F(PerchTarget, BadUsageIsExitCode2AndSaysWhatIsWrong) {
  const auto expect_usage = [&](const std::string& arguments, const std::string& message) {
    const Outcome result = run(arguments);
    EXPECT_EQ(result.code, 2) << arguments;
    EXPECT_EQ(result.out, "") << arguments;
    EXPECT_THAT(result.err, StartsWith("perch-target: " + message + "\nusage: perch-target "));
    EXPECT_THAT(result.err, EndsWith("more with --help\n"));
  };
  expect_usage("", "expected one TARGET.yaml, found 0");
  expect_usage(sharp_ + " " + sharp_ + " --output pad.pdf", "expected one TARGET.yaml, found 2");
  expect_usage(sharp_, "--output: expected a file to write, found nothing");
  expect_usage(sharp_ + " --output", "--output: expected a text, found nothing");
  expect_usage(sharp_ + " --output pad.pdf --papre a4", "unknown flag --papre");
  expect_usage(sharp_ + " --output pad.pdf --nopaper", "unknown flag --nopaper");
  expect_usage(sharp_ + " --output pad.pdf --paper a5",
               "--paper: expected a4, a3, letter or none, found \"a5\"");
  expect_usage(sharp_ + " --output pad.png --dpi many", "--dpi: expected a number, found \"many\"");
  expect_usage(sharp_ + " --output pad.png --dpi nan", "--dpi: expected 10 to 4800");
  expect_usage(sharp_ + " --output pad.jpg", "pad.jpg: expected a name ending in .pdf, .svg or .png");
  expect_usage(sharp_ + " --output pad.pdf --bare --paper a4", "--bare: a bare target has no paper");
}

TEST_F(PerchTarget, ABadTargetIsExitCode2WithItsPlace) {
  folder_.write("pad.yaml", "size: 1\nmodules: 20\nborder: 11\n");
  Outcome result = run("pad.yaml --output pad.pdf");
  EXPECT_EQ(result.code, 2);
  EXPECT_EQ(
      result.err,
      "perch-target: pad.yaml:3: border: expected less than half of the 20 modules, to leave an interior, "
      "found \"11\"\n");
  EXPECT_FALSE(fs::exists(folder_ / "pad.pdf"));
  result = run("none.yaml --output pad.pdf");
  EXPECT_EQ(result.code, 2);
  EXPECT_EQ(result.err, "perch-target: none.yaml: expected a YAML file, found none that can be read\n");
}

TEST_F(PerchTarget, AnOutputThatCannotBeWrittenIsExitCode1) {
  const Outcome result = run(sharp_ + " --output none/pad.pdf");
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.err, "perch-target: none/pad.pdf: cannot be written: No such file or directory\n");
}

TEST_F(PerchTarget, AnswersThatCannotBePrintedAreExitCode1) {
  EXPECT_EQ(run(sharp_ + " --output pad.svg >/dev/full; exit $? #").code, 1);
}

}  // namespace
}  // namespace perch
