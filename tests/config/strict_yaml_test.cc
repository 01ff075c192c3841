#include "perch/config/strict_yaml.h"

#include <chrono>

#include "support/config_error.h"
#include "support/rng.h"

namespace perch {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::StartsWith;

YAML::Node yaml(const std::string& text) { return strict_yaml(text, "run.yaml"); }
std::string error(const std::string& text) {
  return config_error([&] { yaml(text); });
}

TEST(StrictYaml, TakesWindowsLineEndsAByteOrderMarkAndUtf8) {
  EXPECT_EQ(yaml("\xEF\xBB\xBF"
                 "a: 1\r\nname: Stra\xC3\x9F"
                 "e\r\n")["name"]
                .Scalar(),
            "Stra\xC3\x9F"
            "e");
  EXPECT_EQ(yaml("drone: \xF0\x9F\x9A\x81\n")["drone"].Scalar(), "\xF0\x9F\x9A\x81");
}

TEST(StrictYaml, TakesAnEmptyFileACommentOrADocumentMark) {
  for (const char* text : {"", "\n\n", "# nothing yet\n", "---\n", "\xEF\xBB\xBF"}) {
    EXPECT_TRUE(yaml(text).IsNull()) << text;
  }
  EXPECT_EQ(yaml("%YAML 1.2\n---\na: 1\n...\n")["a"].Scalar(), "1");
}

TEST(StrictYaml, NamesTheLineOfBrokenYaml) {
  EXPECT_THAT(error("a: 1\nb: [1, 2\n"), StartsWith("run.yaml:2: expected YAML, found "));
  EXPECT_THAT(error("a: 1\nb: c: d\n"), StartsWith("run.yaml:2: expected YAML, found "));
  EXPECT_THAT(error("a:\n\tb: 1\n"), StartsWith("run.yaml:2: expected YAML, found "));
}

TEST(StrictYaml, RefusesAQuoteThatIsNeverClosed) {
  // Left alone, yaml-cpp makes all keys after it part of the text.
  EXPECT_EQ(error("a: \"open\n"), "run.yaml:1: expected YAML, found illegal EOF in scalar");
  EXPECT_THAT(error("a: 'open\nb: 1\n\n"), EndsWith("expected YAML, found illegal EOF in scalar"));
  EXPECT_EQ(yaml("a: |\n  text\n")["a"].Scalar(), "text\n");
}

TEST(StrictYaml, RefusesBytesThatAreNoText) {
  EXPECT_EQ(error("a: 1\nb: 20\xB0\n"), "run.yaml:2: expected UTF-8 text, found the byte 0xb0");
  EXPECT_EQ(error(std::string("a: 1\0", 5)), "run.yaml:1: expected UTF-8 text, found the byte 0x0");
  // yaml-cpp takes 4 for the end of the file and drops the rest.
  EXPECT_EQ(error("a: 1\n\x04\nb: 2\n"), "run.yaml:2: expected UTF-8 text, found the byte 0x4");
  for (const char* bad :
       {"\xC0\xAF", "\xE0\x80\x80", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xC3", "\x80", "\xFF\xFE"}) {
    EXPECT_THAT(error(bad), StartsWith("run.yaml:1: expected UTF-8 text")) << bad;
  }
}

TEST(StrictYaml, RefusesAKeyGivenTwice) {
  EXPECT_EQ(error("a: 1\nb: 2\na: 3\n"), "run.yaml:3: a: expected each key once, found it twice");
  EXPECT_EQ(error("a:\n  - {x: 1}\n  - {x: 1, x: 2}\n"),
            "run.yaml:3: a[1].x: expected each key once, found it twice");
  EXPECT_EQ(error("a:\n  b:\n    c: 1\n    \"c\": 1\n"),
            "run.yaml:4: a.b.c: expected each key once, found it twice");
}

TEST(StrictYaml, RefusesKeysThatAreNoNames) {
  EXPECT_EQ(error("a:\n  [1, 2]: 3\n"), "run.yaml:2: a: expected a name as key, found a list of 2");
  EXPECT_EQ(error("~: 3\n"), "run.yaml:1: expected a name as key, found nothing");
  EXPECT_EQ(error("'': 3\n"), "run.yaml:1: expected a name as key, found \"\"");
}

TEST(StrictYaml, RefusesASecondDocument) {
  EXPECT_EQ(error("a: 1\n---\nb: 2\n"), "run.yaml:2: expected one document, found a second");
}

TEST(StrictYaml, RefusesAnchorsAliasesAndMergeKeys) {
  const char* expected = "expected values written out, found an anchor or an alias (& or *)";
  EXPECT_EQ(error("a: 1\nb: &x {c: 1}\n"), std::string("run.yaml:2: ") + expected);
  EXPECT_THAT(error("a: &x 1\nb: *x\n"), EndsWith(expected));
  EXPECT_THAT(error("a: &x {c: 1}\nb:\n  <<: *x\n"), EndsWith(expected));
  EXPECT_THAT(error("a: *nobody\n"), StartsWith("run.yaml:1: expected YAML, found "));
}

TEST(StrictYaml, RefusesBombsAtOnce) {
  const auto start = std::chrono::steady_clock::now();
  std::string laughs = "a0: &a0 [lol, lol]\n";
  for (int i = 1; i < 60; ++i) {
    const std::string n = std::to_string(i), below = "*a" + std::to_string(i - 1);
    laughs += "a" + n + ": &a" + n + " [" + below + ", " + below + "]\n";
  }
  EXPECT_THAT(error(laughs), HasSubstr("found an anchor"));

  std::string nested;
  for (int i = 0; i < 2000; ++i) nested += std::string(static_cast<size_t>(i), ' ') + "a:\n";
  EXPECT_EQ(error(nested), "run.yaml:33: expected at most 32 levels, found more");
  EXPECT_THAT(error(std::string(100000, '[')), HasSubstr("expected at most 32 levels"));
  EXPECT_THAT(error("a: " + std::string(100000, '{')), StartsWith("run.yaml:1: expected "));
  EXPECT_THAT(error(std::string(100000, '-')), StartsWith("no error"));  // one long text
  EXPECT_THAT(error("- " + std::string(100000, '?')), StartsWith("no error"));
  // Seconds where each takes milliseconds: a busy machine must not fail this, an endless loop must.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

TEST(StrictYaml, AnswersEveryFileOfRandomPunctuation) {
  // Nothing but a ConfigError may come out of any text. The characters are those that mean something in YAML.
  TestRng rng;
  const std::string alphabet = "ab1 \n\n:::---[]{},,&*!|>'\"%@`#?\t~.\\\r<=";
  int refused = 0;
  for (int i = 0; i < 5000; ++i) {
    std::string text;
    for (int length = rng.index(40); length >= 0; --length) {
      text += alphabet[static_cast<size_t>(rng.index(static_cast<int>(alphabet.size())))];
    }
    if (error(text) != "no error") ++refused;
  }
  EXPECT_GT(refused, 1000);
}

TEST(StrictYaml, OverrideSetsANestedValueAndMakesTheWayThere) {
  YAML::Node root = yaml("a: {b: 1, c: 2}\n");
  EXPECT_EQ(override_yaml(root, "a.b=[3, 4]"), "a.b");
  override_yaml(root, "x.y.z=text with spaces");
  override_yaml(root, "url=mavlink+serial:/dev/ttyAMA0:921600");
  override_yaml(root, "equals=a=b");
  EXPECT_EQ(root["a"]["b"][1].Scalar(), "4");
  EXPECT_EQ(root["a"]["c"].Scalar(), "2");
  EXPECT_EQ(root["x"]["y"]["z"].Scalar(), "text with spaces");
  EXPECT_EQ(root["url"].Scalar(), "mavlink+serial:/dev/ttyAMA0:921600");
  EXPECT_EQ(root["equals"].Scalar(), "a=b");
}

TEST(StrictYaml, OverrideFillsASectionThatIsEmptyInTheFile) {
  YAML::Node root = yaml("a:\n");
  override_yaml(root, "a.b=1");
  EXPECT_EQ(root["a"]["b"].Scalar(), "1");
}

TEST(StrictYaml, OverrideNamesWhatIsWrong) {
  const auto refused = [](const std::string& text) {
    YAML::Node root = yaml("rate: 3\nlist: [1, 2]\n");
    return config_error([&] { override_yaml(root, text); });
  };
  EXPECT_EQ(refused("rate"), "--set rate: expected key.path=value, found no =");
  for (const char* text : {"=3", ".rate=3", "rate.=3", "a..b=3"}) {
    EXPECT_EQ(refused(text), std::string("--set ") + text + ": expected key.path=value, found an empty key");
  }
  EXPECT_EQ(refused("rate.hz=3"), "--set rate.hz=3: rate: expected a mapping, found \"3\"");
  EXPECT_EQ(refused("list.0=3"), "--set list.0=3: list: expected a mapping, found a list of 2");
  EXPECT_THAT(refused("a=[1"), StartsWith("--set a=[1: expected YAML, found "));
  EXPECT_EQ(refused("a={b: 1, b: 2}"), "--set a={b: 1, b: 2}: b: expected each key once, found it twice");
}

TEST(StrictYaml, FoundStaysOnOneShortLine) {
  EXPECT_EQ(found(yaml("a")), "\"a\"");
  EXPECT_EQ(found(yaml("|\n  one\n  two\n")), "\"one...\"");
  EXPECT_EQ(found(yaml(std::string(1000, 'x'))), '"' + std::string(60, 'x') + "...\"");
  std::string umlauts;  // two bytes each, from an odd place
  for (int i = 0; i < 100; ++i) umlauts += "\xC3\xA4";
  EXPECT_EQ(found(yaml("x" + umlauts)), "\"x" + umlauts.substr(0, 58) + "...\"");
}

}  // namespace
}  // namespace perch
