#include "perch/camera/paced_source.h"

#include <algorithm>
#include <atomic>

#include "perch/camera/live_tally.h"

namespace perch {

namespace {

constexpr int64_t kLongestGapNs = 5'000'000'000;

// A picture of the recording and when to give it out.
struct Due {
  Frame frame;
  int64_t due_ns = 0;
};

class PacedSource : public LiveSource {
 public:
  PacedSource(std::unique_ptr<ImageSource> pictures, Pace pace, LiveClock& clock)
      : pictures_(std::move(pictures)), pace_(pace), clock_(clock) {
    note_problems();
  }

  std::optional<LiveFrame> next(std::chrono::nanoseconds timeout) override {
    const int64_t deadline = clock_.now_ns() + timeout.count();
    if (!begin()) return std::nullopt;
    if (!read_) {
      pictures_->read(current_->frame);
      read_ = true;
    }
    if (pace_ == Pace::kRealTime) {
      clock_.sleep_until(std::min(current_->due_ns, deadline));
      if (clock_.now_ns() < current_->due_ns) return std::nullopt;
    }
    LiveFrame picture{std::move(current_->frame), clock_.now_ns()};
    go_on();
    tally_.picture(picture.frame);
    return picture;
  }

  bool ended() const override { return ended_; }
  bool recorded() const override { return true; }
  LiveCounters counters() const override { return tally_.counters(); }

 private:
  // Makes sure that there is a picture at hand, and in real time one that is not too late; false at the end.
  bool begin() {
    if (ended_) return false;
    if (!current_) {  // the first call
      following_ = advance(nullptr);
      go_on();
    }
    while (pace_ == Pace::kRealTime && following_ && following_->due_ns <= clock_.now_ns()) {
      tally_.add(&LiveCounters::dropped);
      go_on();
    }
    return !ended_;
  }

  void go_on() {
    current_ = std::move(following_);
    following_.reset();
    read_ = false;
    if (current_) following_ = advance(&*current_);
    if (!current_) ended_ = true;
  }

  std::optional<Due> advance(const Due* before) {
    Due due;
    const bool more = pictures_->advance(due.frame);
    note_problems();
    if (!more) return std::nullopt;
    int64_t gap_ns = 0;
    if (__builtin_sub_overflow(due.frame.timestamp_ns, stamp_ns_, &gap_ns)) gap_ns = kLongestGapNs;
    due.due_ns = before ? before->due_ns + std::min(gap_ns, kLongestGapNs) : clock_.now_ns();
    stamp_ns_ = due.frame.timestamp_ns;
    return due;
  }

  void note_problems() {
    if (!pictures_->problems().empty()) tally_.problem(pictures_->problems().back());
  }

  std::unique_ptr<ImageSource> pictures_;
  Pace pace_;
  LiveClock& clock_;
  LiveTally tally_;
  std::optional<Due> current_, following_;
  bool read_ = false;     // current_ has its pixels
  int64_t stamp_ns_ = 0;  // of the picture that was advanced to last
  std::atomic<bool> ended_ = false;
};

}  // namespace

std::unique_ptr<LiveSource> pace_pictures(std::unique_ptr<ImageSource> pictures, Pace pace,
                                          LiveClock& clock) {
  return std::make_unique<PacedSource>(std::move(pictures), pace, clock);
}

}  // namespace perch
