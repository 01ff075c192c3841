#include "scene.h"

#include <cmath>
#include <map>

#include "perch/simulation/picture.h"
#include "perch/simulation/random.h"

namespace perch {
namespace {

constexpr int kViews = 24;
constexpr double kFocalPerWidth = 600.0 / 640;

LandingTarget squares_target() {
  return read_target(std::filesystem::path(PERCH_SOURCE_DIR) / "configs/targets/sharp.yaml");
}

// Ten modules across with the white ones around: 0.8 m of black border make 1 m.
LandingTarget tag_target() {
  return read_target(Section::parse(
      "{type: apriltag, family: tag36h11, tags: [{id: 7, size: 0.8, center: [0, 0]}]}", "tag.yaml"));
}

// The target's centre within the middle of the narrowest picture (16:9), so that all of it is in view.
Rigid3 random_pose(RandomStream& random) {
  const double distance = 2 * std::pow(4.0, random.uniform());  // 2 to 8 m, as many in each octave
  const double tilt = random.uniform(0.05, 0.6), direction = random.uniform(0, 2 * M_PI);
  const double room_x = 0.5 / kFocalPerWidth * distance - 0.75, room_y = 9.0 / 16 * (room_x + 0.75) - 0.75;
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(tilt, Eigen::Vector3d(std::cos(direction), std::sin(direction), 0)) *
      Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()) *
      Eigen::AngleAxisd(random.uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ());
  const double x = std::max(0.0, room_x), y = std::max(0.0, room_y);
  return {rotation, Eigen::Vector3d(random.uniform(-x, x), random.uniform(-y, y), distance)};
}

SceneOptions scene_of(SceneGround ground) {
  SceneOptions scene = scene_light();
  if (ground == SceneGround::kPlain) {
    scene.ground.contrast = 0;
    scene.ground.stones = 0;
  } else if (ground == SceneGround::kBusy) {
    scene.ground.contrast = 0.6;
    scene.ground.stones = 400;
  }
  return scene;
}

Scene make_scene(const SceneKind& kind) {
  const cv::Size size = kind.size;
  const double f = kFocalPerWidth * size.width;
  Scene scene{
      CameraModel::pinhole(f, f, 0.5 * (size.width - 1), 0.5 * (size.height - 1), size.width, size.height),
      squares_target(),
      tag_target(),
      {}};
  const SceneOptions light = scene_of(kind.ground);
  const Renderer squares(scene.camera, scene.squares, light, kSceneOptics);
  const Renderer tag(scene.camera, scene.tag, light, kSceneOptics);
  const Sensor sensor(scene_sensor());
  RandomStream random(20);
  for (uint64_t i = 0; i < kViews; ++i) {
    const Rigid3 pose = random_pose(random);
    scene.views.push_back(
        {pose, sensor.picture(squares.radiance(pose), 1, i), sensor.picture(tag.radiance(pose), 2, i)});
  }
  return scene;
}

}  // namespace

std::string name_of(const SceneKind& kind) {
  const std::string size = std::to_string(kind.size.width) + "x" + std::to_string(kind.size.height);
  switch (kind.ground) {
    case SceneGround::kPlain:
      return size + "_plain";
    case SceneGround::kBusy:
      return size + "_busy";
    default:
      return size;
  }
}

const Scene& scene(const SceneKind& kind) {
  static std::map<std::string, Scene> scenes;
  const auto found = scenes.find(name_of(kind));
  if (found != scenes.end()) return found->second;
  return scenes.emplace(name_of(kind), make_scene(kind)).first->second;
}

SensorOptions scene_sensor() {
  constexpr double kFullWell = 100'000;
  return {.exposure = 120.0 / 255 / 0.7, .full_well = kFullWell, .read_noise = 1.9 / 255 * kFullWell};
}

SceneOptions scene_light() {
  SceneOptions scene;
  scene.white = 0.8;
  scene.black = 0.1;
  return scene;
}

}  // namespace perch
