#include "perch/station/picture_message.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "perch/analysis/overlay.h"
#include "perch/station/bit_picture.h"

namespace perch {
namespace {

using Json = nlohmann::json;

constexpr int kGreyWidth = 320, kGreyHeight = 240;      // px, at most; 6 to 10 kB as JPEG
constexpr int kBinaryWidth = 160, kBinaryHeight = 120;  // 2.4 kB at most
constexpr int kJpegQuality = 55;

double tenth(double value) { return std::round(10 * value) / 10; }
double thousandth(double value) { return std::round(1000 * value) / 1000; }

// One sigma of where the pad's centre is in the picture.
Json ellipse_json(const CameraModel& camera, const UncertainRigid3& camera_from_target) {
  Matrix23d J;
  const auto pixel = camera.pixel_from_camera(camera_from_target.mean.translation, &J);
  if (!pixel) return nullptr;
  const Eigen::Matrix2d covariance = J * camera_from_target.covariance.topLeftCorner<3, 3>() * J.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(covariance);
  if (axes.info() != Eigen::Success || !covariance.allFinite()) return nullptr;
  const Eigen::Vector2d sigma = axes.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Eigen::Vector2d longest = axes.eigenvectors().col(1);
  return {tenth(pixel->x()), tenth(pixel->y()), sigma.y(), sigma.x(), std::atan2(longest.y(), longest.x())};
}

// Measured minus expected, for methods that measure corners.
Json corner_residuals(const LandingTarget& target, const CameraModel& camera, const Estimate& estimate) {
  Json list = Json::array();
  for (const Correspondence& c : estimate.correspondences) {
    if (c.feature < 0 || static_cast<size_t>(c.feature) >= target.features.size()) continue;
    const Eigen::Vector2d& p = target.features[static_cast<size_t>(c.feature)].point;
    const auto expected =
        camera.pixel_from_camera(estimate.camera_from_target.mean * Eigen::Vector3d(p.x(), p.y(), 0));
    if (!expected) continue;
    const Eigen::Vector2d off = c.pixel - *expected;
    const Eigen::Vector2d direction =
        off.norm() > 0 ? Eigen::Vector2d(off.normalized()) : Eigen::Vector2d(1, 0);
    list.push_back({tenth(expected->x()), tenth(expected->y()), thousandth(direction.x()),
                    thousandth(direction.y()), thousandth(off.norm())});
  }
  return list;
}

Json residuals_json(const LandingTarget& target, const CameraModel& camera, const Estimate& estimate) {
  if (estimate.residuals.empty()) return corner_residuals(target, camera, estimate);
  Json list = Json::array();
  for (const EdgeResidual& e : estimate.residuals) {
    list.push_back({tenth(static_cast<double>(e.pixel.x())), tenth(static_cast<double>(e.pixel.y())),
                    thousandth(static_cast<double>(e.normal.x())),
                    thousandth(static_cast<double>(e.normal.y())),
                    thousandth(static_cast<double>(e.left_px))});
  }
  return list;
}

// The part of the picture that is sent: all of it; or what the measured features take up, with a margin.
cv::Rect part_of(const SeenPicture& picture, bool close) {
  const cv::Rect whole({0, 0}, picture.grey.size());
  if (!close || picture.estimate.correspondences.empty()) return whole;
  Eigen::AlignedBox2d box;
  for (const Correspondence& c : picture.estimate.correspondences) box.extend(c.pixel);
  const Eigen::Vector2d centre = box.center();
  // In the shape of the thumbnail; 80 px at least, so that a far target is shown four times as large.
  const double half_height =
      std::max({40.0, 0.75 * box.sizes().y(), 0.75 * box.sizes().x() * kGreyHeight / kGreyWidth});
  const double half_width = half_height * kGreyWidth / kGreyHeight;
  const cv::Rect part(static_cast<int>(centre.x() - half_width), static_cast<int>(centre.y() - half_height),
                      static_cast<int>(2 * half_width), static_cast<int>(2 * half_height));
  const cv::Rect seen = part & whole;
  return seen.empty() ? whole : seen;
}

cv::Mat fitted(const cv::Mat& grey, int width, int height, bool enlarge) {
  double scale = std::min(static_cast<double>(width) / grey.cols, static_cast<double>(height) / grey.rows);
  if (!enlarge) scale = std::min(scale, 1.0);
  const cv::Size size(std::max(1, static_cast<int>(std::lround(grey.cols * scale))),
                      std::max(1, static_cast<int>(std::lround(grey.rows * scale))));
  cv::Mat result;
  cv::resize(grey, result, size, 0, 0, scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

// What the estimator's own threshold makes of it; where it had none, halfway between dark and light.
std::vector<uint8_t> binary(const cv::Mat& grey, int threshold) {
  const cv::Mat small = fitted(grey, kBinaryWidth, kBinaryHeight, false);
  if (threshold < 0) {
    double low = 0, high = 0;
    cv::minMaxLoc(small, &low, &high);
    threshold = static_cast<int>((low + high) / 2);
  }
  return pack_bits(small > threshold);
}

void append(const auto& from, std::vector<uint8_t>& bytes) {
  bytes.insert(bytes.end(), from.begin(), from.end());
}

}  // namespace

Json outline_json(const LandingTarget& target, const CameraModel& camera, const Rigid3& camera_from_target) {
  Json outlines = Json::array();
  for (const auto& line : projected_outlines(target, camera, camera_from_target)) {
    std::vector<cv::Point2f> all, few;
    for (const Eigen::Vector2d& p : line)
      all.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
    // A line whose ends meet has no two ends to begin from: as an open one it would lose a corner.
    const bool closed = all.size() > 2 && cv::norm(all.front() - all.back()) < 1e-3;
    if (closed) all.pop_back();
    cv::approxPolyDP(all, few, 0.2, closed);
    if (closed) few.push_back(few.front());
    Json points = Json::array();
    for (const cv::Point2f& p : few) {
      points.push_back(tenth(static_cast<double>(p.x)));
      points.push_back(tenth(static_cast<double>(p.y)));
    }
    outlines.push_back(std::move(points));
  }
  return outlines;
}

Json overlay_json(const LandingTarget& target, const CameraModel& camera, const Estimate& estimate) {
  Json overlay = {
      {"outline", Json::array()}, {"labels", Json::array()}, {"edges", Json::array()}, {"ellipse", nullptr}};
  for (const Correspondence& c : estimate.correspondences) {
    if (c.feature < 0 || static_cast<size_t>(c.feature) >= target.features.size()) continue;
    overlay["labels"].push_back(
        {target.features[static_cast<size_t>(c.feature)].name, tenth(c.pixel.x()), tenth(c.pixel.y())});
  }
  if (estimate.status != EstimateStatus::kOk) return overlay;
  overlay["outline"] = outline_json(target, camera, estimate.camera_from_target.mean);
  overlay["edges"] = residuals_json(target, camera, estimate);
  overlay["ellipse"] = ellipse_json(camera, estimate.camera_from_target);
  return overlay;
}

std::vector<uint8_t> picture_message(const SeenPicture& picture, const LandingTarget& target,
                                     const CameraModel& camera, const PictureWish& wish) {
  std::vector<uint8_t> jpeg, bits;
  cv::Rect part({0, 0}, picture.grey.size());
  if (!picture.grey.empty()) {
    part = part_of(picture, wish.close);
    const cv::Mat grey = picture.grey(part);
    if (wish.grey) {
      cv::imencode(".jpg", fitted(grey, kGreyWidth, kGreyHeight, wish.close), jpeg,
                   {cv::IMWRITE_JPEG_QUALITY, kJpegQuality});
    }
    if (wish.binary) bits = binary(grey, picture.estimate.threshold);
  }
  Json json = overlay_json(target, camera, picture.estimate);
  json["t"] = std::to_string(picture.estimate.timestamp_ns);
  json["status"] = static_cast<int>(picture.estimate.status);
  json["problem"] = picture.estimate.problem;
  json["size"] = {camera.width(), camera.height()};
  json["part"] = {part.x, part.y, part.width, part.height};
  json["jpeg"] = jpeg.size();
  json["bits"] = bits.size();
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  const auto length = static_cast<uint32_t>(text.size());
  std::vector<uint8_t> bytes;
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<uint8_t>(length >> (8 * i)));
  append(text, bytes);
  append(jpeg, bytes);
  append(bits, bytes);
  return bytes;
}

}  // namespace perch
