#pragma once

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "perch/geometry/euler.h"
#include "perch/simulation/renderer.h"
#include "perch/simulation/sensor.h"
#include "support/drawing.h"

namespace perch {

// Which troubles a scene may have. Each that is allowed is there half of the time.
struct SceneTroubles {
  double smallest_px = 4, largest_px = 60;  // the narrowest width of a small square
  double steepest = 60 * kRadFromDeg;       // tilt
  bool covered = false;                     // up to three squares, by something dark, pale or grey
  bool cut = false;                         // by the picture's edge, up to three squares outside
  bool shadow = false;                      // its edge anywhere on the target
  bool glare = false;                       // a soft spot of more light than the sensor holds
  bool gradient = false;                    // light that falls off across the picture
  bool faded = false;                       // grey interior, dirty white
  bool noisy = false;                       // up to a tenth of the contrast
  bool blurred = false;                     // out of focus, up to a third of a small square
  bool lens = false;                        // barrel or pincushion
};

// A target of squares as users see it, rendered, with the truth about it.
struct RandomScene {
  CameraModel camera;
  Rigid3 camera_from_target;
  cv::Mat grey;
  std::string story;  // what is in it, for the failure's message
};

namespace random_scene {

inline CameraModel camera(TestRng& rng, bool lens) {
  const double f = rng.uniform(350, 800), u = 319.5 + rng.uniform(-15, 15), v = 239.5 + rng.uniform(-15, 15);
  if (!lens || rng.index(2) == 0) return CameraModel::pinhole(f, f, u, v, 640, 480);
  const double k = rng.uniform(-0.25, 0.1);
  return {
      "LENSMODEL_OPENCV4",
      {f, f * rng.uniform(0.99, 1.01), u, v, k, -0.3 * k, rng.uniform(-1e-3, 1e-3), rng.uniform(-1e-3, 1e-3)},
      640,
      480};
}

struct SeenSquares {
  double narrowest = INFINITY;  // px, of those in the picture
  int whole = 0;                // not cut by the picture's edge
};

inline SeenSquares see(const LandingTarget& target, const CameraModel& camera, const Rigid3& pose) {
  SeenSquares seen;
  for (size_t i = 0; i + 3 < target.features.size() && i < 24; i += 4) {
    std::array<Eigen::Vector2d, 4> corners;
    bool whole = true;
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d& q = target.features[i + k].point;
      const auto pixel = camera.pixel_from_camera(pose * Eigen::Vector3d(q.x(), q.y(), 0));
      if (!pixel) return {};
      corners[k] = *pixel;
      whole = whole && pixel->x() > 2 && pixel->y() > 2 && pixel->x() < camera.width() - 3 &&
              pixel->y() < camera.height() - 3;
    }
    seen.whole += whole;
    const Eigen::Vector2d a = corners[0] - corners[2], b = corners[1] - corners[3];
    const double area = 0.5 * std::abs(a.x() * b.y() - a.y() * b.x());
    double longest = 0;
    for (size_t k = 0; k < 4; ++k) longest = std::max(longest, (corners[k] - corners[(k + 1) % 4]).norm());
    seen.narrowest = std::min(seen.narrowest, area / longest);
  }
  return seen;
}

// A pose with the target as large as asked, whole in the picture or, `cut`, with three squares at least.
inline std::optional<Rigid3> pose(TestRng& rng, const LandingTarget& target, const CameraModel& camera,
                                  const SceneTroubles& troubles, bool cut) {
  const double px =
      troubles.smallest_px * std::pow(troubles.largest_px / troubles.smallest_px, rng.uniform(0, 1));
  const double tilt = rng.uniform(0, troubles.steepest);
  const double small = 0.1 * target.size, f = camera.intrinsics()[0];
  const double distance = f * small * std::cos(tilt) / px;
  const Eigen::Vector2d reach(0.5 * camera.width() / f * distance, 0.5 * camera.height() / f * distance);
  const Eigen::Vector2d off(rng.uniform(-reach.x(), reach.x()), rng.uniform(-reach.y(), reach.y()));
  const Rigid3 pose = looking_pose(distance, tilt, rng.uniform(0, 6.3), rng.uniform(0, 6.3), off);
  const auto corner_in = [&](double x, double y) {
    const auto p = camera.pixel_from_camera(pose * Eigen::Vector3d(x, y, 0));
    return p && p->x() > 3 && p->y() > 3 && p->x() < camera.width() - 4 && p->y() < camera.height() - 4;
  };
  const double h = 0.5 * target.size;
  const bool whole = corner_in(h, h) && corner_in(-h, h) && corner_in(-h, -h) && corner_in(h, -h);
  // The camera sees the face.
  if ((pose.rotation * Eigen::Vector3d::UnitZ()).dot(pose.translation) > -0.2 * pose.translation.norm())
    return {};
  const SeenSquares seen = see(target, camera, pose);
  if (seen.narrowest < troubles.smallest_px) return {};
  if (cut ? whole || seen.whole < 4 : !whole) return {};
  return pose;
}

// Something that lies on the target: over the small squares around a random one, three at most.
inline void cover(TestRng& rng, const LandingTarget& target, const CameraModel& camera, const Rigid3& pose,
                  cv::Mat_<float>& light) {
  const auto i = static_cast<size_t>(rng.index(6));
  Eigen::Vector2d centre = 0.5 * (target.features[4 * i].point + target.features[4 * i + 2].point);
  const double radius = rng.uniform(0.08, 0.2) * target.size;
  centre += radius * Eigen::Vector2d(rng.uniform(-0.5, 0.5), rng.uniform(-0.5, 0.5));
  std::vector<cv::Point> outline;
  const int corners = 3 + rng.index(6);
  for (int k = 0; k < corners; ++k) {
    const double angle = 2 * M_PI * k / corners, r = radius * rng.uniform(0.8, 1.2);
    const auto p = camera.pixel_from_camera(
        pose * Eigen::Vector3d(centre.x() + r * std::cos(angle), centre.y() + r * std::sin(angle), 0));
    if (!p) return;
    outline.emplace_back(cvRound(16 * p->x()), cvRound(16 * p->y()));
  }
  const double reflectance[] = {0.03, 0.2, 0.45, 0.9};
  cv::Mat mask(light.size(), CV_32F, cv::Scalar(0));
  cv::fillPoly(mask, outline, cv::Scalar(1), cv::LINE_8, 4);
  cv::GaussianBlur(mask, mask, {}, 0.7);
  const double level = reflectance[rng.index(4)];
  light = light.mul(1 - mask) + level * mask;
}

}  // namespace random_scene

