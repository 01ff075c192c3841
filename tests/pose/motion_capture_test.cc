// The whole chain on real pictures: fifteen photographs of an AprilGrid on a floor, the camera's body tracked
// by motion capture (shared/flights/real_mocap). The grid does not move, so where each picture puts it in the
// world,
//
//   world_from_target = world_from_body(t) * body_from_camera * camera_from_target,
//
// must be one place. Mount and grid are unknown: they are what makes the places agree best.

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <map>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <opencv2/imgcodecs.hpp>

#include "perch/camera/camera_model.h"
#include "perch/camera/csv.h"
#include "perch/detection/apriltag_detector.h"
#include "perch/geometry/so3.h"
#include "perch/pose/pose_estimator.h"
#include "support/aprilgrid.h"
#include "support/shared.h"

namespace perch {
namespace {

double degrees(double rad) { return rad * 180 / M_PI; }

struct Sight {
  Rigid3 world_from_body, camera_from_target;
};

LandingTarget grid_target() {
  LandingTarget target;
  target.layout = real_mocap_board();
  for (const Tag& tag : std::get<AprilTagBoard>(target.layout).tags) {
    for (int k = 0; k < 4; ++k) target.features.push_back({tag_corner(tag, k), ""});
  }
  return target;
}

std::map<int64_t, Rigid3> read_nav(const std::filesystem::path& file) {
  std::map<int64_t, Rigid3> nav;
  CsvReader csv(file);
  while (csv.next()) {
    const auto fields = csv.fields();
    const auto number = [&](size_t i) { return *parse_finite(fields[i]); };
    nav[*parse_integer(fields[0])] = {
        Eigen::Quaterniond(number(4), number(5), number(6), number(7)).normalized(),
        Eigen::Vector3d(number(1), number(2), number(3))};
  }
  return nav;
}

Rigid3 at(const std::map<int64_t, Rigid3>& nav, int64_t time) {
  const auto after = nav.lower_bound(time);
  const auto before = std::prev(after);
  const double s =
      static_cast<double>(time - before->first) / static_cast<double>(after->first - before->first);
  return interpolate(before->second, after->second, s);
}

std::vector<Sight> read_sights(const std::filesystem::path& flight) {
  const auto nav = read_nav(flight / "mav0/nav0/data.csv");
  const LandingTarget target = grid_target();
  const CameraModel camera = read_camera_model(flight / "mav0/cam0/sensor.yaml");
  AprilTagDetector detector(real_mocap_board());
  PoseEstimator estimator(target, camera, {});
  std::vector<Sight> sights;
  CsvReader frames(flight / "mav0/cam0/data.csv");
  while (frames.next()) {
    const auto picture = flight / "mav0/cam0/data" / frames.fields()[1];
    const Detection& found = detector.detect(cv::imread(picture, cv::IMREAD_GRAYSCALE), {});
    const PoseResult pose = estimator.estimate(found.correspondences, {});
    EXPECT_EQ(pose.status, PoseStatus::kOk) << picture << ", rms " << pose.reprojection_rms_px << " px";
    if (pose.status != PoseStatus::kOk) continue;
    sights.push_back({at(nav, *parse_integer(frames.fields()[0])), pose.camera_from_target.mean});
  }
  return sights;
}

// OpenCV's PARK: closed form, rotation first. The start.
Rigid3 hand_eye(const std::vector<Sight>& sights) {
  std::vector<cv::Mat> R_world_body, t_world_body, R_camera_target, t_camera_target;
  const auto push = [](const Rigid3& transform, std::vector<cv::Mat>& R, std::vector<cv::Mat>& t) {
    cv::eigen2cv(transform.rotation.toRotationMatrix(), R.emplace_back());
    cv::eigen2cv(transform.translation, t.emplace_back());
  };
  for (const Sight& sight : sights) {
    push(sight.world_from_body, R_world_body, t_world_body);
    push(sight.camera_from_target, R_camera_target, t_camera_target);
  }
  cv::Mat R, t;
  cv::calibrateHandEye(R_world_body, t_world_body, R_camera_target, t_camera_target, R, t,
                       cv::CALIB_HAND_EYE_PARK);
  Eigen::Matrix3d rotation;
  Rigid3 body_from_camera;
  cv::cv2eigen(R, rotation);
  cv::cv2eigen(t, body_from_camera.translation);
  body_from_camera.rotation = Eigen::Quaterniond(rotation);
  return body_from_camera;
}

// Where the grid is, and by how much the pictures disagree about it.
struct Place {
  Rigid3 world_from_target;
  double rms_m = 0, rms_rad = 0;
};

Place grid_place(const std::vector<Sight>& sights, const Rigid3& body_from_camera) {
  std::vector<Rigid3> places;
  for (const Sight& sight : sights) {
    places.push_back(sight.world_from_body * body_from_camera * sight.camera_from_target);
  }
  Place place{places[0]};
  const double n = static_cast<double>(places.size());
  for (int i = 0; i < 5; ++i) {  // the mean rotation by its fixed point; the first step is nearly it
    Eigen::Vector3d turn = Eigen::Vector3d::Zero(), sum = Eigen::Vector3d::Zero();
    for (const Rigid3& p : places) {
      turn += so3_log(p.rotation * place.world_from_target.rotation.conjugate()) / n;
      sum += p.translation / n;
    }
    place.world_from_target = {so3_exp(turn) * place.world_from_target.rotation, sum};
  }
  for (const Rigid3& p : places) {
    place.rms_m += (p.translation - place.world_from_target.translation).squaredNorm() / n;
    place.rms_rad += std::pow(p.rotation.angularDistance(place.world_from_target.rotation), 2) / n;
  }
  place.rms_m = std::sqrt(place.rms_m);
  place.rms_rad = std::sqrt(place.rms_rad);
  return place;
}

// Gauss-Newton on the mount's six numbers, the residuals' derivatives by differences. Positions and turns
// count alike at 5 mm and 0.26 deg, the README's scatter of both.
Rigid3 refined(const std::vector<Sight>& sights, Rigid3 body_from_camera) {
  const auto moved = [&](const Eigen::VectorXd& x) {
    return Rigid3{so3_exp(x.tail<3>()) * body_from_camera.rotation,
                  body_from_camera.translation + x.head<3>()};
  };
  const auto residuals = [&](const Eigen::VectorXd& x) {
    const Rigid3 mount = moved(x);
    const Rigid3 mean = grid_place(sights, mount).world_from_target;
    Eigen::VectorXd r(6 * static_cast<int>(sights.size()));
    for (size_t i = 0; i < sights.size(); ++i) {
      const Rigid3 p = sights[i].world_from_body * mount * sights[i].camera_from_target;
      r.segment<3>(6 * static_cast<int>(i)) = (p.translation - mean.translation) / 0.005;
      r.segment<3>(6 * static_cast<int>(i) + 3) = so3_log(p.rotation * mean.rotation.conjugate()) / 0.0045;
    }
    return r;
  };
  for (int iteration = 0; iteration < 10; ++iteration) {
    const Eigen::VectorXd zero = Eigen::VectorXd::Zero(6), r = residuals(zero);
    Eigen::MatrixXd J(r.size(), 6);
    for (int k = 0; k < 6; ++k) {
      const Eigen::VectorXd step = 1e-6 * Eigen::VectorXd::Unit(6, k);
      J.col(k) = (residuals(step) - residuals(-step)) / 2e-6;
    }
    body_from_camera = moved((J.transpose() * J).ldlt().solve(-J.transpose() * r));
  }
  return body_from_camera;
}

TEST(MotionCapture, EveryPicturePutsTheGridInTheSamePlace) {
  const auto flight = shared_flight("real_mocap");
  if (flight.empty()) GTEST_SKIP() << "no real_mocap";
  const std::vector<Sight> sights = read_sights(flight);
  ASSERT_EQ(sights.size(), 15u);

  const Rigid3 start = hand_eye(sights);
  const Place park = grid_place(sights, start);
  const Place best = grid_place(sights, refined(sights, start));
  const Eigen::Vector3d centre = best.world_from_target * Eigen::Vector3d(0.33, 0.33, 0);
  const Eigen::Vector3d normal = best.world_from_target.rotation * Eigen::Vector3d::UnitZ();
  std::printf(
      "PARK %.2f mm, %.3f deg; refined %.2f mm, %.3f deg; grid's centre at %.3f %.3f %.3f m, %.2f deg from "
      "level\n",
      1e3 * park.rms_m, degrees(park.rms_rad), 1e3 * best.rms_m, degrees(best.rms_rad), centre.x(),
      centre.y(), centre.z(), degrees(std::acos(normal.z())));

  // Measured; 10 % of room for another compiler's rounding in the detector. An independent run over all
  // thirty pictures, these among them, quotes 5.3 mm and 0.26 deg for PARK.
  EXPECT_LE(park.rms_m, 0.0059);
  EXPECT_LE(degrees(park.rms_rad), 0.29);
  EXPECT_LE(best.rms_m, 0.0039);
  EXPECT_LE(degrees(best.rms_rad), 0.29);
}

}  // namespace
}  // namespace perch
