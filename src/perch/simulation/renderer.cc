#include "perch/simulation/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace perch {

namespace {

// An edge in a pixel is spread by the lens from where it is to a quarter of a pixel; see PointSpread.
constexpr int kCells = 4;
constexpr float kSky = 0.5F;
constexpr double kFarthest = 1e4;     // m; beyond it the ground is sky
constexpr double kMotionStep = 0.25;  // px between two poses of an exposure
constexpr int kMostPoses = 48;

// Where the rays of one pose meet the target's plane.
struct PlaneView {
  Eigen::Matrix3d target_from_camera;
  Eigen::Vector3d camera_in_target;

  explicit PlaneView(const Rigid3& camera_from_target) {
    const Rigid3 inverse_pose = inverse(camera_from_target);
    target_from_camera = inverse_pose.rotation.toRotationMatrix();
    camera_in_target = inverse_pose.translation;
  }
  // NaN for a ray that does not come down on the face.
  Eigen::Vector2d point(const Eigen::Vector3d& ray) const {
    const Eigen::Vector3d direction = target_from_camera * ray;
    const double range = -camera_in_target.z() / direction.z();
    if (!(direction.z() < 0 && range > 0 && range < kFarthest)) {
      return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
    }
    return camera_in_target.head<2>() + range * direction.head<2>();
  }
  void points(const Eigen::Vector3d* rays, std::vector<Eigen::Vector2d>& out) const {
    for (size_t i = 0; i < out.size(); ++i) out[i] = point(rays[i]);
  }
};

Eigen::Vector2d bilinear(const Quad& q, double s, double t) {
  return (1 - t) * ((1 - s) * q[0] + s * q[1]) + t * ((1 - s) * q[3] + s * q[2]);
}

}  // namespace

// What is added up while a picture is taken, margins included.
struct Renderer::Layers {
  cv::Mat_<float> means;   // of each pixel
  cv::Mat_<float> detail;  // what cells that differ from their pixel's mean add to the pixels around, spread
};

Renderer::Renderer(const CameraModel& camera, const LandingTarget& target, const SceneOptions& scene,
                   const OpticsOptions& optics)
    : camera_(camera),
      scene_(scene),
      patches_(target.patches),
      ground_(scene.ground),
      spread_(optics.psf_sigma_px, optics.psf_sigma_px > 0 ? kCells : 1),
      rays_(camera, spread_.radius()),
      vignette_(camera.height(), camera.width()) {
  const double direction = scene.shadow ? scene.shadow->direction : 0;
  shadow_normal_ = {std::cos(direction), std::sin(direction)};
  const int margin = rays_.margin();
  for (int v = 0; v < camera.height(); ++v) {
    const Eigen::Vector3d* upper = rays_.corners(v + margin) + margin;
    const Eigen::Vector3d* lower = rays_.corners(v + margin + 1) + margin;
    for (int u = 0; u < camera.width(); ++u) {
      const Eigen::Vector3d ray = upper[u] + upper[u + 1] + lower[u] + lower[u + 1];
      const double cosine = std::max(0.0, ray.z() / ray.norm());
      const double kept = 1 - optics.vignetting * (1 - std::pow(cosine, 4));
      vignette_(v, u) = ray.allFinite() ? static_cast<float>(scene.illumination * kept) : 0;
    }
  }
}

cv::Mat_<float> Renderer::radiance(const Rigid3& camera_from_target, double time) const {
  return expose([&](int) { return camera_from_target; }, true, time);
}

