#pragma once

#include <cstdint>
#include <deque>

#include "perch/station/state_row.h"

namespace perch {

// The rows of the last minutes, each with its number: 1, 2, 3, ... A client that was away asks from a number.
class StateRing {
 public:
  // 5 minutes at 30 Hz, 1.5 MB.
  explicit StateRing(size_t most = 9000) : most_(most) {}

  void add(StateRow row) {
    row.sequence = next_++;
    rows_.push_back(row);
    if (rows_.size() > most_) rows_.pop_front();
  }
  // The first number that is still here, and the one that the next row will have; equal when there are none.
  uint32_t first() const { return next_ - static_cast<uint32_t>(rows_.size()); }
  uint32_t next() const { return next_; }
  // first() <= sequence < next().
  const StateRow& at(uint32_t sequence) const { return rows_[sequence - first()]; }

 private:
  const size_t most_;
  std::deque<StateRow> rows_;
  uint32_t next_ = 1;
};

}  // namespace perch
