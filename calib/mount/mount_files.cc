#include "calib/mount/mount_files.h"

#include <cmath>
#include <cstdarg>
#include <cstdio>

#include "calib/mount/observability.h"
#include "calib/mount/wander.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

std::string format(const char* pattern, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* pattern, ...) {
  char text[400];
  va_list arguments;
  va_start(arguments, pattern);
  std::vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

Eigen::VectorXd sigmas(const MountSolution& s) { return s.covariance.diagonal().cwiseSqrt(); }

// The rows of the covariance where pads and offsets begin.
Eigen::Index pad_row(size_t pad) { return 6 + 6 * static_cast<Eigen::Index>(pad); }
Eigen::Index offset_row(const MountSolution& s, size_t offset) {
  return pad_row(s.state.pads.size()) + static_cast<Eigen::Index>(offset);
}

std::string pose_yaml(const std::string& key, const Rigid3& pose, const Eigen::VectorXd& sigma,
                      Eigen::Index row) {
  const Eigen::Quaterniond q = positive_w(pose.rotation);
  const YawPitchRoll a = ypr_from_rotation(pose.rotation);
  std::string text = key + ":\n";
  text += format("  position: [%.5f, %.5f, %.5f]", pose.translation.x(), pose.translation.y(),
                 pose.translation.z());
  if (row >= 0) {
    text += format("   # m, sigma %.5f %.5f %.5f", sigma[row], sigma[row + 1], sigma[row + 2]);
  }
  text += format("\n  rotation: {quaternion_wxyz: [%.8f, %.8f, %.8f, %.8f]}", q.w(), q.x(), q.y(), q.z());
  text +=
      format("   # ypr %.3f %.3f %.3f deg", kDegFromRad * a.yaw, kDegFromRad * a.pitch, kDegFromRad * a.roll);
  if (row >= 0) {
    text += format(", sigma about x y z %.4f %.4f %.4f deg", kDegFromRad * sigma[row + 3],
                   kDegFromRad * sigma[row + 4], kDegFromRad * sigma[row + 5]);
  }
  return text + "\n";
}

std::string axis_yaml(const char* name, const HeadAxis& axis) {
  return format("    %s:\n      direction: [%.7f, %.7f, %.7f]\n      point: [%.5f, %.5f, %.5f]   # m\n", name,
                axis.direction.x(), axis.direction.y(), axis.direction.z(), axis.point.x(), axis.point.y(),
                axis.point.z()) +
         format("      scale: %.6f\n      zero_deg: %.4f\n", axis.scale, kDegFromRad * axis.zero);
}

std::string head_yaml(const PanTilt& head) {
  const bool pan_first = head.order == HeadOrder::kPanCarriesTilt;
  std::string inner = pose_yaml("base_from_zero", head.base_from_zero, {}, -1), indented = "    ";
  for (const char c : inner) indented += c == '\n' ? std::string("\n    ") : std::string(1, c);
  indented.resize(indented.size() - 4);
  return "base_from_camera:\n  pan_tilt:\n" + indented + axis_yaml("pan", head.pan) +
         axis_yaml("tilt", head.tilt) +
         format("    order: %s\n    latency: %.5f   # s\n",
                pan_first ? "pan_carries_tilt" : "tilt_carries_pan", head.latency);
}

// Splits the mount of a head at readings 0 into base_from_zero and the axes' zeros: the inverse of what
// mount_chain does. With h the second axis' turn at reading 0, its camera frame is moved by h.
PanTilt calibrated_head(const FrameChain& configured, const MountProblem& problem, const MountSolution& s) {
  PanTilt head = head_of(*problem.chain.head, s.state.head);
  const bool pan_first = head.order == HeadOrder::kPanCarriesTilt;
  HeadAxis& first = pan_first ? head.pan : head.tilt;
  HeadAxis& second = pan_first ? head.tilt : head.pan;
  const PanTilt& drawn = *configured.pan_tilt;
  const Eigen::Vector3d drawn_first = (pan_first ? drawn.pan : drawn.tilt).direction;
  // The second axis' zero: by how much it turns the first axis to where it is nearest to the drawing's.
  const Eigen::Vector3d a = second.direction, f = first.direction;
  const Eigen::Vector3d across = f - a * a.dot(f);
  second.zero = std::atan2(drawn_first.dot(a.cross(across)), drawn_first.dot(across));
  const Rigid3 h = head_turn(second, 0);
  first.direction = h.rotation * first.direction;
  first.point = h * first.point;
  // What is left of the mount, turned back about the first axis to the drawing's.
  const Rigid3 body_from_base = configured.body_from_base.value_or(Rigid3{});
  const Rigid3 rest = s.state.mount * inverse(h);
  const Rigid3 drawn_mount = body_from_base * drawn.base_from_zero;
  const Eigen::Quaterniond turn = drawn_mount.rotation.conjugate() * rest.rotation;
  first.zero = 2 * std::atan2(turn.vec().dot(first.direction), turn.w());
  first.zero = wrap_angle(first.zero);
  head.base_from_zero = inverse(body_from_base) * rest * inverse(head_turn(first, 0));
  return head;
}

}  // namespace