cv::Mat_<float> Renderer::radiance(const PoseAt& camera_from_target, const ShutterOptions& shutter,
                                   double time) const {
  int poses = 1;
  if (shutter.motion_blur) {
    const double steps = std::ceil(motion_px(camera_from_target, shutter) / kMotionStep);
    poses = static_cast<int>(std::clamp<double>(steps, 1, kMostPoses));
  }
  cv::Mat_<float> sum;
  for (int i = 0; i < poses; ++i) {
    // The middles of equal parts: their mean is the middle of the exposure.
    const double moment = shutter.exposure * ((i + 0.5) / poses - 0.5);
    const auto pose_of_row = [&](int row) {
      return camera_from_target(moment + shutter.readout * (row / (camera_.height() - 1.0) - 0.5));
    };
    const cv::Mat_<float> part = expose(pose_of_row, shutter.readout == 0, time + moment);
    if (i == 0) {
      sum = part;
    } else {
      sum += part;
    }
  }
  if (poses > 1) sum *= 1.0F / static_cast<float>(poses);
  return sum;
}

// The picture without and with the lens's spreading.
template <typename PoseOfRow>
cv::Mat_<float> Renderer::expose(const PoseOfRow& pose_of_row, bool one_pose, double time) const {
  const int width = rays_.width(), height = rays_.height(), margin = rays_.margin();
  Layers layers{cv::Mat_<float>(height, width), cv::Mat_<float>(height, width, 0.0F)};
  std::vector<Eigen::Vector2d> upper(static_cast<size_t>(width) + 1), lower(upper);
  PlaneView view(pose_of_row(-margin));
  view.points(rays_.corners(0), lower);
  for (int v = 0; v < height; ++v) {
    if (one_pose) {
      std::swap(upper, lower);
    } else {
      view = PlaneView(pose_of_row(v - margin));
      view.points(rays_.corners(v), upper);
    }
    view.points(rays_.corners(v + 1), lower);
    for (int u = 0; u < width; ++u) {
      const auto i = static_cast<size_t>(u);
      const Quad corners{upper[i], upper[i + 1], lower[i + 1], lower[i]};
      const Eigen::Vector2d centre = (corners[0] + corners[1] + corners[2] + corners[3]) / 4;
      const double radius = std::sqrt(
          std::max(std::max((corners[0] - centre).squaredNorm(), (corners[1] - centre).squaredNorm()),
                   std::max((corners[2] - centre).squaredNorm(), (corners[3] - centre).squaredNorm())));
      if (!std::isfinite(radius)) {
        layers.means(v, u) = kSky;
      } else if (const auto coverage = one_colour(corners, centre, radius)) {
        layers.means(v, u) =
            static_cast<float>(light(*coverage, centre, 2 * radius) * shadow(centre, radius, time));
      } else {
        shade_cells(corners, centre, radius, u, v, time, layers);
      }
    }
  }
  cv::Mat_<float> picture = layers.means;
  if (margin > 0) {
    const cv::Mat kernel(1, 2 * spread_.radius() + 1, CV_32F, const_cast<float*>(spread_.of_pixel()));
    cv::sepFilter2D(layers.means, picture, CV_32F, kernel, kernel);
    picture += layers.detail;
  }
  cv::Mat_<float> lit;
  cv::multiply(picture(cv::Rect(margin, margin, camera_.width(), camera_.height())), vignette_, lit);
  return lit;
}

// What a pixel shows when no edge crosses it.
std::optional<Coverage> Renderer::one_colour(const Quad& corners, const Eigen::Vector2d& centre,
                                             double radius) const {
  if (const auto uniform = patches_.uniform(centre, radius)) return uniform;
  // Near an edge; four of five such pixels prove whole when cut.
  constexpr double kRounding = 1e-9;
  const Coverage c = patches_.mean(corners);
  const double most = std::max({c.white, c.black, 1 - c.white - c.black});
  return most > 1 - kRounding ? std::optional(c) : std::nullopt;
}

