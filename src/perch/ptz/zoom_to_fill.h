#pragma once

#include <functional>

#include "perch/camera/camera_model.h"

namespace perch {

// The lens at a zoom, 0 widest to 1 narrowest.
using ZoomLens = std::function<CameraModel(double zoom)>;

// The narrowest zoom at which a target of the angular radius `target` fills no more than `fill` of the
// picture's smaller side, and stays in the picture though it gets `aside` off its middle: what it may move
// before the head follows (the paper's zoom-to-fill). 0 when none does. The lens must narrow with the zoom.
double zoom_to_fill(const ZoomLens& lens, double target, double aside, double fill);

}  // namespace perch
