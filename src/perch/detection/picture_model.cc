#include "perch/detection/picture_model.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Beyond as many deviations of the blur an edge is not seen.
constexpr float kFar = 4.2F;

// Edges near four pixels: of a nested target that is a few pixels wide all.
constexpr size_t kMostNear = 72;

using Four = cv::v_float32x4;

Four all(float value) { return cv::v_setall_f32(value); }
Four where(const Four& mask, const Four& value) { return mask & value; }

// The normal distribution and its density.
struct Gauss {
  Four below, density;
};

class GaussTable {
 public:
  GaussTable() {
    for (int i = 0; i <= kSteps; ++i) {
      const double z = (i - kSteps / 2) / double{kPerUnit};
      below_[static_cast<size_t>(i)] = static_cast<float>(0.5 * std::erfc(-z / std::sqrt(2.0)));
      density_[static_cast<size_t>(i)] = static_cast<float>(std::exp(-0.5 * z * z) / std::sqrt(2 * M_PI));
    }
  }
  // To second order from the nearest entry: 1e-6. Beyond kFar it is all or nothing.
  Gauss at(const Four& z) const {
    const Four near = cv::v_min(cv::v_max(z, all(-kFar)), all(kFar));
    const cv::v_int32x4 i = cv::v_round(near * all(kPerUnit));
    const cv::v_int32x4 entry = i + cv::v_setall_s32(kSteps / 2);
    const Four z0 = cv::v_cvt_f32(i) * all(1.0F / kPerUnit), dz = near - z0;
    const Four below = cv::v_lut(below_.data(), entry), density = cv::v_lut(density_.data(), entry);
    const Four within = cv::v_abs(z) <= all(kFar);
    const Four far = where(z > all(kFar), all(1));
    return {cv::v_select(within, below + density * dz * (all(1) - all(0.5F) * z0 * dz), far),
            where(within, density * (all(1) - z0 * dz))};
  }

 private:
  static constexpr int kPerUnit = 32, kSteps = 2 * 5 * kPerUnit;
  std::array<float, kSteps + 1> below_, density_;
};

const GaussTable kGauss;

}  // namespace

