#include "perch/flight/picture_recorder.h"

#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "perch/flight/background.h"

namespace perch {

namespace fs = std::filesystem;

PictureRecorder::PictureRecorder(Options options, RecordingDisk& disk)
    : options_(std::move(options)), disk_(disk), slots_(static_cast<size_t>(options_.slots)) {
  fs::create_directories(options_.cam0 / "data");
  rows_ = disk_.create(options_.cam0 / "data.csv");
  rows_->append("#timestamp [ns],filename\n");
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
      write(slot);
      ++written_;
    } catch (const std::exception& e) {
      drop(e.what());
    }
    lock.lock();
    begin_ = (begin_ + 1) % slots_.size();
    --count_;
  }
}

void PictureRecorder::write(const Slot& slot) {
  if (!options_.may_write()) throw std::runtime_error("too little is left on the disk for pictures");
  const std::string name = std::to_string(slot.timestamp_ns) + ".png";
  if (!slot.grey.empty()) {
    // Noise does not compress: the fastest level costs 3 % of space.
    if (!cv::imencode(".png", slot.grey, encoded_, {cv::IMWRITE_PNG_COMPRESSION, 1})) {
      throw std::runtime_error(name + ": cannot be encoded");
    }
    const fs::path file = options_.cam0 / "data" / name;
    try {
      disk_.create(file)->append({reinterpret_cast<const char*>(encoded_.data()), encoded_.size()});
    } catch (const std::exception&) {
      std::error_code ignored;
      fs::remove(file, ignored);
      throw;
    }
  }
  rows_->append(std::to_string(slot.timestamp_ns) + "," + name + "\n");
}

}  // namespace perch
