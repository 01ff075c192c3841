#include "program.h"

#include <gflags/gflags.h>
#include <glog/logging.h>

#include <algorithm>
#include <iostream>
#include <optional>
#include <string_view>

#include "perch/config/section.h"

namespace perch {
namespace {

// A flag of the command line: its name, and its value where that came with "=".
struct FlagText {
  std::string name;
  std::optional<std::string> value;
};

std::optional<FlagText> parse_flag(std::string_view text) {
  if (text.size() < 2 || text[0] != '-') return std::nullopt;  // "-" is a file name: stdin
  text.remove_prefix(text[1] == '-' ? 2 : 1);
  const size_t equals = text.find('=');
  if (equals == std::string_view::npos) return FlagText{std::string(text), std::nullopt};
  return FlagText{std::string(text.substr(0, equals)), std::string(text.substr(equals + 1))};
}

bool look_up(const std::string& name, gflags::CommandLineFlagInfo& info) {
  return gflags::GetCommandLineFlagInfo(name.c_str(), &info);
}

std::string kind_of(const gflags::CommandLineFlagInfo& info) {
  if (info.type == "bool") return "true or false";
  if (info.type == "string") return "a text";
  return info.type == "double" ? "a number" : "a whole number";
}

// Hands the flags to gflags one by one: its own parser prints and exits by itself, with code 1.
CommandLine parse(int argc, char** argv) {
  CommandLine line;
  bool flags_end = false;
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    auto flag = flags_end ? std::nullopt : parse_flag(text);
    if (!flag) {
      line.arguments.push_back(text);
      continue;
    }
    if (text == "--") {
      flags_end = true;
      continue;
    }
    std::replace(flag->name.begin(), flag->name.end(), '-', '_');  // --print-config is FLAGS_print_config
    gflags::CommandLineFlagInfo info;
    if (!look_up(flag->name, info)) {
      const bool no = flag->name.starts_with("no") && !flag->value && look_up(flag->name.substr(2), info);
      if (!no || info.type != "bool") throw UsageError("unknown flag " + text);
      flag = FlagText{flag->name.substr(2), "false"};
    }
    if (!flag->value) {
      if (info.type == "bool") {
        flag->value = "true";
      } else if (i + 1 < argc) {
        flag->value = argv[++i];
      } else {
        throw UsageError(text + ": expected " + kind_of(info) + ", found nothing");
      }
    }
    if (gflags::SetCommandLineOption(flag->name.c_str(), flag->value->c_str()).empty()) {
      throw UsageError("--" + flag->name + ": expected " + kind_of(info) + ", found \"" + *flag->value + '"');
    }
    line.given[flag->name].push_back(*flag->value);
  }
  return line;
}

// The flags that our own sources define; those of gflags and glog would bury them.
std::vector<gflags::CommandLineFlagInfo> own_flags() {
  std::string root = __FILE__;
  root.resize(root.size() - std::string_view("src/apps/program.cc").size());
  std::vector<gflags::CommandLineFlagInfo> flags;
  gflags::GetAllFlags(&flags);
  std::erase_if(flags, [&](const auto& flag) { return !flag.filename.starts_with(root); });
  return flags;
}

void print_help(const Program& program) {
  std::cout << "usage: " << program.name << ' ' << program.synopsis << "\n\n"
            << program.description << "\n\nFlags:\n";
  const auto print_flag = [](std::string name, const std::string& text) {
    name.resize(std::max<size_t>(name.size() + 1, 20), ' ');
    std::cout << "  " << name << text << '\n';
  };
  for (const auto& flag : own_flags()) {
    std::string name = "--" + flag.name;
    std::replace(name.begin(), name.end(), '_', '-');
    if (flag.type == "string") name += " TEXT";
    if (flag.type != "string" && flag.type != "bool") name += " N";
    const bool plain = flag.default_value.empty() || flag.type == "bool";
    print_flag(name, flag.description + (plain ? "" : " (default " + flag.default_value + ")"));
  }
  print_flag("--help", "this text");
  print_flag("--version", "the version");
}

// What was printed counts as work: a full disk behind stdout is a failure.
int flushed(int code) {
  std::cout.flush();
  if (!std::cout) throw std::runtime_error("standard output: cannot be written");
  return code;
}

bool asks_for(int argc, char** argv, std::initializer_list<std::string_view> names) {
  for (int i = 1; i < argc && std::string_view(argv[i]) != "--"; ++i) {
    if (std::find(names.begin(), names.end(), argv[i]) != names.end()) return true;
  }
  return false;
}

}  // namespace

std::vector<std::string> CommandLine::all(const std::string& flag) const {
  const auto it = given.find(flag);
  return it == given.end() ? std::vector<std::string>{} : it->second;
}

int run_program(int argc, char** argv, const Program& program,
                const std::function<int(const CommandLine&)>& work) {
  // Not into files of /tmp, which is glog's default.
  FLAGS_logtostderr = true;
  FLAGS_minloglevel = google::GLOG_WARNING;
  google::InitGoogleLogging(program.name.c_str());
  const auto print_error = [&](const std::string& what) {
    std::cerr << program.name << ": " << what << '\n';
  };
  try {
    if (asks_for(argc, argv, {"--help", "-help", "-h"})) {
      print_help(program);
      return flushed(0);
    }
    if (asks_for(argc, argv, {"--version", "-version"})) {
      std::cout << program.name << ' ' << PERCH_VERSION << '\n';
      return flushed(0);
    }
    return flushed(work(parse(argc, argv)));
  } catch (const UsageError& e) {
    print_error(e.what());
    std::cerr << "usage: " << program.name << ' ' << program.synopsis << "; more with --help\n";
    return 2;
  } catch (const ConfigError& e) {
    print_error(e.what());
    return 2;
  } catch (const std::exception& e) {
    print_error(e.what());
    return 1;
  }
}

}  // namespace perch