// A pixel that an edge crosses: its cells one by one. What they differ from their mean is spread right here
// to the pixels around; the mean is spread with all others.
void Renderer::shade_cells(const Quad& corners, const Eigen::Vector2d& centre, double size, int column,
                           int row, double time, Layers& layers) const {
  const int n = spread_.cells();
  std::array<float, kCells * kCells> cells;
  const double lit = shadow(centre, size, time);
  const double ground = ground_.reflectance(centre, 2 * size);
  double mean = 0;
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      const double s0 = static_cast<double>(i) / n, s1 = (i + 1.0) / n;
      const double t0 = static_cast<double>(j) / n, t1 = (j + 1.0) / n;
      const Quad cell{bilinear(corners, s0, t0), bilinear(corners, s1, t0), bilinear(corners, s1, t1),
                      bilinear(corners, s0, t1)};
      const Eigen::Vector2d middle = (cell[0] + cell[2]) / 2;
      const double radius = std::max((cell[0] - cell[2]).norm(), (cell[1] - cell[3]).norm());
      const auto uniform = patches_.uniform(middle, radius);
      const Coverage c = uniform ? *uniform : patches_.mean(cell);
      const double value =
          (c.white * scene_.white + c.black * scene_.black + (1 - c.white - c.black) * ground) * lit;
      cells[static_cast<size_t>(j * n + i)] = static_cast<float>(value);
      mean += value / (n * n);
    }
  }
  layers.means(row, column) = static_cast<float>(mean);
  if (n == 1) return;

  const int r = spread_.radius();
  const int left = std::max(0, column - r), right = std::min(rays_.width() - 1, column + r);
  const int top = std::max(0, row - r), bottom = std::min(rays_.height() - 1, row + r);
  for (int j = 0; j < n; ++j) {
    const float* down = spread_.of_cell(j) + r - row;
    std::array<float, 2 * PointSpread::kMaxRadius + 1> line{};  // this line of cells, spread sideways
    for (int i = 0; i < n; ++i) {
      const float difference = cells[static_cast<size_t>(j * n + i)] - static_cast<float>(mean);
      const float* across = spread_.of_cell(i) + r - column;
      for (int u = left; u <= right; ++u) line[static_cast<size_t>(u - left)] += difference * across[u];
    }
    for (int v = top; v <= bottom; ++v) {
      float* out = layers.detail[v];
      for (int u = left; u <= right; ++u) out[u] += down[v] * line[static_cast<size_t>(u - left)];
    }
  }
}

double Renderer::light(const Coverage& c, const Eigen::Vector2d& point, double size) const {
  const double bare = 1 - c.white - c.black;
  const double printed = c.white * scene_.white + c.black * scene_.black;
  return bare > 0 ? printed + bare * ground_.reflectance(point, size) : printed;
}

double Renderer::shadow(const Eigen::Vector2d& point, double size, double time) const {
  if (!scene_.shadow) return 1;
  const ShadowEdge& edge = *scene_.shadow;
  const double outside = shadow_normal_.dot(point) - edge.distance - edge.speed * time;
  const double width = std::max(edge.penumbra, 2 * size);  // an edge within a pixel is as soft as the pixel
  const double s = std::clamp(outside / width + 0.5, 0.0, 1.0);
  return edge.factor + (1 - edge.factor) * s * s * (3 - 2 * s);
}

// The longest way a point of the picture's middle or border goes during the exposure.
double Renderer::motion_px(const PoseAt& camera_from_target, const ShutterOptions& shutter) const {
  const Rigid3 before = camera_from_target(-shutter.exposure / 2);
  const Rigid3 after = camera_from_target(shutter.exposure / 2);
  const PlaneView view(before);
  double longest = 0;
  for (const double u : {0.0, 0.5, 1.0}) {
    for (const double v : {0.0, 0.5, 1.0}) {
      const Eigen::Vector2d pixel(u * (camera_.width() - 1), v * (camera_.height() - 1));
      const auto ray = camera_.ray_from_pixel(pixel);
      if (!ray) continue;
      const Eigen::Vector2d point = view.point(*ray);
      if (!point.allFinite()) continue;
      const auto later = camera_.pixel_from_camera(after * Eigen::Vector3d(point.x(), point.y(), 0));
      if (later) longest = std::max(longest, (*later - pixel).norm());
    }
  }
  return longest;
}

}  // namespace perch
