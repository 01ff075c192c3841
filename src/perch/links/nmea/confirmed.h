#pragma once

#include <optional>
#include <vector>

namespace perch::nmea {

// Lets a value through that follows from the one before. One that does not follow, and the very first, waits
// until the next two follow from it: then it was a jump, not garbage, and the newest of the three is let
// through.
template <class Value>
class Confirmed {
 public:
  template <class Follows>  // bool(const Value& earlier, const Value& later)
  bool take(const Value& value, const Follows& follows) {
    if (last_ && follows(*last_, value)) {
      last_ = value;
      waiting_.clear();
      return true;
    }
    if (!waiting_.empty() && !follows(waiting_.back(), value)) waiting_.clear();
    waiting_.push_back(value);
    if (waiting_.size() < kEnough) return false;
    last_ = value;
    waiting_.clear();
    return true;
  }
  const std::optional<Value>& last() const { return last_; }
  void forget() {
    last_.reset();
    waiting_.clear();
  }

 private:
  static constexpr size_t kEnough = 3;
  std::optional<Value> last_;
  std::vector<Value> waiting_;
};

}  // namespace perch::nmea