FrameChain calibrated_chain(const FrameChain& configured, const MountProblem& problem,
                            const MountSolution& s) {
  FrameChain chain = configured;
  chain.world_from_pad = s.state.pads[0];
  chain.time_offset = s.state.offsets[0];
  if (configured.pan_tilt) {
    chain.body_from_base = configured.body_from_base.value_or(Rigid3{});
    chain.pan_tilt = calibrated_head(configured, problem, s);
  } else {
    chain.body_from_base = s.state.mount;
  }
  return chain;
}

std::string mount_yaml(const FrameChain& chain, const MountProblem& problem, const MountSolution& s) {
  const Eigen::VectorXd sigma = sigmas(s);
  std::string text =
      "# By perch-calibrate-mount. In a configuration: frames: !include mount.yaml\n"
      "# Deviations of rotations are about the axes of the frame the pose maps to.\n";
  if (chain.pan_tilt) {
    text += head_yaml(*chain.pan_tilt);
  } else {
    text += pose_yaml("base_from_camera", chain.base_from_camera, sigma, -1);
  }
  text += pose_yaml("body_from_base", *chain.body_from_base, sigma, chain.pan_tilt ? -1 : 0);
  text += pose_yaml("target_from_pad", chain.target_from_pad, sigma, -1);
  text += pose_yaml("world_from_pad", s.state.pads[0], sigma, pad_row(0));
  text += format("time_offset: %.6f   # s, camera minus navigation, sigma %.6f\n", s.state.offsets[0],
                 sigma[offset_row(s, 0)]);
  // Other flights' own pads and clocks: the mount is one, these are each flight's.
  for (size_t f = 1; f < problem.flights.size(); ++f) {
    if (pad_of_flight(s.state, f) == 0 && offset_of_flight(s.state, f) == 0) continue;
    std::string own = problem.flights[f].name + ":\n" +
                      pose_yaml("world_from_pad", s.state.pads[pad_of_flight(s.state, f)], sigma,
                                pad_row(pad_of_flight(s.state, f))) +
                      format("time_offset: %.6f\n", s.state.offsets[offset_of_flight(s.state, f)]);
    text += "# ";
    for (const char c : own) text += c == '\n' ? std::string("\n# ") : std::string(1, c);
    text.resize(text.size() - 2);
  }
  return text;
}

namespace {

Json scatter_json(const PadScatter& s) {
  return {
      {"pictures", s.count}, {"position_rms_m", s.position}, {"rotation_rms_deg", kDegFromRad * s.rotation}};
}

Json held_out_json(const HeldOut& part) {
  if (!part.problem.empty()) return {{"problem", part.problem}};
  Json json = {{"mount_moves_m", part.moved},
               {"mount_turns_deg", kDegFromRad * part.turned},
               {"mount_moves_sigmas", part.moved_sigmas}};
  for (size_t f = 0; f < part.beyond.size(); ++f) {
    json["pad_scatter"].push_back(
        {{"used", scatter_json(part.within[f])}, {"held_out", scatter_json(part.beyond[f])}});
  }
  return json;
}

}  // namespace

