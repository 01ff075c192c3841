#pragma once

#include <cmath>
#include <vector>

#include "calib/mount/mount_solver.h"
#include "perch/flight/head_angles.h"
#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"
#include "perch/pose/pose_estimator.h"
#include "support/pose_world.h"
#include "support/sharp_target.h"

namespace perch {

// A flight over a pad as poses and corners, no pictures: what the calibration's tests need of the world. The
// vehicle's world is NED, its body FRD.
struct MountWorld {
  double duration = 60;                 // s
  double camera_rate = 15;              // Hz
  double nav_rate = 100;                // Hz
  double roll_pitch = 8 * kRadFromDeg;  // amplitude
  double yaw_amplitude = 2.5;           // rad
  double aside = 0.9;                   // horizontal amplitude at 5 m of height, m; grows with height
  double low = 2.5, high = 7;           // m
  double position_noise = 0.02, rotation_noise = 0.3 * kRadFromDeg;
  double position_drift = 0, rotation_drift = 0, drift_time = 20;
  double corner_noise_px = 0.2;
  double time_offset = 0.04;  // camera clock minus navigation clock, s
  double wrong_poses = 0;     // part of the pictures whose pose is anything
  // 10 deg and 20 cm off the nominal mount.
  Rigid3 nominal{rotation_from_ypr({M_PI / 2, 0, 0}), {0.1, 0, 0.05}};
  Rigid3 body_from_base{(so3_exp(Eigen::Vector3d(0.5, -0.6, 0.62).normalized() * 10 * kRadFromDeg) *
                         rotation_from_ypr({M_PI / 2, 0, 0})),
                        {0.22, -0.12, 0.15}};
  Rigid3 world_from_pad{so3_exp({0.02, -0.01, 0}) * rotation_from_ypr({0.7, 0, M_PI}), {3, -2, 0.4}};
  std::optional<PanTilt> head;  // true
  std::optional<PanTilt> nominal_head;
  double head_swing = 0.25, head_rate = 0.8;  // rad, rad/s
  double head_noise = 0.0;

  Rigid3 world_from_body(double t) const {
    const auto wave = [t](double period, double phase) { return std::sin(2 * M_PI * t / period + phase); };
    const double height = 0.5 * (low + high) + 0.5 * (high - low) * wave(23, -1.2);
    const double reach = aside * height / 5;
    const Eigen::Vector3d place(reach * (0.7 * wave(7.3, 0.3) + 0.3 * wave(3.1, 2)),
                                reach * (0.7 * wave(8.9, 1.1) + 0.3 * wave(2.7, 0.5)), -height);
    const double yaw = yaw_amplitude * wave(31, 0.2),
                 roll = roll_pitch * (0.7 * wave(4.1, 0.4) + 0.3 * wave(1.9, 1)),
                 pitch = roll_pitch * (0.7 * wave(5.3, 2.2) + 0.3 * wave(2.3, 0.1));
    return {rotation_from_ypr({yaw, pitch, roll}), world_from_pad.translation + place};
  }

  HeadAngles head_at(double t) const {
    return {head_swing * std::sin(head_rate / head_swing * t),
            0.8 * head_swing * std::sin(0.83 * head_rate / head_swing * t + 1)};
  }

  MountFlight flight(TestRng& rng, const std::string& name = "flight") const {
    constexpr int64_t kStart = 1'700'000'000'000'000'000;
    const LandingTarget target = sharp_target();
    MountFlight f{name, wide_camera(), {}, {}, {}};
    PoseEstimator estimator(target, f.camera, {});
    const int nav_count = static_cast<int>((duration + 1) * nav_rate);
    Vector6d drift;
    const double kept = std::exp(-1 / (nav_rate * drift_time));
    drift << rng.normal3(position_drift), rng.normal3(rotation_drift);
    for (int i = 0; i < nav_count; ++i) {
      const double t = i / nav_rate - 0.5;
      Vector6d step;
      step << rng.normal3(position_drift), rng.normal3(rotation_drift);
      drift = kept * drift + std::sqrt(1 - kept * kept) * step;
      const Rigid3 truth = world_from_body(t);
      NavSample s;
      s.timestamp_ns = kStart + std::llround(1e9 * (t - time_offset));
      s.world_from_body = {
          (so3_exp(rng.normal3(rotation_noise) + drift.tail<3>()) * truth.rotation).normalized(),
          truth.translation + rng.normal3(position_noise) + drift.head<3>()};
      f.nav.samples.push_back(s);
    }
    if (head) {
      for (int i = 0; i < static_cast<int>((duration + 1) * 50); ++i) {
        const double t = i / 50.0 - 0.5;
        const HeadAngles a = head_at(t);
        f.gimbal.push_back({kStart + std::llround(1e9 * (t + head->latency)), a.pan + rng.normal(head_noise),
                            a.tilt + rng.normal(head_noise), 0});
      }
    }
    for (int i = 0; i < static_cast<int>(duration * camera_rate); ++i) {
      const double t = i / camera_rate + 0.0037;
      FrameChain chain;
      chain.pan_tilt = head;
      const Rigid3 body_from_camera = body_from_base * base_from_camera(chain, head_at(t));
      const Rigid3 pose = inverse(world_from_body(t) * body_from_camera) * world_from_pad;
      auto seen_corners = seen(target, f.camera, pose, rng, corner_noise_px, corner_noise_px);
      const bool inside = seen_corners.size() == target.features.size() &&
                          std::all_of(seen_corners.begin(), seen_corners.end(), [&](const Correspondence& c) {
                            return c.pixel.x() > 0 && c.pixel.y() > 0 && c.pixel.x() < f.camera.width() - 1 &&
                                   c.pixel.y() < f.camera.height() - 1;
                          });
      if (!inside) continue;
      if (rng.uniform(0, 1) < wrong_poses) {
        const Rigid3 other = random_view(rng, rng.uniform(2, 8), rng.uniform(0, 0.8));
        seen_corners = seen(target, f.camera, other, rng, corner_noise_px, corner_noise_px);
      }
      const PoseResult result = estimator.estimate(seen_corners);
      Sighting sight;
      sight.timestamp_ns = kStart + std::llround(1e9 * t);
      sight.frame = static_cast<size_t>(i);
      if (result.status == PoseStatus::kOk) sight.camera_from_target = result.camera_from_target;
      for (const Correspondence& c : seen_corners) {
        const Eigen::Vector2d& p = target.features[static_cast<size_t>(c.feature)].point;
        sight.observations.push_back({Eigen::Vector3d(p.x(), p.y(), 0), c.pixel, c.sigma_px});
      }
      f.sightings.push_back(sight);
    }
    return f;
  }

  MountProblem problem(TestRng& rng) const {
    MountProblem p;
    FrameChain chain;
    chain.body_from_base = nominal;
    chain.pan_tilt = nominal_head;
    p.chain = mount_chain(chain);
    p.nominal_mount = nominal_mount(chain);
    p.flights.push_back(flight(rng));
    return p;
  }
};

// Half a minute, 150 pictures: deviations are 2.4 times those of the world above, and a solve takes a fifth.
inline MountWorld small_world() {
  MountWorld world;
  world.duration = 30;
  world.camera_rate = 5;
  return world;
}

}  // namespace perch
