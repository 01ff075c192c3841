#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/estimator/estimate.h"
#include "perch/target/landing_target.h"

namespace perch {

// A picture as the estimator saw it, and what it made of it.
struct SeenPicture {
  cv::Mat grey;  // CV_8UC1, its own copy
  Estimate estimate;
};

// Which part of a picture a client wants to see, and whether black and white, too.
struct PictureWish {
  bool grey = true;
  bool binary = true;
  bool close = false;  // the target alone, as large as it was taken
  auto operator<=>(const PictureWish&) const = default;
};

// The lines over the picture, px of the whole one: `outline` (polylines of the target at the recovered pose),
// `labels` ([name, x, y]), `edges` ([x, y, normal's x, y, distance left in px], where the method measures
// edges; else of the corners: measured minus expected along their direction), `ellipse` ([x, y, half axes,
// angle in rad] of one sigma of the pad's centre).
nlohmann::json overlay_json(const LandingTarget& target, const CameraModel& camera, const Estimate& estimate);

// The target's outline in as few points as show it to 0.2 px.
nlohmann::json outline_json(const LandingTarget& target, const CameraModel& camera,
                            const Rigid3& camera_from_target);

// A picture as it is sent: u32 length of the JSON | JSON | JPEG | bits, where the JSON says how long the last
// two are and which part of the picture they show. About 8 kB.
std::vector<uint8_t> picture_message(const SeenPicture& picture, const LandingTarget& target,
                                     const CameraModel& camera, const PictureWish& wish);

}  // namespace perch