Json mount_json(const FrameChain& chain, const MountProblem& problem, const MountSolution& s,
                const std::vector<HeldOut>& held_out) {
  const auto pose = [](const Rigid3& p) {
    const Eigen::Quaterniond q = positive_w(p.rotation);
    return Json{{"position_m", {p.translation.x(), p.translation.y(), p.translation.z()}},
                {"quaternion_wxyz", {q.w(), q.x(), q.y(), q.z()}}};
  };
  Json json = {{"body_from_base", pose(*chain.body_from_base)}};
  if (chain.pan_tilt) {
    const PanTilt& head = *chain.pan_tilt;
    json["pan_tilt"] = {{"base_from_zero", pose(head.base_from_zero)}, {"latency_s", head.latency}};
    for (const auto& [name, axis] : {std::pair{"pan", head.pan}, std::pair{"tilt", head.tilt}}) {
      const Eigen::Vector3d &d = axis.direction, &p = axis.point;
      json["pan_tilt"][name] = {{"direction", {d.x(), d.y(), d.z()}},
                                {"point_m", {p.x(), p.y(), p.z()}},
                                {"scale", axis.scale},
                                {"zero_deg", kDegFromRad * axis.zero}};
    }
  }
  const Eigen::VectorXd sigma = sigmas(s);
  Json names = Json::array(), covariance = Json::array();
  for (Eigen::Index i = 0; i < sigma.size(); ++i) {
    names.push_back({{"name", s.names[static_cast<size_t>(i)]}, {"sigma", sigma[i]}});
    Json row = Json::array();
    for (Eigen::Index k = 0; k < sigma.size(); ++k) row.push_back(s.covariance(i, k));
    covariance.push_back(row);
  }
  json["parameters"] = names;
  json["covariance"] = covariance;
  json["chi_square_per_degree"] = s.chi_square / s.degrees;
  for (const double range : {1.0, 5.0, 10.0}) {
    const MountEffect effect = mount_effect(s, problem.chain, range);
    json["effect"].push_back({{"range_m", range},
                              {"position_sigma_m", effect.position},
                              {"rotation_sigma_deg", kDegFromRad * effect.rotation}});
  }
  for (const Untold& u : untold(s, problem.options)) json["untold"].push_back(in_words(u));
  for (const HeldOut& part : held_out) json["held_out"].push_back(held_out_json(part));
  for (size_t f = 0; f < problem.flights.size(); ++f) {
    const FlightFit& fit = s.flights[f];
    Json flight = {{"name", problem.flights[f].name},
                   {"world_from_pad", pose(s.state.pads[pad_of_flight(s.state, f)])},
                   {"time_offset_s", s.state.offsets[offset_of_flight(s.state, f)]},
                   {"pictures", problem.flights[f].sightings.size()},
                   {"used", std::count(fit.used.begin(), fit.used.end(), true)}};
    const NavigationNoise& n = fit.noise;
    flight["navigation_noise"] = {{"position_m", n.position},
                                  {"rotation_deg", kDegFromRad * n.rotation},
                                  {"position_drift_m", n.position_drift},
                                  {"rotation_drift_deg", kDegFromRad * n.rotation_drift},
                                  {"drift_time_s", n.drift_time}};
    const Wander w = wander(problem, s, f);
    flight["wander"] = {{"piece_s", w.piece}, {"position", w.position}, {"rotation", w.rotation}};
    flight["pad_scatter"] = {{"before", scatter_json(pad_scatter(problem, s, f, s.start))},
                             {"after", scatter_json(pad_scatter(problem, s, f, s.state))}};
    for (const auto& [key, errors] : {std::pair{"before", &fit.before}, std::pair{"after", &fit.after}}) {
      Vector6d sum = Vector6d::Zero(), squares = Vector6d::Zero();
      double n_used = 0;
      for (size_t i = 0; i < errors->size(); ++i) {
        if (!fit.used[i] || !(*errors)[i]) continue;
        sum += *(*errors)[i];
        squares += (*errors)[i]->cwiseAbs2();
        ++n_used;
      }
      const Vector6d mean = sum / n_used, rms = (squares / n_used).cwiseSqrt();
      flight[key] = {{"dc_offset_m", {mean[0], mean[1], mean[2]}},
                     {"dc_offset_deg", {kDegFromRad * mean[3], kDegFromRad * mean[4], kDegFromRad * mean[5]}},
                     {"rms_m", {rms[0], rms[1], rms[2]}},
                     {"rms_deg", {kDegFromRad * rms[3], kDegFromRad * rms[4], kDegFromRad * rms[5]}}};
    }
    json["flights"].push_back(flight);
  }
  return json;
}

}  // namespace perch
