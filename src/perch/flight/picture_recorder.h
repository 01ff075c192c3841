#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "perch/camera/image_source.h"
#include "perch/flight/picture_sink.h"

namespace perch {

// The pictures of a flight that goes on, written by a thread of its own:
//
//   add: copies into a free slot, or drops --> slots, a ring --> thread: PictureSink
//
// Whenever the process ends, each row of data.csv has its picture whole.
class PictureRecorder {
 public:
  struct Options {
    int slots = 30;
    cv::Size size;                                     // of the pictures to expect
    std::function<bool()> may_write;                   // false: too little is left on the disk
    std::function<void(const std::string&)> complain;  // from any thread
  };
  PictureRecorder(Options options, std::unique_ptr<PictureSink> sink);
  ~PictureRecorder();  // closes
  // Writes what was accepted and waits for that. No add() afterwards.
  void close();

  // One caller at a time; waits for nothing. A frame without a picture keeps its row, so that it is
  // unreadable in a replay, too. False: dropped, since the disk does not keep up, or the clock went back,
  // which data.csv cannot say.
  bool add(const Frame& frame);

  int64_t written() const { return written_; }
  // Those that add() refused and those that the disk did.
  int64_t dropped() const { return dropped_; }

 private:
  struct Slot {
    int64_t timestamp_ns = 0;
    cv::Mat grey;  // empty: none could be read
  };
  bool drop(const std::string& why);
  void run();

  const Options options_;
  std::unique_ptr<PictureSink> sink_;
  std::vector<Slot> slots_;
  size_t begin_ = 0, count_ = 0;  // of the ring
  bool stop_ = false;
  std::mutex mutex_;  // of the three above
  std::condition_variable changed_;
  std::optional<int64_t> last_ns_;
  std::atomic<int64_t> written_ = 0, dropped_ = 0;
  std::thread thread_;
};

}  // namespace perch
