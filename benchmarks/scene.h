#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/geometry/rigid3.h"
#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"
#include "perch/target/landing_target.h"

namespace perch {

// The pictures that all rows share: for each pose the squares target and an AprilTag, both 1 m across with
// their white margins, lying in the same place on the same textured ground.
struct View {
  Rigid3 camera_from_target;
  cv::Mat squares, tag;
};

struct Scene {
  CameraModel camera;
  LandingTarget squares, tag;
  std::vector<View> views;
};

// What lies around the target: nothing, what one flies over, as much as a threshold can stumble over.
enum class SceneGround { kPlain, kTextured, kBusy };

struct SceneKind {
  cv::Size size;
  SceneGround ground = SceneGround::kTextured;
};

inline const SceneKind kScenes[] = {{{320, 240}},
                                    {{640, 480}, SceneGround::kPlain},
                                    {{640, 480}},
                                    {{640, 480}, SceneGround::kBusy},
                                    {{1280, 720}},
                                    {{1920, 1080}},
                                    {{1920, 1080}, SceneGround::kBusy}};

std::string name_of(const SceneKind& kind);  // "640x480", "640x480_busy"

// Made at the first call for each kind, and kept. 24 poses from a fixed seed: 2 to 8 m away, tilted by up to
// 35 degrees, turned anyhow, wholly in view; the same poses at each resolution, a lens of the same 56 degrees
// across, and light and noise as below.
const Scene& scene(const SceneKind& kind);

// White is 120 grey levels above black, the noise about 2 on both: read noise, where the shots of a small
// well would favour black. Black is grey 17, where the noise is not clipped; the blur 0.7 px.
SensorOptions scene_sensor();
SceneOptions scene_light();
inline constexpr OpticsOptions kSceneOptics{.psf_sigma_px = 0.7};

}  // namespace perch
