#include "progress.h"

#include <unistd.h>

#include <algorithm>
#include <iostream>

namespace perch {

Progress::Progress() : terminal_(isatty(STDERR_FILENO) == 1) {}
Progress::~Progress() { end_line(); }

void Progress::end_line() {
  if (terminal_ && told_ >= 0) std::cerr << '\n';
  told_ = -1;
}

void Progress::tell(const std::string& line) {
  const std::lock_guard lock(mutex_);
  if (terminal_ && told_ >= 0) {
    std::cerr << "\r\033[K";
    told_ = -1;  // the bar is drawn anew
  }
  std::cerr << line << std::endl;
}

void Progress::at(double part, const std::string& what) {
  const std::lock_guard lock(mutex_);
  if (what != what_) {
    end_line();
    what_ = what;
  }
  constexpr int kWidth = 30;
  const int percent = static_cast<int>(100 * std::clamp(part, 0.0, 1.0));
  const int step = terminal_ ? 1 : 25;
  if (told_ >= 0 && percent / step <= told_ / step) return;
  told_ = percent;
  if (!terminal_) {
    std::cerr << what << ": " << percent << " %\n";
    return;
  }
  const auto full = static_cast<size_t>(percent * kWidth / 100);
  std::cerr << "\r[" << std::string(full, '#') << std::string(kWidth - full, '.') << "] " << percent << " % "
            << what << std::flush;
}

}  // namespace perch
