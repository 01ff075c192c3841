#include "perch/ptz/zoom_control.h"

#include <algorithm>
#include <cmath>

#include "perch/ptz/zoom_to_fill.h"

namespace perch {
namespace {

// A vehicle that swings swings again: what the target was off the middle is forgotten with this time.
constexpr double kForgets = 4;  // s
// So far ahead the target must still fit: the lens's way, and what the device needs to say that it is there.
constexpr double kAhead = 1;  // s
// Room to come, when it zooms at all.
constexpr double kRoom = 1.3;
// Of the whole way: what is worth moving for, and a move of less than a second of the EVI-D30's 2.2.
constexpr double kWorth = 0.08, kMostStep = 0.35;

}  // namespace

ZoomControl::ZoomControl(const ZoomTable& table, double radius, double fill)
    : table_(table),
      widest_(table.entries().front().zoom),
      narrowest_(table.entries().back().zoom),
      radius_(radius),
      fill_(fill) {}

double ZoomControl::zoom_for(double distance, double aside, double fill) const {
  const double way = narrowest_ - widest_;
  const ZoomLens lens = [&](double part) { return *table_.at(std::min(widest_ + part * way, narrowest_)); };
  const double angle = std::atan2(radius_, std::max(distance, 1e-3));
  return std::min(widest_ + way * zoom_to_fill(lens, angle, aside, fill), narrowest_);
}

double ZoomControl::update(int64_t now_ns, const std::optional<HeadControl::Sight>& sight, double zoom) {
  if (!sight) return widest_;
  const double dt = std::max(0.0, static_cast<double>(now_ns - then_ns_) * 1e-9);
  then_ns_ = now_ns;
  aside_ = std::max(sight->aside, aside_ * std::exp(-dt / kForgets));
  const double nearest = sight->distance - kAhead * std::max(0.0, sight->closing);
  const double most = zoom_for(nearest, aside_, fill_);
  const double roomy = zoom_for(nearest, kRoom * aside_, fill_ / kRoom);
  const double way = narrowest_ - widest_;
  if (zoom > most) return roomy;
  if (roomy > zoom + kWorth * way) return std::min(roomy, zoom + kMostStep * way);
  return zoom;
}

}  // namespace perch
