#include "perch/analysis/pad_json.h"

namespace perch {

using Json = nlohmann::json;

Json transform_json(const Rigid3& transform) {
  const auto& p = transform.translation;
  const auto& q = transform.rotation;
  return {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()};
}

Json pad_json(const LandingTarget& target, const Rigid3& pad_from_target) {
  Json patches = Json::array();
  for (const Patch& patch : target.patches) {
    Json corners = Json::array();
    for (const Eigen::Vector2d& p : patch.corners) {
      corners.push_back(p.x());
      corners.push_back(p.y());
    }
    patches.push_back({{"corners", corners}, {"white", patch.white}});
  }
  return {{"size", target.size}, {"patches", patches}, {"pad_from_target", transform_json(pad_from_target)}};
}

}  // namespace perch
