#pragma once

#include <Eigen/Dense>

#include "mount_world.h"

namespace perch {

// The Cramer-Rao bound of mount (d, r), pad (d, r) and time offset of a world's flight: the inverse
// information at the truth, of corners and of navigation's samples with the noise that they have. The samples
// are shared out among the pictures, `nav_rate / camera_rate` each: no smoothing makes more of them. Written
// apart from the solver: no Ceres, no states, S = I + C P C' a picture.
inline Eigen::MatrixXd cramer_rao_bound(MountWorld world, TestRng& rng) {
  const double part = world.camera_rate / world.nav_rate;
  Vector6d variance;
  variance << Eigen::Vector3d::Constant(part * world.position_noise * world.position_noise),
      Eigen::Vector3d::Constant(part * world.rotation_noise * world.rotation_noise);
  world.position_noise = world.rotation_noise = 0;
  const MountProblem problem = world.problem(rng);
  const MountFlight& flight = problem.flights[0];
  const Trajectory truth(flight.nav);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(13, 13);
  for (const Sighting& sight : flight.sightings) {
    const auto p =
        predict_sight({problem.chain, truth, flight.gimbal, sight.timestamp_ns}, world.body_from_base,
                      world.world_from_pad, world.time_offset, HeadVector::Zero());
    if (!p) continue;
    const auto rows = 2 * static_cast<Eigen::Index>(sight.observations.size());
    Eigen::MatrixXd J(rows, 6);
    for (size_t i = 0; i < sight.observations.size(); ++i) {
      Eigen::Vector2d error;
      PixelJacobian by_pose;
      if (!whitened_error(flight.camera, p->camera_from_target, sight.observations[i], &error, &by_pose))
        by_pose.setZero();
      J.middleRows<2>(2 * static_cast<Eigen::Index>(i)) = by_pose;
    }
    Eigen::MatrixXd by_unknowns(rows, 13);
    by_unknowns << J * p->by_mount, J * p->by_pad, J * p->by_offset;
    const Eigen::MatrixXd C = J * p->by_correction;
    const Eigen::MatrixXd S =
        Eigen::MatrixXd::Identity(rows, rows) + C * variance.asDiagonal() * C.transpose();
    information += by_unknowns.transpose() * S.llt().solve(by_unknowns);
  }
  return information.inverse();
}

}  // namespace perch
