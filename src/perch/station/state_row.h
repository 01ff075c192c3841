#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "perch/estimator/estimator.h"

namespace perch {

// What the page is told of each frame, in few bytes: an estimate and a state, as in estimates.csv and
// states.csv, and what navigation says of the same moment. NaN where there is none.
struct StateRow {
  uint32_t sequence = 0;
  int64_t timestamp_ns = 0;  // camera clock
  uint8_t status = 0;        // EstimateStatus
  uint8_t source = 0;        // 0: no state yet, else StateSource + 1

  enum Value : size_t {
    kState = 0,          // x y z [m], yaw pitch roll [deg]: pad_from_body, filtered
    kSigma = 6,          // of each, m and deg
    kVelocity = 12,      // v_x v_y v_z [m/s], w_x w_y w_z [deg/s]
    kNavigation = 18,    // as kState
    kCamera = 24,        // x y z [m], q_w q_x q_y q_z: camera_from_target, as measured in this frame
    kReprojection = 31,  // px
    kFeatures,
    kAmbiguity,
    kEstimate,  // ms, the estimator's own time
    kLatency,   // ms, exposure to estimate; of a recording NaN
    kPan,       // deg, as the head reads
    kTilt,
    kZoom,  // as the camera tells it, 0 widest to 1 narrowest, or in the zoom table's unit
    kValues
  };
  std::array<float, kValues> values{};
};

// What the page calls them, in their order.
inline constexpr std::string_view kStateRowColumns[StateRow::kValues] = {
    "x",        "y",         "z",           "yaw",        "pitch",   "roll",    "sigma_x",   "sigma_y",
    "sigma_z",  "sigma_yaw", "sigma_pitch", "sigma_roll", "v_x",     "v_y",     "v_z",       "w_x",
    "w_y",      "w_z",       "nav_x",       "nav_y",      "nav_z",   "nav_yaw", "nav_pitch", "nav_roll",
    "cam_x",    "cam_y",     "cam_z",       "cam_q_w",    "cam_q_x", "cam_q_y", "cam_q_z",   "reprojection",
    "features", "ambiguity", "estimate_ms", "latency_ms", "pan",     "tilt",    "zoom"};

// Everything but the number in the sequence. `navigation`: pad_from_body as navigation has it.
StateRow state_row(const Estimate& estimate, const Estimator::Aid& aid,
                   const std::optional<Rigid3>& navigation, std::optional<double> latency_ms);

// One row, little-endian:   u32 sequence | u8 status | u8 source | u16 0 | i64 timestamp | f32 values...
inline constexpr size_t kStateRowBytes = 16 + 4 * StateRow::kValues;
void append_row(const StateRow& row, std::vector<uint8_t>& bytes);

}  // namespace perch
