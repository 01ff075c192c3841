#include "perch/flight/append_log.h"

namespace perch {

AppendLog::AppendLog(RecordingDisk& disk, std::filesystem::path file, std::string header,
                     size_t most_waiting_bytes)
    : disk_(disk),
      path_(std::move(file)),
      header_(std::move(header)),
      most_waiting_bytes_(most_waiting_bytes) {}

bool AppendLog::add(std::string_view row) {
  const std::lock_guard lock(mutex_);
  if (waiting_.size() + row.size() > most_waiting_bytes_) return false;
  waiting_ += row;
  return true;
}

void AppendLog::create() {
  if (file_) return;
  auto file = disk_.create(path_);
  file->append(header_);
  file_ = std::move(file);
}

void AppendLog::write() {
  // Twice: what the disk refused the last time, and what has come since.
  for (int i = 0; i < 2; ++i) {
    if (writing_.empty()) {
      const std::lock_guard lock(mutex_);
      writing_.swap(waiting_);
    }
    if (writing_.empty()) return;
    create();
    file_->append(writing_);
    writing_.clear();
  }
}

}  // namespace perch
