#include "perch/import/camera_turns.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "perch/estimator/estimator.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr int kFeatures = 300;
// Of the strongest corner, which may be the pad's: asphalt's and grass's are hundreds of times weaker.
constexpr double kFeatureQuality = 0.001;
constexpr double kFeatureDistance = 8;  // px
// Tracked there and back a feature is where it was, or it is another by now.
constexpr float kRoundTrip = 1;      // px
constexpr double kPlaneError = 1.5;  // px; farther off, a feature is not of the plane
constexpr size_t kFewestTracks = 30;
// Wider than usual: asphalt and grass from 6 m have more noise than contrast.
constexpr int kTrackWindow = 31;  // px
// A turn's, as some hundred features of a fifth of a pixel give it; residuals say what it really is.
constexpr double kTrackSigma = 1e-3;

struct Seen {
  int64_t timestamp_ns = 0;
  cv::Mat grey;
  std::optional<UncertainRigid3> camera_from_target;
};

// A pixel's direction as a point at z = 1; empty where it looks too far aside.
std::optional<cv::Point2d> ray_of(const CameraModel& camera, const cv::Point2f& pixel) {
  const auto ray = camera.ray_from_pixel({pixel.x, pixel.y});
  if (!ray || ray->z() < 0.2) return std::nullopt;
  return cv::Point2d(ray->x() / ray->z(), ray->y() / ray->z());
}

CameraTurn turn_by_poses(const UncertainRigid3& begin, const UncertainRigid3& end) {
  CameraTurn turn;
  turn.turn = so3_log(begin.mean.rotation * end.mean.rotation.conjugate());
  turn.sigma = std::sqrt(
      (begin.covariance.bottomRightCorner<3, 3>() + end.covariance.bottomRightCorner<3, 3>()).trace() / 3);
  turn.by_target = true;
  return turn;
}

}  // namespace

std::optional<Eigen::Vector3d> turn_by_tracks(const cv::Mat& begin, const cv::Mat& end,
                                              const CameraModel& camera) {
  // Noise has corners, too, which are elsewhere in the next picture.
  cv::Mat smooth_begin, smooth_end;
  cv::GaussianBlur(begin, smooth_begin, {5, 5}, 0);
  cv::GaussianBlur(end, smooth_end, {5, 5}, 0);
  std::vector<cv::Point2f> from, to, back;
  cv::goodFeaturesToTrack(smooth_begin, from, kFeatures, kFeatureQuality, kFeatureDistance);
  if (from.size() < kFewestTracks) return std::nullopt;
  std::vector<uchar> found, found_back;
  std::vector<float> ignored;
  const cv::Size window(kTrackWindow, kTrackWindow);
  cv::calcOpticalFlowPyrLK(smooth_begin, smooth_end, from, to, found, ignored, window);
  cv::calcOpticalFlowPyrLK(smooth_end, smooth_begin, to, back, found_back, ignored, window);
  std::vector<cv::Point2d> rays_begin, rays_end;
  for (size_t i = 0; i < from.size(); ++i) {
    if (!found[i] || !found_back[i] || cv::norm(back[i] - from[i]) > kRoundTrip) continue;
    const auto a = ray_of(camera, from[i]), b = ray_of(camera, to[i]);
    if (!a || !b) continue;
    rays_begin.push_back(*a);
    rays_end.push_back(*b);
  }
  if (rays_begin.size() < kFewestTracks) return std::nullopt;
  cv::Mat inliers;
  const cv::Mat H =
      cv::findHomography(rays_begin, rays_end, cv::RANSAC, kPlaneError / camera.intrinsics()[0], inliers);
  const auto count = static_cast<size_t>(inliers.empty() ? 0 : cv::countNonZero(inliers));
  if (H.empty() || count < kFewestTracks || 2 * count < rays_begin.size()) return std::nullopt;

  std::vector<cv::Mat> rotations, translations, normals;
  cv::decomposeHomographyMat(H, cv::Mat::eye(3, 3, CV_64F), rotations, translations, normals);
  std::optional<Eigen::Vector3d> turn;
  double nearest = -1;
  for (size_t i = 0; i < rotations.size(); ++i) {
    const double along_axis = std::abs(normals[i].at<double>(2));
    Eigen::Matrix3d end_from_begin;
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) end_from_begin(r, c) = rotations[i].at<double>(r, c);
    }
    if (!end_from_begin.allFinite() || !(along_axis > nearest)) continue;
    nearest = along_axis;
    turn = so3_log(Eigen::Quaterniond(nearest_rotation(end_from_begin)).conjugate());
  }
  return turn;
}

std::vector<CameraTurn> camera_turns(ImageSource& pictures, const CameraModel& camera,
                                     const RunConfig* config, const std::function<void()>& done) {
  std::optional<Estimator> estimator;
  if (config) estimator.emplace(*config, camera);
  std::vector<CameraTurn> turns;
  std::optional<Seen> last;
  Frame frame;
  while (pictures.next(frame)) {
    done();
    if (frame.grey.empty()) {
      last.reset();
      continue;
    }
    Seen now{frame.timestamp_ns, frame.grey, {}};
    if (estimator) {
      const Estimate estimate = estimator->process(frame);
      if (estimate.status == EstimateStatus::kOk) now.camera_from_target = estimate.camera_from_target;
    }
    if (last && last->grey.size() == now.grey.size()) {
      std::optional<CameraTurn> turn;
      if (last->camera_from_target && now.camera_from_target) {
        turn = turn_by_poses(*last->camera_from_target, *now.camera_from_target);
      } else if (const auto tracked = turn_by_tracks(last->grey, now.grey, camera)) {
        turn = CameraTurn{0, 0, *tracked, kTrackSigma, false};
      }
      if (turn) {
        turn->begin_ns = last->timestamp_ns;
        turn->end_ns = now.timestamp_ns;
        turns.push_back(*turn);
      }
    }
    last = std::move(now);
  }
  return turns;
}

}  // namespace perch
