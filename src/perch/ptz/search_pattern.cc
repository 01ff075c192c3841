#include "perch/ptz/search_pattern.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Of the picture a turn: the target must be whole in it, not cut in two by the edge of every turn.
constexpr double kPitch = 0.65;
// Of the picture a second: it takes a pose several pictures to be believed.
constexpr double kViewsPerSecond = 1.2;
// A vehicle that was seen a second ago turned by no more than that: 30 degrees.
constexpr double kRadius = 0.52;

}  // namespace

SearchPattern::SearchPattern(const HeadModel& model, double view)
    : model_(model),
      pitch_(kPitch * view),
      speed_(std::min({kViewsPerSecond * view, 0.8 * model.tilt.max_speed, 0.8 * model.pan.max_speed})),
      radius_(std::max(kRadius, pitch_)) {}

double SearchPattern::spiral_duration() const {
  const double theta = 2 * M_PI * radius_ / pitch_;
  return theta * theta * pitch_ / (4 * M_PI * speed_);
}

HeadAngles SearchPattern::at(double since_lost, const HeadAngles& expected) const {
  const double t = std::max(0.0, since_lost);
  const auto within = [](double angle, const AxisLimits& axis) {
    return std::clamp(angle, axis.min, axis.max);
  };
  HeadAngles angles;
  if (t < spiral_duration()) {
    const double theta = std::sqrt(4 * M_PI * speed_ * t / pitch_);
    const double radius = pitch_ * theta / (2 * M_PI);
    angles = {expected.pan + radius * std::cos(theta), expected.tilt + radius * std::sin(theta)};
  } else {
    angles = row_by_row(t - spiral_duration());
  }
  return {within(angles.pan, model_.pan), within(angles.tilt, model_.tilt)};
}

HeadAngles SearchPattern::row_by_row(double t) const {
  const double height = model_.tilt.max - model_.tilt.min, width = model_.pan.max - model_.pan.min;
  const int rows = 1 + static_cast<int>(std::ceil(height / pitch_));
  const double row_time = width / speed_, step_time = height / (rows - 1) / speed_;
  const double period = rows * row_time + (rows - 1) * step_time;
  // Down and up again: the last row is the first of the way back.
  const double whole = std::fmod(t, 2 * period);
  const double at = whole < period ? whole : 2 * period - whole;
  const int row = std::min(rows - 1, static_cast<int>(at / (row_time + step_time)));
  const double in_row = at - row * (row_time + step_time);
  const double across = std::min(1.0, in_row / row_time);
  const double down = row + std::max(0.0, in_row - row_time) / step_time;
  const double pan = row % 2 == 0 ? across : 1 - across;
  return {model_.pan.min + width * pan, model_.tilt.max - height * down / (rows - 1)};
}

}  // namespace perch
