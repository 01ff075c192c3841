#pragma once

#include <fcntl.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include "support/temp_folder.h"

namespace perch {

// A program that runs beside the test, in a folder; its output goes into files there.
class ChildProgram {
 public:
  ChildProgram(const TempFolder& folder, const std::string& program, std::vector<std::string> arguments)
      : folder_(folder) {
    arguments.insert(arguments.begin(), program);
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string path = folder.path().string();
    const std::string out = folder / ".out", err = folder / ".err";
    pid_ = fork();
    if (pid_ != 0) return;
    // Only what is safe between fork and exec.
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    if (chdir(path.c_str()) != 0 || dup2(open(out.c_str(), flags, 0644), 1) < 0 ||
        dup2(open(err.c_str(), flags, 0644), 2) < 0)
      _exit(126);
    execv(argv[0], argv.data());
    _exit(127);
  }
  ~ChildProgram() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  ChildProgram(const ChildProgram&) = delete;
  ChildProgram& operator=(const ChildProgram&) = delete;

  void signal(int number) const { kill(pid_, number); }
  std::string out() const { return read_file(folder_ / ".out"); }
  std::string err() const { return read_file(folder_ / ".err"); }
  // Whether it has said so within the time.
  bool says(const std::string& text, double seconds) const {
    for (int i = 0; i < static_cast<int>(seconds * 100); ++i) {
      if ((err() + out()).find(text) != std::string::npos) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }
  // Its exit code; -1: ended by a signal; -2: not within the time.
  int wait(double seconds) {
    for (int i = 0; i < static_cast<int>(seconds * 100); ++i) {
      int status = 0;
      if (waitpid(pid_, &status, WNOHANG) == pid_) {
        pid_ = -1;
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return -2;
  }
  int stop(double seconds = 60) {
    signal(SIGTERM);
    return wait(seconds);
  }

 private:
  const TempFolder& folder_;
  pid_t pid_ = -1;
};

}  // namespace perch
