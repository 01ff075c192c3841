#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "perch/station/picture_message.h"
#include "perch/station/state_row.h"

namespace perch {

// The place between the estimator's thread and the station's. Whoever posts never waits for more than a few
// instructions: rows queue up to a bound, beyond which the new ones are lost and counted; a picture takes the
// place of one that was not fetched.
class Mailbox {
 public:
  void post(const StateRow& row) {
    const std::lock_guard lock(mutex_);
    if (rows_.size() < kMostRows) {
      rows_.push_back(row);
    } else {
      ++lost_;
    }
  }
  void post(std::shared_ptr<const SeenPicture> picture) {
    const std::lock_guard lock(mutex_);
    picture_.swap(picture);  // the old one is freed after the lock
  }
  // What came since the last call. `rows` is replaced.
  std::shared_ptr<const SeenPicture> fetch(std::vector<StateRow>& rows) {
    rows.clear();
    const std::lock_guard lock(mutex_);
    rows_.swap(rows);
    return std::move(picture_);
  }
  uint64_t lost() const {
    const std::lock_guard lock(mutex_);
    return lost_;
  }

  // Half a minute at 30 Hz; the station's thread fetches them 20 times a second.
  static constexpr size_t kMostRows = 1000;

 private:
  mutable std::mutex mutex_;
  std::vector<StateRow> rows_;
  std::shared_ptr<const SeenPicture> picture_;
  uint64_t lost_ = 0;
};

}  // namespace perch
