#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "perch/config/section.h"
#include "perch/geometry/uncertainty.h"

namespace perch {

struct HeadAngles {
  double pan = 0, tilt = 0;              // rad
  double pan_sigma = 0, tilt_sigma = 0;  // how well they are known at that moment, rad
  double roll =
      0;  // then, about the optical axis, clockwise as the camera sees it: of stabilised gimbals alone, rad
};

// One axis of a head, in the axes of the camera at zero angles. The camera turns by scale * reading + zero
// about the line through `point` along `direction`.
struct HeadAxis {
  Eigen::Vector3d direction;                        // unit
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // any of the axis, m
  double scale = 1;                                 // rad of turn a rad of reading
  double zero = 0;                                  // turn at reading 0, rad
};

enum class HeadOrder { kPanCarriesTilt, kTiltCarriesPan };

// A pan/tilt head between the base and the camera: the product of exponentials
//
//   base_from_camera = base_from_zero * Turn(pan) * Turn(tilt)      (or tilt first, by `order`)
//
// Positive pan turns the camera right (the target moves left in the picture), positive tilt turns it up (the
// target moves down). By default the paper's section 3.2: the axes of the base are those of a camera (x
// right, y down, z forward) and the optical centre lies on both axes.
struct PanTilt {
  Rigid3 base_from_zero;
  HeadAxis pan{Eigen::Vector3d::UnitY()};
  HeadAxis tilt{Eigen::Vector3d::UnitX()};
  HeadOrder order = HeadOrder::kPanCarriesTilt;
  double latency = 0;  // a reading's time stamp minus the moment the head was there, s
};

// What a turn about an axis by its reading does to the camera.
Rigid3 head_turn(const HeadAxis& axis, double reading);

// The frame chain of the paper's figure 3.2; the letters are those of its table 3.1.
//
//   target (a) -- pad (b) ~~ camera (c) -- base (d) -- body (e) ~~ world (f) -- pad (b)
//       target_from_pad  vision   base_from_camera  body_from_base  nav   world_from_pad
//
// The answer a user wants: pad_from_body = (camera_from_pad)^-1 * camera_from_base * base_from_body.
// Navigation says the same as pad_from_world * world_from_body; the paper uses that to compare only.
struct FrameChain {
  Rigid3 target_from_pad;                // g_ba: predefined
  Rigid3 base_from_camera;               // g_dc of a fixed camera
  std::optional<PanTilt> pan_tilt;       // g_dc of a moving one; then base_from_camera is not used
  std::optional<Rigid3> body_from_base;  // g_ed: predefined; absent: the flight's own T_BS
  std::optional<Rigid3> world_from_pad;  // g_fb: predefined; absent: nothing to compare with
  double time_offset = 0;                // camera clock minus navigation clock, s
};

// Reads the `frames` section and refuses unknown keys.
FrameChain read_frame_chain(Section frames);

// g_dc at these angles; a fixed camera's does not ask for them.
Rigid3 base_from_camera(const FrameChain& chain, const std::optional<HeadAngles>& angles);

// The angles at which the head holds a camera that is turned so in the body (camera axes); empty where no two
// angles do: a third axis keeps the horizon level, or base_from_zero is another head's.
std::optional<HeadAngles> head_angles_of(const FrameChain& chain, const Eigen::Quaterniond& body_from_camera);

// A head's angles tell where the camera is only when they are known.
inline bool knows_camera(const FrameChain& chain, const std::optional<HeadAngles>& angles) {
  return !chain.pan_tilt || angles;
}

// What vision says: the pose of the body in the pad frame, with the covariance of the camera's pose and that
// of the head's angles. A missing body_from_base counts as the identity.
UncertainRigid3 pad_from_body_by_vision(const FrameChain& chain, const UncertainRigid3& camera_from_target,
                                        const std::optional<HeadAngles>& angles = {});

// The way back: where a body at this pose sees the target.
UncertainRigid3 camera_from_target_of(const FrameChain& chain, const UncertainRigid3& pad_from_body,
                                      const std::optional<HeadAngles>& angles = {});

// Where the face of a level target points, seen by the camera at this attitude (the rotation of
// world_from_body). With world_from_pad the face's own normal; without it the pad is taken as level in a
// world whose z is up or down. Then it is empty when the camera looks too near the horizon to tell the face
// from its back; empty too without a finite attitude.
std::optional<Eigen::Vector3d> level_normal_in_camera(const FrameChain& chain,
                                                      const Eigen::Quaterniond& world_from_body,
                                                      const std::optional<HeadAngles>& angles = {});

// What navigation says; empty without world_from_pad.
std::optional<Rigid3> pad_from_body_by_navigation(const FrameChain& chain, const Rigid3& world_from_body);

// The moment of the navigation clock at which a frame was taken.
inline int64_t navigation_time_ns(const FrameChain& chain, int64_t camera_time_ns) {
  return camera_time_ns - std::llround(chain.time_offset * 1e9);
}

}  // namespace perch
