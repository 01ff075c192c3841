#pragma once

#include <mutex>
#include <string>

namespace perch {

// How far a long work is, on stderr: a bar that renews itself on a terminal, a line for every quarter
// elsewhere.
class Progress {
 public:
  Progress();
  ~Progress();
  // `part` of `what` is done, 0 to 1. From any thread.
  void at(double part, const std::string& what);
  // A line of its own, above the bar. From any thread.
  void tell(const std::string& line);

 private:
  void end_line();

  std::mutex mutex_;
  bool terminal_;
  std::string what_;
  int told_ = -1;  // percent
};

}  // namespace perch
