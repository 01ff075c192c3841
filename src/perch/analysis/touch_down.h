#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "perch/analysis/frame_record.h"
#include "perch/tracking/vehicle_state.h"

namespace perch {

// Where and when a frame's state says that the body will touch the pad, going on as it does, against where
// and when navigation says it did.
struct TouchDownForecast {
  double to_go = 0;        // until it touched, s
  double place_error = 0;  // along the pad, m
  double time_error = 0;   // s; above 0: it touched earlier than was said
};

// Forecasts as long before.
struct ForecastBin {
  double from = 0, to = 0;  // to go, s
  size_t count = 0;
  double place_rms = 0, place_median = 0;  // m
  double time_rms = 0, time_mean = 0;      // s
};

struct TouchDown {
  double time = 0;                                  // after the first frame, s
  double height = 0;                                // of the body above the pad, m
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  // on the pad, m
  std::vector<TouchDownForecast> forecasts;         // of the last ten seconds
  std::vector<ForecastBin> bins;                    // those with any
};

// The body has touched when it first comes, from half a metre higher, to within 5 cm of the lowest height
// that navigation has in the flight: a body has legs, and nobody says how long they are. Empty where the
// flight has no navigation, or does not come down. `states` are the frames'.
std::optional<TouchDown> find_touch_down(std::span<const FrameRecord> frames,
                                         std::span<const std::optional<VehicleState>> states);

}  // namespace perch
