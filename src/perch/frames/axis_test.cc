#include "perch/frames/axis_test.h"

#include <cmath>

namespace perch {
namespace {

constexpr const char* kPlus[] = {"forward", "to the right", "down"};
constexpr const char* kMinus[] = {"backward", "to the left", "up"};

// The components that matter, the longest first.
std::string in_words(const Eigen::Vector3d& moved) {
  std::string words;
  Eigen::Vector3d left = moved.cwiseAbs();
  for (int n = 0; n < 3; ++n) {
    Eigen::Index i = 0;
    const double length = left.maxCoeff(&i);
    if (n > 0 && length < 0.25 * moved.norm()) break;
    left(i) = -1;
    words += (words.empty() ? "" : ", ") + std::to_string(std::lround(100 * length)) + " cm " +
             (moved(i) < 0 ? kMinus : kPlus)[i];
  }
  return words;
}

}  // namespace

std::string direction_name(BodyAxis axis) { return kPlus[static_cast<size_t>(axis)]; }

std::optional<Eigen::Vector3d> AxisTest::resting_place() const {
  if (last_.empty() || last_.back().time_ns - last_.front().time_ns < kStill) return std::nullopt;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Place& place : last_) sum += place.pad_in_body;
  const Eigen::Vector3d mean = sum / static_cast<double>(last_.size());
  for (const Place& place : last_) {
    if (!((place.pad_in_body - mean).norm() < kStillWithin)) return std::nullopt;
  }
  return mean;
}

std::optional<AxisTest::Verdict> AxisTest::see(int64_t time_ns, const Eigen::Vector3d& pad_in_body) {
  last_.push_back({time_ns, pad_in_body});
  while (last_.size() > 2 && time_ns - last_[1].time_ns >= kStill) last_.pop_front();
  // Seen again after a while: what happened meanwhile nobody knows.
  if (last_.size() > 1 && time_ns - last_[last_.size() - 2].time_ns > kStill / 2) {
    last_.erase(last_.begin(), std::prev(last_.end()));
  }
  const auto resting = resting_place();
  if (!resting) return std::nullopt;
  if (!start_) start_ = resting;
  const Eigen::Vector3d moved = *resting - *start_;
  if (moved.norm() < kLeastMove) return std::nullopt;
  return verdict(moved);
}

AxisTest::Verdict AxisTest::verdict(const Eigen::Vector3d& moved) const {
  const auto axis = static_cast<Eigen::Index>(axis_);
  Eigen::Vector3d aside = moved;
  aside(axis) = 0;
  return {moved(axis) > 0 && aside.norm() < kMostAside * moved(axis), in_words(moved)};
}

}  // namespace perch
