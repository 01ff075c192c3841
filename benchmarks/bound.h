#pragma once

#include "perch/geometry/uncertainty.h"
#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"

namespace perch {

// The Cramer-Rao bound of a pose from a picture: no unbiased estimator, whatever it measures, has a smaller
// covariance than the inverse of the information that the grey levels g carry about (d, r),
//
//   I = sum_pixels J' J / var g,   J = d E[g] / d (d, r),   C >= I^-1,
//
// with (d, r) as in PoseCovariance and var g as in sensor.h. Paint, light, blur and lens count as known: an
// estimator that has to find the levels too stays a little above.
//
// J is measured on the renderer: central differences, each with a step that moves no corner of the target by
// more than 0.1 px (`target_size`: its side, m). Much less than the blur, so that the curve of the edges adds
// some 0.3 %; and far above the renderer's rounding, 1e-5 grey levels where such a step changes an edge's
// pixel by 5.
//
// The ground is fixed to the target's plane in the renderer. Its texture would tell the pose as well as the
// target does, but no estimator knows it: `renderer` must have a ground without any, see without_texture().
// All pixels then count, since those of an even ground do not change. The outer edge against it is
// information and is counted.
//
// A pose that leaves a parameter without information gives infinite or NaN entries.
PoseCovariance pose_bound(const Renderer& renderer, const SensorOptions& sensor, double target_size,
                          const Rigid3& camera_from_target, double step_px = 0.1);

// The same ground, even.
SceneOptions without_texture(SceneOptions scene);

// The same camera, of which only this part is read out. A far target fills a small part of a picture, and all
// that is rendered around it for the bound is lost time.
CameraModel window(const CameraModel& camera, const cv::Rect& part);

}  // namespace perch
