#include "perch/flight/picture_recorder.h"

#include <stdexcept>

#include "perch/flight/background.h"

namespace perch {

PictureRecorder::PictureRecorder(Options options, std::unique_ptr<PictureSink> sink)
    : options_(std::move(options)), sink_(std::move(sink)), slots_(static_cast<size_t>(options_.slots)) {
  for (Slot& slot : slots_) slot.grey = cv::Mat::zeros(options_.size, CV_8UC1);  // not amid the flight
  thread_ = std::thread([this] { run(); });
}

PictureRecorder::~PictureRecorder() { close(); }

void PictureRecorder::close() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  changed_.notify_one();
  thread_.join();
  sink_.reset();
}

bool PictureRecorder::drop(const std::string& why) {
  ++dropped_;
  options_.complain(why);
  return false;
}

bool PictureRecorder::add(const Frame& frame) {
  if (last_ns_ && frame.timestamp_ns <= *last_ns_) {
    return drop("a frame not later than the one before it, which a recording cannot hold");
  }
  size_t end = 0;
  {
    const std::lock_guard lock(mutex_);
    if (count_ == slots_.size()) return drop("the disk does not keep up with the pictures");
    end = (begin_ + count_) % slots_.size();
  }
  // Only add() goes beyond the end of the ring, so the slot is ours without the lock.
  Slot& slot = slots_[end];
  slot.timestamp_ns = frame.timestamp_ns;
  if (frame.problem.empty() && frame.grey.type() == CV_8UC1 && !frame.grey.empty()) {
    frame.grey.copyTo(slot.grey);  // the source may use its memory again
  } else {
    slot.grey.release();
  }
  last_ns_ = frame.timestamp_ns;
  {
    const std::lock_guard lock(mutex_);
    ++count_;
  }
  changed_.notify_one();
  return true;
}

void PictureRecorder::run() {
  work_in_background();
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return count_ > 0 || stop_; });
    if (count_ == 0) return;
    const Slot& slot = slots_[begin_];
    lock.unlock();
    try {
      if (!options_.may_write()) throw std::runtime_error("too little is left on the disk for pictures");
      sink_->write(slot.timestamp_ns, slot.grey);
      ++written_;
    } catch (const std::exception& e) {
      drop(e.what());
    }
    lock.lock();
    begin_ = (begin_ + 1) % slots_.size();
    --count_;
  }
}

}  // namespace perch
