#include <cmath>
#include <limits>
#include <stdexcept>

#include "perch/geometry/euler.h"
#include "perch/simulation/simulation.h"

namespace perch {

namespace {

// An angle that the file has in degrees.
void read_deg(Section& section, std::string_view key, double& angle, Range range = {}) {
  double degrees = angle * kDegFromRad;
  section.read(key, degrees, range);
  if (section.has(key)) angle = degrees * kRadFromDeg;
}

CameraModel read_camera_model_of(Section& camera, const CameraModel& standard) {
  if (camera.has("model")) {
    std::filesystem::path file;
    camera.read("model", file);
    return read_camera_model(file);
  }
  int width = standard.width(), height = standard.height();
  std::string lens = standard.lens();
  std::vector<double> intrinsics = standard.intrinsics();
  camera.read("width", width, Range{16, 16384});
  camera.read("height", height, Range{16, 16384});
  camera.read("lens", lens);
  camera.read("intrinsics", intrinsics);
  try {
    return {lens, intrinsics, width, height};
  } catch (const std::invalid_argument& e) {
    camera.fail(e.what());
  }
}

void read_camera(Section camera, Simulation& simulation) {
  simulation.camera = read_camera_model_of(camera, simulation.camera);
  camera.read("rate_hz", simulation.rate_hz, Range{0.1, 1000});
  camera.read("body_from_camera", simulation.body_from_camera);
  if (camera.has("head")) camera.read("head", simulation.head);
  camera.read("zoom_ratio", simulation.zoom_ratio, Range{1, 100});
  // PointSpread reaches 31 px.
  camera.read("psf_sigma_px", simulation.picture.optics.psf_sigma_px, Range{0, 7});
  camera.read("vignetting", simulation.picture.optics.vignetting, kFraction);
  camera.read("exposure", simulation.shutter.exposure, Range{0, 0.1});
  camera.read("readout", simulation.shutter.readout, Range{0, 0.2});
  camera.read("motion_blur", simulation.shutter.motion_blur);
  camera.done();
}

void read_flight_options(Section flight, Simulation& simulation) {
  DescentOptions& o = simulation.flight;
  flight.read("world_from_pad", simulation.world_from_pad);
  flight.read("start_height", o.start_height, kPositive);
  flight.read("start_aside", o.start_aside, kNotNegative);
  read_deg(flight, "start_bearing_deg", o.start_bearing);
  flight.read("touchdown_height", o.touchdown_height, kPositive);
  flight.read("touchdown_aside", o.touchdown_aside, kNotNegative);
  flight.read("duration", o.duration, Range{0.1, 3600});
  flight.read("hover", o.hover, Range{0, 3600});
  read_deg(flight, "yaw_drift_deg_per_s", o.yaw_drift);
  flight.read("gust_position", o.gust_position, kNotNegative);
  read_deg(flight, "gust_attitude_deg", o.gust_attitude, Range{0, 45});
  flight.read("gust_correlation", o.gust_correlation, Range{0.05, 1000});
  flight.done();
}

void read_deck(Section deck, DeckOptions& o) {
  deck.read("heave", o.heave, Range{0, 10});
  deck.read("sway", o.sway, Range{0, 10});
  read_deg(deck, "roll_deg", o.roll, Range{0, 45});
  read_deg(deck, "pitch_deg", o.pitch, Range{0, 45});
  deck.read("period", o.period, Range{1, 60});
  deck.read("roll_period", o.roll_period, Range{1, 60});
  deck.done();
}

void read_scene(Section scene, SceneOptions& o) {
  scene.read("white", o.white, kFraction);
  scene.read("black", o.black, kFraction);
  scene.read("illumination", o.illumination, kNotNegative);
  Section ground = scene.section("ground");
  ground.read("reflectance", o.ground.reflectance, kFraction);
  ground.read("contrast", o.ground.contrast, Range{0, 1});
  ground.read("stones", o.ground.stones, Range{0, 10000});
  int seed = static_cast<int>(o.ground.seed);
  ground.read("seed", seed, Range{0, std::numeric_limits<int>::max()});
  o.ground.seed = static_cast<uint64_t>(seed);
  ground.done();
  if (scene.has("shadow")) {
    ShadowEdge edge;
    Section shadow = scene.section("shadow");
    read_deg(shadow, "direction_deg", edge.direction);
    shadow.read("distance", edge.distance);
    shadow.read("speed", edge.speed);
    shadow.read("factor", edge.factor, kFraction);
    shadow.read("penumbra", edge.penumbra, kNotNegative);
    shadow.done();
    o.shadow = edge;
  }
  scene.done();
}

void read_sensor(Section sensor, SensorOptions& o) {
  sensor.read("exposure_gain", o.exposure, kPositive);
  sensor.read("full_well", o.full_well, Range{10, 1e9});
  sensor.read("read_noise", o.read_noise, kNotNegative);
  sensor.read_choice("response", o.response, {{"linear", Response::kLinear}, {"srgb", Response::kSrgb}});
  sensor.done();
}

void read_nav(Section nav, NavigationOptions& o) {
  nav.read("rate_hz", o.rate_hz, Range{0.1, 10000});
  nav.read("position_white", o.position_white, kNotNegative);
  nav.read("position_drift", o.position_drift, kNotNegative);
  read_deg(nav, "attitude_white_deg", o.attitude_white, Range{0, 180});
  read_deg(nav, "attitude_drift_deg", o.attitude_drift, Range{0, 180});
  nav.read("velocity_white", o.velocity_white, kNotNegative);
  nav.read("drift_correlation", o.drift_correlation, kPositive);
  nav.read("time_offset", o.time_offset, Range{-3600, 3600});
  nav.done();
}

}  // namespace

Simulation read_simulation(Section root) {
  Simulation simulation;
  if (!root.has("target")) root.fail("target", "a target file");
  root.read("target", simulation.target_file);
  simulation.target = read_target(simulation.target_file);
  read_camera(root.section("camera"), simulation);
  read_flight_options(root.section("flight"), simulation);
  if (root.has("deck")) {
    simulation.deck.emplace();
    read_deck(root.section("deck"), *simulation.deck);
  }
  read_scene(root.section("scene"), simulation.picture.scene);
  read_sensor(root.section("sensor"), simulation.picture.sensor);
  read_nav(root.section("nav"), simulation.nav);
  int seed = static_cast<int>(simulation.seed);
  root.read("seed", seed, Range{0, std::numeric_limits<int>::max()});
  simulation.seed = static_cast<uint64_t>(seed);
  root.done();
  return simulation;
}

}  // namespace perch