bool PictureModel::set(const Eigen::Matrix3d& H, const ImageFrame& frame,
                       const PictureParameters& parameters) {
  parameters_ = parameters;
  shapes_.resize(edges_.shapes.size());
  low_.setConstant(1e9);
  high_.setConstant(-1e9);
  const double widest = std::sqrt(parameters.blur.trace());
  // As far around the outline as its blur, and as much again for the ground's level.
  double room = 2.5 * widest + 1.5;
  has_ground_ = false;
  for (size_t i = 0; i < shapes_.size(); ++i) {
    const TargetShape& shape = edges_.shapes[i];
    Shape& seen = shapes_[i];
    std::array<Eigen::Vector2d, 4> image, pixel;
    std::array<Eigen::Matrix2d, 4> by_image;
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector3d p = H * edges_.edges[4 * i + k].from.homogeneous();
      if (!(p.z() > 0)) return false;
      image[k] = p.hnormalized();
      Matrix23d by_point;
      const auto at = camera_.pixel_from_camera(image[k].homogeneous(), &by_point);
      if (!at) return false;
      pixel[k] = *at;
      by_image[k] = by_point.leftCols<2>();
    }
    const Eigen::Vector2d a = pixel[2] - pixel[0], b = pixel[3] - pixel[1];
    const double turn = a.x() * b.y() - a.y() * b.x() > 0 ? 1 : -1;  // -1: y is down, a face seen from above
    for (size_t k = 0; k < 4; ++k) {
      const Eigen::Vector2d along = pixel[(k + 1) % 4] - pixel[k];
      const double length = along.norm();
      if (!(length > 0.1)) return false;
      const Eigen::Vector2d n = turn * Eigen::Vector2d(-along.y(), along.x()) / length;
      const double sigma = std::sqrt(n.dot(parameters.blur * n));
      Edge& edge = seen.edges[k];
      edge.nx = static_cast<float>(n.x());
      edge.ny = static_cast<float>(n.y());
      edge.offset = static_cast<float>(-n.dot(pixel[k]));
      edge.per_sigma = static_cast<float>(1 / sigma);
      const Eigen::Vector2d t = along / (length * length);
      edge.tx = static_cast<float>(t.x());
      edge.ty = static_cast<float>(t.y());
      edge.start = static_cast<float>(-t.dot(pixel[k]));
      // A lens bends it: from its chord to where its middle is seen.
      const Eigen::Vector3d middle =
          H * (0.5 * (edges_.edges[4 * i + k].from + edges_.edges[4 * i + k].to)).homogeneous();
      const auto seen_middle = camera_.pixel_from_camera(middle);
      if (!seen_middle) return false;
      const Eigen::Vector2d from_end = *seen_middle - pixel[k];
      const double part = std::clamp(t.dot(from_end), 0.1, 0.9);
      edge.bend = static_cast<float>(n.dot(from_end) / (part * (1 - part)));
      edge.by_blur[0] = static_cast<float>(0.5 / sigma);
      edge.by_blur[1] = static_cast<float>(0.5 / sigma * (n.x() * n.x() - n.y() * n.y()));
      edge.by_blur[2] = static_cast<float>(n.x() * n.y() / sigma);
      const size_t next = (k + 1) % 4;
      const PlaneStep from = step_jacobian(image[k], by_image[k].transpose() * n, frame),
                      to = step_jacobian(image[next], by_image[next].transpose() * n, frame);
      for (size_t j = 0; j < 8; ++j) {
        edge.from[j] = static_cast<float>(-from(static_cast<Eigen::Index>(j)));
        edge.to[j] = static_cast<float>(-to(static_cast<Eigen::Index>(j)));
      }
    }
    for (size_t k = 0; k < 4; ++k) {
      const Edge &e = seen.edges[k], &f = seen.edges[(k + 1) % 4];
      const Eigen::Vector2d n(e.nx, e.ny), m(f.nx, f.ny);
      const float both = e.per_sigma * f.per_sigma;
      seen.corner[k] = static_cast<float>(n.dot(parameters.blur * m)) * both;
      const std::array<double, 3> by = {n.dot(m), n.x() * m.x() - n.y() * m.y(),
                                        n.x() * m.y() + n.y() * m.x()};
      for (size_t j = 0; j < 3; ++j) {
        seen.corner_by_blur[k][j] =
            static_cast<float>(by[j]) * both -
            seen.corner[k] * (e.by_blur[j] * e.per_sigma + f.by_blur[j] * f.per_sigma);
      }
    }
    const bool white = shape.kind == ShapeKind::kSquare || shape.kind == ShapeKind::kOutline;
    seen.white = white ? 1 : -1;
    seen.ground = shape.is_on_ground();
    has_ground_ = has_ground_ || seen.ground;
    // White has grown by so much: the edges lie farther out.
    const double out = parameters.growth + (seen.ground ? parameters.outline_growth : 0);
    for (Edge& edge : seen.edges) edge.offset += static_cast<float>(white ? out : -out);
    Eigen::Vector2d low = pixel[0], high = pixel[0];
    for (const Eigen::Vector2d& p : pixel) {
      low = low.cwiseMin(p);
      high = high.cwiseMax(p);
    }
    const double far = static_cast<double>(kFar) * widest + std::abs(out);
    seen.low_x = static_cast<float>(low.x() - far), seen.low_y = static_cast<float>(low.y() - far);
    seen.high_x = static_cast<float>(high.x() + far), seen.high_y = static_cast<float>(high.y() + far);
    low_ = low_.cwiseMin(low);
    high_ = high_.cwiseMax(high);
  }
  const Eigen::Vector3d centre = frame.to_image().col(2);
  const auto middle = camera_.pixel_from_camera(centre);
  if (!middle) return false;
  middle_ = *middle;
  per_px_ = 2 / (high_ - low_).maxCoeff();
  for (size_t i = 0; i < shapes_.size(); ++i) {
    const TargetShape& shape = edges_.shapes[i];
    const bool largest = has_ground_ ? shapes_[i].ground : shape.kind == ShapeKind::kInterior && !shape.inner;
    if (!largest) continue;
    // Without an outline that counts, the border's own white.
    if (!has_ground_)
      room = 0.7 * edges_.edges[4 * i].white_room / shape.side * (high_ - low_).minCoeff() / M_SQRT2;
    shapes_[i].room = static_cast<float>(room);
  }
  low_ = (low_.array() - room).floor();
  high_ = (high_.array() + room).ceil();
  return low_.x() >= 0 && low_.y() >= 0 && high_.x() <= camera_.width() - 1 &&
         high_.y() <= camera_.height() - 1;
}

