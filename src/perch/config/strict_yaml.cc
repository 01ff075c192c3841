#include "perch/config/strict_yaml.h"

#include <yaml-cpp/anchor.h>
#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <functional>
#include <sstream>
#include <string_view>

namespace perch {
namespace {

// Deeper than any configuration; recursion over the tree is then safe.
constexpr int kMaxDepth = 32;

// Throws ConfigError: of a line (from 0) and what is wrong there.
using Refuse = std::function<void(int line, const std::string& what)>;

// The length of the UTF-8 character that `text` begins with; 0 where it is none, or a control character that
// no editor writes (yaml-cpp would take some of them for the end of the file).
size_t character_length(std::string_view text) {
  const auto byte = [&](size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const unsigned first = byte(0);
  if (first < 0x80) {
    return first >= 0x20 || first == '\t' || first == '\n' || first == '\r' ? 1 : 0;
  }
  const size_t length = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4) return 0;
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  const bool overlong = (first == 0xe0 && byte(1) < 0xa0) || (first == 0xf0 && byte(1) < 0x90);
  const bool no_character = (first == 0xed && byte(1) > 0x9f) || (first == 0xf4 && byte(1) > 0x8f);
  return overlong || no_character ? 0 : length;
}

void refuse_other_than_text(std::string_view text, const Refuse& refuse) {
  int line = 0;
  for (size_t at = 0; at < text.size();) {
    const size_t length = character_length(text.substr(at));
    if (length == 0) {
      std::ostringstream byte;
      byte << "expected UTF-8 text, found the byte 0x" << std::hex << (0xff & text[at]);
      refuse(line, byte.str());
    }
    if (text[at] == '\n') ++line;
    at += length;
  }
}

// Looks at the document before a tree is built of it.
class Sentry : public YAML::EventHandler {
 public:
  explicit Sentry(const Refuse& refuse) : refuse_(refuse) {}

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ > 1) refuse_(mark.line, "expected one document, found a second");
  }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override { check(mark, anchor); }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t anchor) override { check(mark, anchor); }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                const std::string&) override {
    check(mark, anchor);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    check(mark, anchor);
    deeper(mark);
  }
  void OnSequenceEnd() override { --depth_; }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    check(mark, anchor);
    deeper(mark);
  }
  void OnMapEnd() override { --depth_; }

 private:
  void check(const YAML::Mark& mark, YAML::anchor_t anchor) {
    if (anchor != 0) refuse_(mark.line, "expected values written out, found an anchor or an alias (& or *)");
  }
  void deeper(const YAML::Mark& mark) {
    if (++depth_ > kMaxDepth) {
      refuse_(mark.line, "expected at most " + std::to_string(kMaxDepth) + " levels, found more");
    }
  }

  const Refuse& refuse_;
  int documents_ = 0;
  int depth_ = 0;
};

// yaml-cpp takes the last of two equal keys in silence: an edit that was meant to count would not.
void refuse_bad_keys(const YAML::Node& node, const std::string& path, const Refuse& refuse) {
  if (node.IsSequence()) {
    for (size_t i = 0; i < node.size(); ++i) {
      refuse_bad_keys(node[i], path + "[" + std::to_string(i) + "]", refuse);
    }
  }
  if (!node.IsMap()) return;
  std::set<std::string> seen;
  for (const auto& entry : node) {
    const int line = entry.first.Mark().line;
    if (!entry.first.IsScalar() || entry.first.Scalar().empty()) {
      refuse(line, (path.empty() ? "" : path + ": ") + "expected a name as key, found " + found(entry.first));
    }
    const std::string& name = entry.first.Scalar();
    const std::string key = path.empty() ? name : path + "." + name;
    if (!seen.insert(name).second) refuse(line, key + ": expected each key once, found it twice");
    refuse_bad_keys(entry.second, key, refuse);
  }
}

YAML::Node parse(const std::string& text, const Refuse& refuse) {
  refuse_other_than_text(text, refuse);
  YAML::Node root;
  try {
    // Without the line end at its end: yaml-cpp takes it for the closing quote of a text that has none, and
    // all keys after the opening one would be part of that text.
    std::istringstream stream(text.substr(0, text.find_last_not_of("\r\n \t") + 1));
    YAML::Parser parser(stream);
    Sentry sentry(refuse);
    while (parser.HandleNextDocument(sentry)) {
    }
    root.reset(YAML::Load(text));
  } catch (const YAML::Exception& e) {
    refuse(std::max(e.mark.line, 0), "expected YAML, found " + e.msg);
  }
  refuse_bad_keys(root, "", refuse);
  return root;
}

}  // namespace

YAML::Node strict_yaml(const std::string& text, const std::filesystem::path& file) {
  return parse(text, [&](int line, const std::string& what) {
    throw ConfigError(file.string() + ":" + std::to_string(line + 1) + ": " + what);
  });
}

std::string override_yaml(const YAML::Node& root, const std::string& key_path_equals_value) {
  const auto refuse = [&](int, const std::string& what) {
    throw ConfigError("--set " + key_path_equals_value + ": " + what);
  };
  const size_t equals = key_path_equals_value.find('=');
  if (equals == std::string::npos) refuse(0, "expected key.path=value, found no =");
  std::string path = key_path_equals_value.substr(0, equals);
  const YAML::Node value = parse(key_path_equals_value.substr(equals + 1), refuse);

  YAML::Node node = root;
  for (size_t begin = 0; begin <= path.size();) {
    const size_t end = std::min(path.find('.', begin), path.size());
    const std::string part = path.substr(begin, end - begin);
    if (part.empty()) refuse(0, "expected key.path=value, found an empty key");
    if (node.IsDefined() && !node.IsNull() && !node.IsMap()) {
      refuse(0, path.substr(0, begin - 1) + ": expected a mapping, found " + found(node));
    }
    node.reset(node[part]);
    begin = end + 1;
  }
  node = value;
  return path;
}

std::string found(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "nothing";
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list of " + std::to_string(node.size());
  constexpr size_t kLongest = 60;
  std::string text = node.Scalar();
  const size_t line_end = text.find_first_of("\r\n");
  if (line_end == std::string::npos && text.size() <= kLongest) return '"' + text + '"';
  size_t cut = std::min(line_end, kLongest);
  while (cut > 0 && (text[cut] & 0xc0) == 0x80) --cut;  // not in the middle of a character
  return '"' + text.substr(0, cut) + "...\"";
}

}  // namespace perch
