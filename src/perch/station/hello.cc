#include "perch/station/hello.h"

#include "perch/analysis/pad_json.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

using Json = nlohmann::json;

// The directions of the picture's corners, in the order in which they go round; null where the lens model
// says none.
Json corner_rays(const CameraModel& camera) {
  const double right = camera.width() - 0.5, low = camera.height() - 0.5;
  Json rays = Json::array();
  for (const auto& [x, y] : {std::pair{-0.5, -0.5}, {right, -0.5}, {right, low}, {-0.5, low}}) {
    const auto ray = camera.ray_from_pixel({x, y});
    rays.push_back(ray ? Json{ray->x(), ray->y(), ray->z()} : Json(nullptr));
  }
  return rays;
}

// `direction`, `point` [m]; it turns by scale * reading + zero_deg.
Json axis_json(const HeadAxis& axis) {
  const auto list = [](const Eigen::Vector3d& v) { return Json{v.x(), v.y(), v.z()}; };
  return {{"direction", list(axis.direction)},
          {"point", list(axis.point)},
          {"scale", axis.scale},
          {"zero_deg", axis.zero * kDegFromRad}};
}

Json head_json(const std::optional<PanTilt>& head) {
  if (!head) return nullptr;
  return {{"pan", axis_json(head->pan)},
          {"tilt", axis_json(head->tilt)},
          {"pan_carries_tilt", head->order == HeadOrder::kPanCarriesTilt}};
}

}  // namespace

Json hello_json(const StationScene& scene, const StationOptions& options) {
  const FrameChain& frames = scene.frames;
  Json json = {{"title", scene.title},
               {"recorded", scene.recorded},
               {"control", options.control},
               {"bandwidth", options.bandwidth},
               {"columns", kStateRowColumns},
               {"row_bytes", kStateRowBytes},
               {"pad", pad_json(scene.target, inverse(frames.target_from_pad))},
               {"camera",
                {{"width", scene.camera.width()},
                 {"height", scene.camera.height()},
                 {"rays", corner_rays(scene.camera)}}},
               {"compared", frames.world_from_pad.has_value()},
               {"pan_tilt", head_json(frames.pan_tilt)},
               {"body_from_base", transform_json(frames.body_from_base.value_or(Rigid3{}))}};
  json["base_from_camera"] =
      transform_json(frames.pan_tilt ? frames.pan_tilt->base_from_zero : frames.base_from_camera);
  return json;
}

}  // namespace perch
