#pragma once

#include <sys/wait.h>

#include <cstdlib>
#include <string>

#include "support/temp_folder.h"

namespace perch {

struct Outcome {
  int code = -1;  // -1: ended by a signal
  std::string out;
  std::string err;
};

// Runs a program in a folder, as a shell would.
inline Outcome run_program_in(const TempFolder& folder, const std::string& program,
                              const std::string& arguments) {
  const std::string command =
      "cd " + folder.path().string() + " && " + program + " " + arguments + " >.out 2>.err";
  const int status = std::system(command.c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, read_file(folder / ".out"),
          read_file(folder / ".err")};
}

}  // namespace perch
