#include "perch/config/section.h"

#include <fstream>

#include "support/config_error.h"

namespace perch {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// A configuration in the small, read as programs read theirs.
struct Settings {
  double rate = 30;
  int retries = 3;
  bool grey = true;
  std::string method = "edges";
  std::vector<double> gains{1, 2};
  std::vector<std::string> tags;
};

std::string read(Section root, Settings& run) {
  Section camera = root.section("camera");
  camera.read("rate", run.rate, kPositive);
  camera.read("retries", run.retries, Range{0, 10});
  camera.read("grey", run.grey);
  camera.done();
  Section detection = root.section("detection");
  detection.read("method", run.method);
  Section paper = detection.section("paper");
  paper.read("gains", run.gains, 2);
  paper.done();
  detection.done();
  for (Section tag : root.list("tags")) {
    run.tags.emplace_back("?");
    tag.read("name", run.tags.back());
    tag.done();
  }
  root.done();
  return root.resolved();
}

std::string error(const std::string& text, const std::vector<std::string>& overrides = {}) {
  Settings run;
  return config_error([&] { read(Section::parse(text, "run.yaml", overrides), run); });
}

TEST(Section, AnEmptyFileIsAllDefaults) {
  for (const char* text : {"", "# later\n", "camera:\n", "camera: {}\ndetection:\n  paper:\n", "tags:\n"}) {
    EXPECT_EQ(error(text), "no error") << text;
  }
  Settings run;
  read(Section::parse("", "run.yaml"), run);
  EXPECT_EQ(run.rate, 30);
  EXPECT_THAT(run.gains, ElementsAre(1, 2));
}

TEST(Section, ReadsWhatTheFileSays) {
  Settings run;
  read(Section::parse("camera: {rate: 25.5, grey: false}\ndetection:\n  paper: {gains: [-1, 1e3]}\n"
                      "tags:\n  - name: big\n  - {}\n",
                      "run.yaml"),
       run);
  EXPECT_EQ(run.rate, 25.5);
  EXPECT_FALSE(run.grey);
  EXPECT_EQ(run.retries, 3);
  EXPECT_THAT(run.gains, ElementsAre(-1, 1000));
  EXPECT_THAT(run.tags, ElementsAre("big", "?"));
}

TEST(Section, ErrorsNameFileLineKeyExpectationAndFinding) {
  EXPECT_EQ(error("camera:\n  # too\n  rate: fast\n"),
            "run.yaml:3: camera.rate: expected a number above 0, found \"fast\"");
  EXPECT_EQ(error("detection:\n  paper:\n    gains: [1, 2,\n      x]\n"),
            "run.yaml:3: detection.paper.gains: expected a list of 2 numbers, found a list of 3");
  EXPECT_EQ(error("detection:\n  paper:\n    gains: [1,\n      x]\n"),
            "run.yaml:4: detection.paper.gains[1]: expected a number, found \"x\"");
  EXPECT_EQ(error("tags:\n  - name: a\n  - 3\n"), "run.yaml:3: tags[1]: expected a mapping, found \"3\"");
  EXPECT_EQ(error("tags: {a: 1}\n"), "run.yaml:1: tags: expected a list of mappings, found a mapping");
  EXPECT_EQ(error("\ncamera: 3\n"), "run.yaml:2: camera: expected a mapping, found \"3\"");
  EXPECT_EQ(error("\njust text\n"), "run.yaml:2: expected a mapping, found \"just text\"");
  EXPECT_EQ(error("- 1\n- 2\n"), "run.yaml:1: expected a mapping, found a list of 2");
}

TEST(Section, AnEmptyValueIsReportedOnItsOwnLine) {
  // The parser's own mark would be that of the next key.
  EXPECT_EQ(error("camera:\n  rate:\n\n\n  grey: true\n"),
            "run.yaml:2: camera.rate: expected a number above 0, found nothing");
  EXPECT_EQ(error("tags:\n  - name: ~\n"), "run.yaml:2: tags[0].name: expected a text, found nothing");
}

TEST(Section, UnknownKeysAreRefusedWhereverTheyStand) {
  EXPECT_EQ(error("camera:\n  rate: 3\n  rade: 3\n"),
            "run.yaml:3: camera.rade: expected one of grey, rate, retries, found an unknown key");
  EXPECT_EQ(error("tags:\n  - name: a\n    nam: b\n"),
            "run.yaml:3: tags[0].nam: expected one of name, found an unknown key");
  EXPECT_THAT(error("Camera: {}\n"),
              HasSubstr("run.yaml:1: Camera: expected one of camera, detection, tags"));
  EXPECT_EQ(config_error([] { Section::parse("a: 1\n", "run.yaml").done(); }),
            "run.yaml:1: a: expected no keys, found an unknown key");
}

TEST(Section, OverridesWinOverTheFileAndTheDefaults) {
  Settings run;
  read(Section::parse("camera: {rate: 5}\n", "run.yaml",
                      {"camera.rate=6", "camera.rate=7", "detection.paper.gains=[3, 4]", "tags=[{name: x}]",
                       "detection.method=paper"}),
       run);
  EXPECT_EQ(run.rate, 7);
  EXPECT_THAT(run.gains, ElementsAre(3, 4));
  EXPECT_THAT(run.tags, ElementsAre("x"));
  EXPECT_EQ(run.method, "paper");
}

TEST(Section, OverridesOfTheWrongTypeOrKeyAreRefusedByTheirName) {
  EXPECT_EQ(error("camera: {rate: 5}\n", {"camera.rate=fast"}),
            "--set camera.rate: camera.rate: expected a number above 0, found \"fast\"");
  EXPECT_EQ(error("", {"camera={rate: fast}"}),
            "--set camera: camera.rate: expected a number above 0, found \"fast\"");
  EXPECT_EQ(error("", {"detection.paper.gains=[1, x]"}),
            "--set detection.paper.gains: detection.paper.gains[1]: expected a number, found \"x\"");
  EXPECT_EQ(error("", {"camera.rate="}),
            "--set camera.rate: camera.rate: expected a number above 0, found nothing");
  EXPECT_THAT(error("camera: {rate: 5}\n", {"camera.rade=5"}),
              testing::StartsWith("--set camera.rade: camera.rade: expected one of grey, rate"));
  EXPECT_THAT(error("", {"new.section=5"}), HasSubstr("run.yaml:1: new: expected one of camera"));
}

TEST(Section, FailPointsAtTheKeyOrAtItsSection) {
  const Section root = Section::parse("a: 1\ncamera:\n  rate: 3\nempty:\n", "run.yaml");
  const auto fail = [&](auto... what) { return config_error([&] { root.fail(what...); }); };
  EXPECT_EQ(fail("a", "a path"), "run.yaml:1: a: expected a path, found \"1\"");
  EXPECT_EQ(fail("target", "a path"), "run.yaml:1: target: expected a path, found nothing");
  EXPECT_EQ(fail("no two alike"), "run.yaml:1: no two alike");
  const Section camera = Section(root).section("camera");
  EXPECT_EQ(config_error([&] { camera.fail("model", "a path"); }),
            "run.yaml:2: camera.model: expected a path, found nothing");
  EXPECT_EQ(config_error([&] { camera.fail("wrong as a whole"); }), "run.yaml:2: camera: wrong as a whole");
  EXPECT_EQ(config_error([&] { Section(root).section("empty").fail("x", "a number"); }),
            "run.yaml:4: empty.x: expected a number, found nothing");
}

TEST(Section, AskingForAKeyMakesNone) {
  Section root = Section::parse("a: {b: 1}\n", "run.yaml");
  EXPECT_FALSE(root.has("b"));
  EXPECT_FALSE(root.is_mapping_with("c", "b"));
  EXPECT_TRUE(root.is_mapping_with("a", "b"));
  EXPECT_FALSE(root.is_mapping_with("a", "c"));
  root.section("missing");
  EXPECT_THAT(root.keys(), ElementsAre("a"));
}

TEST(Section, KeysComeInTheOrderOfTheFile) {
  EXPECT_THAT(Section::parse("z: 1\na: 1\n'3': 1\n", "run.yaml").keys(), ElementsAre("z", "a", "3"));
}

TEST(Section, ResolvedHasEveryDefaultAndIsItsOwnResolution) {
  const std::vector<std::string> texts{
      "", "camera: {rate: 0.1, grey: false}\ntags: [{name: 'true'}, {name: \"~\"}, {name: '# no'}]\n",
      "detection: {method: \"a: b\\n\\x01\\\"\", paper: {gains: [0.30000000000000004, 1e-300]}}\n"};
  for (const auto& text : texts) {
    Settings first, second;
    const std::string resolved = read(Section::parse(text, "run.yaml"), first);
    EXPECT_EQ(read(Section::parse(resolved, "elsewhere/run.yaml"), second), resolved);
    EXPECT_EQ(first.rate, second.rate);
    EXPECT_EQ(first.method, second.method);
    EXPECT_EQ(first.gains, second.gains);
    EXPECT_EQ(first.tags, second.tags);
  }
  Settings run;
  EXPECT_EQ(read(Section::parse("", "run.yaml"), run),
            "camera:\n  rate: 30\n  retries: 3\n  grey: true\ndetection:\n  method: edges\n  paper:\n"
            "    gains: [1, 2]\n");
}

TEST(Section, LoadNamesAFileThatCannotBeRead) {
  EXPECT_EQ(config_error([] { Section::load("no/such.yaml"); }),
            "no/such.yaml: expected a YAML file, found none that can be read");
  const std::string folder = testing::TempDir();
  EXPECT_EQ(config_error([&] { Section::load(folder); }),
            folder + ": expected a YAML file, found none that can be read");
}

TEST(Section, LoadReadsTheFile) {
  const std::string file = testing::TempDir() + "/perch_section_test.yaml";
  std::ofstream(file) << "rate: 3\n";
  double rate = 0;
  Section root = Section::load(file);
  root.read("rate", rate);
  EXPECT_EQ(rate, 3);
  EXPECT_EQ(root.file(), file);
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace perch
