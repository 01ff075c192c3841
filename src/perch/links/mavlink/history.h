#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

namespace perch::mavlink {

// The last samples of something, times strictly rising. Its memory is taken once.
template <class Sample>  // with an int64_t time_ns
class History {
 public:
  explicit History(size_t capacity) : ring_(capacity) {}

  // False, and nothing kept, when the sample is not newer than the last.
  bool add(const Sample& sample) {
    if (count_ > 0 && sample.time_ns <= latest()->time_ns) return false;
    ring_[(begin_ + count_) % ring_.size()] = sample;
    if (count_ < ring_.size()) {
      ++count_;
    } else {
      begin_ = (begin_ + 1) % ring_.size();
    }
    return true;
  }

  size_t size() const { return count_; }
  const Sample& operator[](size_t i) const { return ring_[(begin_ + i) % ring_.size()]; }
  const Sample* latest() const { return count_ ? &(*this)[count_ - 1] : nullptr; }
  void clear() { count_ = 0; }

  // The samples at or before, and after, a moment. The second is null past the end; empty before the first.
  std::optional<std::pair<const Sample*, const Sample*>> around(int64_t time_ns) const {
    if (count_ == 0 || (*this)[0].time_ns > time_ns) return std::nullopt;
    size_t low = 0, high = count_;  // (*this)[low] is at or before the moment, (*this)[high] is not
    while (high - low > 1) {
      const size_t middle = (low + high) / 2;
      ((*this)[middle].time_ns <= time_ns ? low : high) = middle;
    }
    return std::pair(&(*this)[low], high < count_ ? &(*this)[high] : nullptr);
  }

 private:
  std::vector<Sample> ring_;
  size_t begin_ = 0, count_ = 0;
};

}  // namespace perch::mavlink
