#pragma once

#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace perch {

// What every program of ours does alike:
//   --help, --version    to stdout, exit 0; --help lists the flags the program defined with gflags
//   exit 0               the work was done
//   exit 1               the work failed: any exception, "perch-NAME: what" on stderr
//   exit 2               bad usage or bad configuration: UsageError, ConfigError, an unknown flag, a bad
//   value
// Flags are --name=value, --name value, --name and --noname for bools, anywhere among the arguments; -- ends
// them. The log goes to stderr, warnings and worse only (--minloglevel=0 for all).
//
//   int main(int argc, char** argv) {
//     return perch::run_program(argc, argv, {"perch-target", "TARGET.yaml --output pad.pdf", "Draws ..."},
//     run);
//   }

// Bad usage: prints "perch-NAME: what" and points at --help.
class UsageError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct Program {
  std::string name;         // perch-target
  std::string synopsis;     // what follows the name: "TARGET.yaml --output pad.pdf [flags]"
  std::string description;  // the rest of --help above the flags, lines of at most 100 characters
};

struct CommandLine {
  std::vector<std::string> arguments;  // what is no flag, in its order
  // Every value of a flag that was given, in its order: gflags itself keeps the last one only, which is not
  // enough for --set.
  std::map<std::string, std::vector<std::string>> given;

  std::vector<std::string> all(const std::string& flag) const;
};

int run_program(int argc, char** argv, const Program& program,
                const std::function<int(const CommandLine&)>& work);

}  // namespace perch
