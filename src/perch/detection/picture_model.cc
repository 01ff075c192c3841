#include "perch/detection/picture_model.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Beyond as many deviations of the blur an edge is not seen.
constexpr float kFar = 4.2F;

// The normal distribution and its density, of a table.
struct Gauss {
  float below, density;
};

class GaussTable {
 public:
  GaussTable() {
    for (int i = 0; i <= kSteps; ++i) {
      const double z = (i - kSteps / 2) / double{kPerUnit};
      values_[static_cast<size_t>(i)] = {static_cast<float>(0.5 * std::erfc(-z / std::sqrt(2.0))),
                                         static_cast<float>(std::exp(-0.5 * z * z) / std::sqrt(2 * M_PI))};
    }
  }
  // z within kFar. To second order from the nearest entry: 1e-6.
  Gauss at(float z) const {
    const float scaled = z * kPerUnit + kSteps / 2;
    const int i = static_cast<int>(scaled + 0.5F);
    const Gauss& near = values_[static_cast<size_t>(i)];
    const float dz = (scaled - static_cast<float>(i)) / kPerUnit, z0 = z - dz;
    return {near.below + near.density * dz * (1 - 0.5F * z0 * dz), near.density * (1 - z0 * dz)};
  }

 private:
  static constexpr int kPerUnit = 32, kSteps = 2 * 5 * kPerUnit;
  std::array<Gauss, kSteps + 1> values_;
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
    seen.ground = shape.kind == ShapeKind::kOutline && !shape.inner;
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

bool PictureModel::row_of(int column, int line, float grey, PictureRow& row) const {
  const auto x = static_cast<float>(column), y = static_cast<float>(line);
  row.d.fill(0);
  row.flat = true;
  // The levels' parts, from what each shape covers.
  float of_white = has_ground_ ? 0 : 1, of_black = 0, of_ground = 1 - of_white;
  struct Near {
    const Edge* edge;
    float by_distance, z;
    bool black_side_ground;
    float grows, outline;
  };
  std::array<Near, 16> near;
  size_t count = 0;
  struct NearCorner {
    const std::array<float, 3>* by_blur;
    float by_correlation;
    bool black_side_ground;
  };
  std::array<NearCorner, 8> corners;
  size_t corner_count = 0;
  for (const Shape& shape : shapes_) {
    // Of the largest shape the distance itself is asked.
    if (x < shape.low_x || x > shape.high_x || y < shape.low_y || y > shape.high_y) continue;
    std::array<Gauss, 4> g;
    std::array<float, 4> z;
    bool outside = false, all = true;
    for (size_t k = 0; k < 4; ++k) {
      const Edge& e = shape.edges[k];
      const float t = std::clamp(e.tx * x + e.ty * y + e.start, 0.0F, 1.0F);
      const float d = e.nx * x + e.ny * y + e.offset - e.bend * t * (1 - t);
      if (d < -shape.room) return false;
      z[k] = d * e.per_sigma;
      if (z[k] < -kFar) outside = true;
      all = all && z[k] > kFar;
    }
    if (outside) continue;
    float inside = 1;
    if (!all) {
      for (size_t k = 0; k < 4; ++k) g[k] = z[k] > kFar ? Gauss{1, 0} : kGauss.at(z[k]);
      const float across = g[0].below + g[2].below - 1, up = g[1].below + g[3].below - 1;
      inside = across * up;
      std::array<float, 4> by_z = {g[0].density * up, g[1].density * across, g[2].density * up,
                                   g[3].density * across};
      for (size_t k = 0; k < 4; ++k) {
        const size_t m = (k + 1) % 4;
        const float densities = g[k].density * g[m].density;
        if (densities < 1e-4F) continue;
        const float r = shape.corner[k], a = z[k], b = z[m], both = r * densities;
        if (corner_count < corners.size()) {
          corners[corner_count++] = {&shape.corner_by_blur[k], shape.white * densities * (1 + r * a * b),
                                     shape.ground};
        }
        inside += both * (1 + r / 2 * a * b + r * r / 6 * (a * a - 1) * (b * b - 1));
        by_z[k] += both * (-a + r / 2 * b * (1 - a * a));
        by_z[m] += both * (-b + r / 2 * a * (1 - b * b));
      }
      for (size_t k = 0; k < 4 && count < near.size(); ++k) {
        if (!(std::abs(by_z[k]) > 1e-4F)) continue;
        near[count++] = {&shape.edges[k], shape.white * by_z[k], z[k],
                         shape.ground,    shape.white,           shape.ground ? 1.0F : 0.0F};
      }
    }
    if (shape.ground) {
      of_ground -= inside;
      of_white += inside;
    } else {
      of_white += shape.white * inside;
      of_black -= shape.white * inside;
    }
  }
  const auto u = static_cast<float>((x - middle_.x()) * per_px_),
             v = static_cast<float>((y - middle_.y()) * per_px_);
  const auto level = [&](const Eigen::Vector3d& l) {
    return static_cast<float>(l.x()) + u * static_cast<float>(l.y()) + v * static_cast<float>(l.z());
  };
  const float white = level(parameters_.white), ground = level(parameters_.ground);
  const auto black = static_cast<float>(parameters_.black);
  float* d = row.d.data();
  d[PictureRow::kWhite] = of_white, d[PictureRow::kWhite + 1] = of_white * u,
  d[PictureRow::kWhite + 2] = of_white * v;
  d[PictureRow::kBlack] = of_black;
  d[PictureRow::kGround] = of_ground, d[PictureRow::kGround + 1] = of_ground * u,
  d[PictureRow::kGround + 2] = of_ground * v;
  row.ground = of_ground;
  d[PictureRow::kResidual] = grey - of_white * white - of_black * black - of_ground * ground;
  for (size_t i = 0; i < count; ++i) {
    const Near& n = near[i];
    const Edge& e = *n.edge;
    const float step = white - (n.black_side_ground ? ground : black);
    const float by_distance = step * n.by_distance * e.per_sigma;
    if (std::abs(by_distance) < 0.02F) continue;
    row.flat = false;
    const float t = e.tx * x + e.ty * y + e.start;
    const float to = by_distance * t, from = by_distance - to;
    for (size_t j = 0; j < 8; ++j) d[j] += from * e.from[j] + to * e.to[j];
    const float by_sigma = -by_distance * n.z;
    for (size_t j = 0; j < 3; ++j) d[PictureRow::kBlur + j] += by_sigma * e.by_blur[j];
    d[PictureRow::kGrowth] += by_distance * n.grows;
    d[PictureRow::kGrowth + 1] += by_distance * n.outline;
  }
  if (row.flat) return true;
  for (size_t i = 0; i < corner_count; ++i) {
    const NearCorner& n = corners[i];
    const float by_correlation = (white - (n.black_side_ground ? ground : black)) * n.by_correlation;
    for (size_t j = 0; j < 3; ++j) d[PictureRow::kBlur + j] += by_correlation * (*n.by_blur)[j];
  }
  return true;
}

}  // namespace perch
