#include "newest_frame.h"

#include <utility>

namespace perch {

bool NewestFrame::put(const LiveFrame& picture) {
  cv::Mat buffer = std::move(coming_.frame.grey);
  picture.frame.grey.copyTo(buffer);  // into what is allocated, when the size is the same
  coming_ = picture;
  coming_.frame.grey = std::move(buffer);

  std::unique_lock lock(mutex_);
  if (when_full_ == WhenFull::kWait) changed_.wait(lock, [&] { return !full_ || closed_; });
  if (closed_) return false;
  if (full_) ++replaced_;
  std::swap(coming_, held_);
  full_ = true;
  changed_.notify_all();
  return true;
}

bool NewestFrame::take(LiveFrame& picture, std::chrono::nanoseconds wait) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, wait, [&] { return full_ || closed_; });
  if (!full_) return false;
  std::swap(picture, held_);
  full_ = false;
  changed_.notify_all();
  return true;
}

void NewestFrame::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  changed_.notify_all();
}

bool NewestFrame::drained() const {
  const std::lock_guard lock(mutex_);
  return closed_ && !full_;
}

uint64_t NewestFrame::replaced() const {
  const std::lock_guard lock(mutex_);
  return replaced_;
}

}  // namespace perch
