#include "perch/camera/live_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "perch/camera/live_tally.h"

namespace perch {

namespace {

constexpr int64_t kFirstRetryNs = 100'000'000;
constexpr int64_t kLastRetryNs = 5'000'000'000;
// A stamp further ahead of the clock is none of this clock: what a jitter buffer smooths stays below.
constexpr int64_t kMostAheadNs = 20'000'000;
// Nor is an older one: a network camera buffers two or three seconds.
constexpr int64_t kOldestNs = 5'000'000'000;

int64_t ns(double seconds) { return std::llround(seconds * 1e9); }

class LiveCamera : public LiveSource {
 public:
  LiveCamera(std::unique_ptr<CameraDevice> device, const LiveOptions& options, LiveClock& clock)
      : device_(std::move(device)), options_(options), clock_(clock) {}
  ~LiveCamera() override {
    if (open_) device_->close();
  }

  std::optional<LiveFrame> next(std::chrono::nanoseconds timeout) override {
    const int64_t deadline = clock_.now_ns() + timeout.count();
    do {
      try {
        if (!open_ && !reopen(deadline)) return std::nullopt;
        if (auto picture = grab(deadline)) return picture;
      } catch (const std::exception& e) {
        give_up(e.what());
      }
    } while (clock_.now_ns() < deadline);
    return std::nullopt;
  }
  LiveCounters counters() const override { return tally_.counters(); }

 private:
  // Opens the device when it is time for that again; false: not before the deadline.
  bool reopen(int64_t deadline) {
    clock_.sleep_until(std::min(retry_at_, deadline));
    if (clock_.now_ns() < retry_at_) return false;
    try {
      device_->open();
    } catch (const std::exception&) {
      tally_.add(&LiveCounters::open_failed);
      throw;
    }
    open_ = true;
    if (opened_before_) tally_.add(&LiveCounters::reopened);
    opened_before_ = true;
    seen_ = false;
    alive_ns_ = clock_.now_ns();
    patience_ns_ = ns(options_.first_picture);
    return true;
  }

  void give_up(const std::string& why) {
    tally_.problem(why);
    if (open_) device_->close();
    open_ = false;
    retry_at_ = clock_.now_ns() + retry_ns_;
    retry_ns_ = std::min(2 * retry_ns_, kLastRetryNs);
  }

  std::optional<LiveFrame> grab(int64_t deadline) {
    const int64_t too_late = alive_ns_ + patience_ns_;
    LiveFrame picture;
    const int64_t wait = std::min(deadline, too_late) - clock_.now_ns();
    const Grab grab = device_->grab(picture.frame, std::max<int64_t>(wait, 0));
    picture.arrived_ns = clock_.now_ns();
    if (grab.lost > 0) tally_.add(&LiveCounters::dropped, grab.lost);
    if (!grab.problem.empty()) tally_.problem(grab.problem);
    if (!grab.picture) {
      if (picture.arrived_ns < too_late) return std::nullopt;
      tally_.add(&LiveCounters::stalled);
      throw std::runtime_error(device_->name() + ": no picture for " +
                               std::to_string(patience_ns_ / 1'000'000) + " ms");
    }
    note_period(picture.arrived_ns);
    if (grab.settling) {
      tally_.add(&LiveCounters::settling);
      return std::nullopt;
    }
    picture.frame.timestamp_ns -= ns(options_.latency);
    if (!believable(picture)) return std::nullopt;
    retry_ns_ = kFirstRetryNs;
    stamp_ns_ = picture.frame.timestamp_ns;
    picture.frame.name = std::to_string(number_++);
    tally_.picture(picture.frame);
    return picture;
  }

  // How long the next picture may take: ten periods, by the rate that was asked for or the one that is.
  void note_period(int64_t arrived_ns) {
    if (seen_) {
      period_ns_ += (static_cast<double>(arrived_ns - alive_ns_) - period_ns_) / 8;
    }
    seen_ = true;
    alive_ns_ = arrived_ns;
    const double asked_ns = options_.rate_hz > 0 ? 1e9 / options_.rate_hz : 0;
    patience_ns_ = options_.stall > 0
                       ? ns(options_.stall)
                       : std::max<int64_t>(500'000'000, std::llround(10 * std::max(period_ns_, asked_ns)));
  }

  bool believable(const LiveFrame& picture) {
    const int64_t stamp = picture.frame.timestamp_ns, age = picture.arrived_ns - stamp;
    const char* what = age < -kMostAheadNs  ? " ms after it arrived"
                       : age > kOldestNs    ? " ms before it arrived"
                       : stamp <= stamp_ns_ ? " ms before it arrived, no later than the one before it"
                                            : nullptr;
    if (!what) return true;
    tally_.add(&LiveCounters::dropped);
    tally_.problem(device_->name() + ": a picture stamped " + std::to_string(std::abs(age) / 1'000'000) +
                   what + ", dropped");
    return false;
  }

  std::unique_ptr<CameraDevice> device_;
  LiveOptions options_;
  LiveClock& clock_;
  LiveTally tally_;
  bool open_ = false, opened_before_ = false;
  int64_t retry_at_ = 0, retry_ns_ = kFirstRetryNs;
  int64_t alive_ns_ = 0;     // the last sign of life: opened, or a picture
  int64_t patience_ns_ = 0;  // from then on
  bool seen_ = false;        // a picture since it was opened
  double period_ns_ = 1e8;   // from picture to picture, smoothed
  int64_t stamp_ns_ = std::numeric_limits<int64_t>::min();
  int64_t number_ = 0;
};

}  // namespace

std::unique_ptr<LiveSource> make_live_camera(std::unique_ptr<CameraDevice> device, const LiveOptions& options,
                                             LiveClock& clock) {
  return std::make_unique<LiveCamera>(std::move(device), options, clock);
}

}  // namespace perch