inline std::optional<RandomScene> make_random_scene(TestRng& rng, const LandingTarget& target,
                                                    const SceneTroubles& troubles) {
  using namespace random_scene;
  std::ostringstream story;
  const auto half = [&](bool allowed) { return allowed && rng.index(2) == 0; };
  RandomScene made{camera(rng, troubles.lens), {}, {}, {}};
  const bool cut = half(troubles.cut);
  std::optional<Rigid3> at;
  for (int tries = 0; tries < 300 && !at; ++tries) at = pose(rng, target, made.camera, troubles, cut);
  if (!at) return std::nullopt;
  made.camera_from_target = *at;
  const double narrow = see(target, made.camera, *at).narrowest;
  story << "square " << narrow << " px, " << at->translation.norm() << " m, tilt "
        << std::acos(-(at->rotation * Eigen::Vector3d::UnitZ()).dot(Eigen::Vector3d::UnitZ())) * kDegFromRad
        << " deg";
  if (cut) story << ", cut";

  SceneOptions scene;
  scene.white = half(troubles.faded) ? rng.uniform(0.5, 0.8) : 0.8;
  scene.black = half(troubles.faded) ? rng.uniform(0.05, 0.4 * scene.white) : 0.05;
  scene.ground.reflectance = rng.uniform(0.04, 0.7);
  scene.ground.contrast = rng.uniform(0, 0.4);
  scene.ground.seed = static_cast<uint64_t>(rng.index(1000));
  story << ", white " << scene.white << " black " << scene.black << " ground " << scene.ground.reflectance;
  if (half(troubles.shadow)) {
    scene.shadow = ShadowEdge{rng.uniform(0, 6.3), rng.uniform(-0.4, 0.4), 0, rng.uniform(0.2, 0.6),
                              rng.uniform(0.005, 0.1)};
    story << ", shadow " << scene.shadow->factor;
  }
  OpticsOptions optics;
  optics.psf_sigma_px =
      half(troubles.blurred) ? rng.uniform(0.7, std::max(0.8, 0.3 * narrow)) : rng.uniform(0.5, 0.8);
  optics.psf_sigma_px = std::min(optics.psf_sigma_px, 4.0);
  story << ", blur " << optics.psf_sigma_px;
  cv::Mat_<float> light = Renderer(made.camera, target, scene, optics).radiance(*at);
  if (half(troubles.covered)) {
    cover(rng, target, made.camera, *at, light);
    story << ", covered";
  }
  if (half(troubles.gradient)) {
    const double u = rng.uniform(-0.5, 0.5), v = rng.uniform(-0.5, 0.5);
    for (int y = 0; y < light.rows; ++y) {
      for (int x = 0; x < light.cols; ++x)
        light(y, x) *= static_cast<float>(0.75 + u * (x / 640.0 - 0.5) + v * (y / 480.0 - 0.5));
    }
    story << ", gradient " << u << ' ' << v;
  }
  if (half(troubles.glare)) {
    const auto middle = made.camera.pixel_from_camera(at->translation).value();
    const double size = rng.uniform(1, 4) * narrow, strength = rng.uniform(0.2, 1.5);
    const Eigen::Vector2d spot = middle + narrow * Eigen::Vector2d(rng.normal(3), rng.normal(3));
    for (int y = 0; y < light.rows; ++y) {
      for (int x = 0; x < light.cols; ++x)
        light(y, x) += static_cast<float>(
            strength * std::exp(-0.5 * (Eigen::Vector2d(x, y) - spot).squaredNorm() / (size * size)));
    }
    story << ", glare " << strength << " of " << size << " px";
  }
  SensorOptions sensor;
  sensor.full_well = 100'000;
  sensor.exposure = rng.uniform(0.5, 1.1);
  const double contrast =
      255 * sensor.exposure * (scene.white - scene.black) * (scene.shadow ? scene.shadow->factor : 1);
  const double noise = half(troubles.noisy) ? rng.uniform(1, std::max(1.5, 0.1 * contrast)) : 1;
  sensor.read_noise = noise / 255 * sensor.full_well;
  if (rng.index(2) == 0) sensor.response = Response::kSrgb;
  story << ", noise " << noise << " of " << contrast << (sensor.response == Response::kSrgb ? " sRGB" : "");
  made.grey = Sensor(sensor).picture(light, 5, static_cast<uint64_t>(rng.index(1 << 30)));
  made.story = story.str();
  return made;
}

}  // namespace perch