bool PictureModel::rows_of(int column, int line, const Four& grey, PictureRows& rows) const {
  const Four lanes(0, 1, 2, 3);
  const Four x = all(static_cast<float>(column)) + lanes;
  const auto first = static_cast<float>(column), last = first + PictureRows::kPixels - 1,
             y = static_cast<float>(line);
  rows.flat = true;
  rows.crossed = cv::v_setzero_f32();
  rows.asked = x <= all(static_cast<float>(last_column()));
  // The levels' parts, from what each shape covers.
  Four of_white = all(has_ground_ ? 0 : 1), of_black = cv::v_setzero_f32(), of_ground = all(1) - of_white;
  struct Near {
    const Edge* edge;
    Four by_distance, z;
    float grows;
    bool on_ground;
  };
  std::array<Near, kMostNear> near;
  size_t count = 0;
  struct NearCorner {
    const std::array<float, 3>* by_blur;
    Four by_correlation;
    bool on_ground;
  };
  std::array<NearCorner, kMostNear> corners;
  size_t corner_count = 0;
  for (const Shape& shape : shapes_) {
    // Of the largest shape the distance itself is asked.
    if (last < shape.low_x || first > shape.high_x || y < shape.low_y || y > shape.high_y) continue;
    std::array<Four, 4> z;
    Four within = rows.asked, is_near = cv::v_setzero_f32();
    for (size_t k = 0; k < 4; ++k) {
      const Edge& e = shape.edges[k];
      const Four t = cv::v_min(cv::v_max(all(e.tx) * x + all(e.ty * y + e.start), all(0)), all(1));
      const Four d = all(e.nx) * x + all(e.ny * y + e.offset) - all(e.bend) * t * (all(1) - t);
      rows.asked &= d >= all(-shape.room);
      z[k] = d * all(e.per_sigma);
      within &= z[k] >= all(-kFar);
      is_near |= z[k] <= all(kFar);
    }
    within &= rows.asked;
    if (!cv::v_check_any(within)) continue;
    Four inside = where(within, all(1));
    if (cv::v_check_any(is_near & within)) {
      std::array<Gauss, 4> g;
      for (size_t k = 0; k < 4; ++k) g[k] = kGauss.at(z[k]);
      const Four across = g[0].below + g[2].below - all(1), up = g[1].below + g[3].below - all(1);
      inside = across * up;
      std::array<Four, 4> by_z = {g[0].density * up, g[1].density * across, g[2].density * up,
                                  g[3].density * across};
      for (size_t k = 0; k < 4; ++k) {
        const size_t m = (k + 1) % 4;
        const Four both_near = g[k].density * g[m].density;
        const Four densities = where(within & (both_near >= all(1e-4F)), both_near);
        if (!cv::v_check_any(densities > all(0))) continue;
        const float r = shape.corner[k];
        const Four &u = z[k], &v = z[m], both = all(r) * densities;
        if (corner_count < corners.size()) {
          corners[corner_count++] = {&shape.corner_by_blur[k],
                                     all(shape.white) * densities * (all(1) + all(r) * u * v), shape.ground};
        }
        inside += both * (all(1) + all(r / 2) * u * v + all(r * r / 6) * (u * u - all(1)) * (v * v - all(1)));
        by_z[k] += both * (all(r / 2) * v * (all(1) - u * u) - u);
        by_z[m] += both * (all(r / 2) * u * (all(1) - v * v) - v);
      }
      inside = where(within, inside);
      for (size_t k = 0; k < 4 && count < near.size(); ++k) {
        if (!cv::v_check_any(within & (cv::v_abs(by_z[k]) > all(1e-4F)))) continue;
        near[count++] = {&shape.edges[k], where(within, all(shape.white) * by_z[k]), z[k], shape.white,
                         shape.ground};
      }
    }
    if (shape.ground) {
      of_ground -= inside;
      of_white += inside;
    } else {
      of_white += all(shape.white) * inside;
      of_black -= all(shape.white) * inside;
    }
  }
  if (!cv::v_check_any(rows.asked)) return false;
  const Four per_px = all(static_cast<float>(per_px_));
  const Four u = (x - all(static_cast<float>(middle_.x()))) * per_px,
             v = (all(y) - all(static_cast<float>(middle_.y()))) * per_px;
  const auto level = [&](const Eigen::Vector3d& l) {
    return all(static_cast<float>(l.x())) + u * all(static_cast<float>(l.y())) +
           v * all(static_cast<float>(l.z()));
  };
  const Four white = level(parameters_.white), ground = level(parameters_.ground),
             black = all(static_cast<float>(parameters_.black));
  auto& d = rows.d;
  d[PictureRows::kWhite] = of_white, d[PictureRows::kWhite + 1] = of_white * u,
  d[PictureRows::kWhite + 2] = of_white * v;
  d[PictureRows::kBlack] = of_black;
  d[PictureRows::kGround] = of_ground, d[PictureRows::kGround + 1] = of_ground * u,
  d[PictureRows::kGround + 2] = of_ground * v;
  rows.ground = of_ground;
  d[PictureRows::kResidual] = grey - of_white * white - of_black * black - of_ground * ground;
  for (size_t i = 0; i < count; ++i) {
    const Near& n = near[i];
    const Edge& e = *n.edge;
    const Four step = white - (n.on_ground ? ground : black);
    const Four by_any = step * n.by_distance * all(e.per_sigma);
    const Four is_crossed = rows.asked & (cv::v_abs(by_any) >= all(0.02F));
    if (!cv::v_check_any(is_crossed)) continue;
    if (rows.flat) std::fill_n(d.begin(), PictureRows::kWhite, cv::v_setzero_f32());
    rows.flat = false;
    rows.crossed |= is_crossed;
    const Four by_distance = where(is_crossed, by_any);
    const Four t = all(e.tx) * x + all(e.ty * y + e.start);
    const Four to = by_distance * t, from = by_distance - to;
    for (size_t j = 0; j < 8; ++j) d[j] += from * all(e.from[j]) + to * all(e.to[j]);
    const Four by_sigma = all(0) - by_distance * n.z;
    for (size_t j = 0; j < 3; ++j) d[PictureRows::kBlur + j] += by_sigma * all(e.by_blur[j]);
    d[PictureRows::kGrowth] += by_distance * all(n.grows);
    if (n.on_ground) d[PictureRows::kGrowth + 1] += by_distance;
  }
  if (rows.flat) return true;
  for (size_t i = 0; i < corner_count; ++i) {
    const NearCorner& n = corners[i];
    const Four by_correlation =
        where(rows.crossed, (white - (n.on_ground ? ground : black)) * n.by_correlation);
    for (size_t j = 0; j < 3; ++j) d[PictureRows::kBlur + j] += by_correlation * all((*n.by_blur)[j]);
  }
  return true;
}

}  // namespace perch
