#include "calib/mount/observability.h"

#include <cmath>
#include <sstream>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

enum class Kind { kLever, kMountRotation, kPad, kPadRotation, kOffset, kHead };

Kind kind_of(const std::string& name) {
  if (name.starts_with("lever")) return Kind::kLever;
  if (name.starts_with("mount")) return Kind::kMountRotation;
  if (name.starts_with("pad rotation")) return Kind::kPadRotation;
  if (name.starts_with("pad") && !name.starts_with("pad scale") && !name.starts_with("pan"))
    return Kind::kPad;
  if (name.starts_with("time")) return Kind::kOffset;
  return Kind::kHead;
}

double limit_of(Kind kind, const MountOptions& o) {
  switch (kind) {
    case Kind::kLever:
      return o.largest_position_sigma;
    case Kind::kMountRotation:
      return o.largest_rotation_sigma;
    case Kind::kPad:
      return o.largest_pad_sigma;
    case Kind::kPadRotation:
      return 2 * o.largest_rotation_sigma;
    case Kind::kOffset:
      return o.largest_offset_sigma;
    case Kind::kHead:
      return INFINITY;  // held by the drawing's prior
  }
  return INFINITY;
}

const char* manoeuvre_for(Kind kind) {
  switch (kind) {
    case Kind::kLever:
    case Kind::kPad:
      return "fly with roll and pitch of 10 deg and more, to both sides, at several headings: where the body "
             "only yaws or stays level, the lever arm and the pad's place move the picture alike";
    case Kind::kMountRotation:
    case Kind::kPadRotation:
      return "fly sideways over the pad, a square of a few metres, and turn the nose: on the way straight "
             "down "
             "the mount's rotation and the pad's are one";
    case Kind::kOffset:
      return "fly with changing speed and attitude: what does not move shows no delay";
    case Kind::kHead:
      return "move the head while the target is in sight";
  }
  return "";
}

std::string text_of(Kind kind, double value) {
  std::ostringstream text;
  text.precision(3);
  if (kind == Kind::kMountRotation || kind == Kind::kPadRotation) {
    text << kDegFromRad * value << " deg";
  } else if (kind == Kind::kOffset) {
    text << 1000 * value << " ms";
  } else {
    text << value << " m";
  }
  return text.str();
}

}  // namespace

std::vector<Untold> untold(const MountSolution& s, const MountOptions& options) {
  std::vector<Untold> all;
  for (size_t i = 0; i < s.names.size(); ++i) {
    const Kind kind = kind_of(s.names[i]);
    const auto row = static_cast<Eigen::Index>(i);
    const double sigma = std::sqrt(s.covariance(row, row)), limit = limit_of(kind, options);
    if (sigma <= limit) continue;
    Untold u{s.names[i], sigma, limit, "", manoeuvre_for(kind)};
    for (size_t k = 0; k < s.names.size(); ++k) {
      const auto column = static_cast<Eigen::Index>(k);
      const double correlation =
          s.covariance(row, column) / (sigma * std::sqrt(s.covariance(column, column)));
      if (k != i && std::abs(correlation) > 0.9) u.trades += (u.trades.empty() ? "" : ", ") + s.names[k];
    }
    all.push_back(u);
  }
  return all;
}

std::string in_words(const Untold& u) {
  const Kind kind = kind_of(u.what);
  return u.what + " is known to " + text_of(kind, u.sigma) + " only (limit " + text_of(kind, u.limit) + ")" +
         (u.trades.empty() ? "" : ": it trades with " + u.trades) + "; " + u.manoeuvre;
}

MountEffect mount_effect(const MountSolution& s, const MountChain& chain, double range) {
  const Rigid3 base_from_camera = chain.head ? Rigid3{} : chain.base_from_camera;
  const Eigen::Vector3d p = s.state.mount.rotation * (base_from_camera * Eigen::Vector3d(0, 0, range));
  Eigen::Matrix<double, 3, 6> J;
  J << Eigen::Matrix3d::Identity(), -skew(p);
  const PoseCovariance covariance = s.covariance.topLeftCorner<6, 6>();
  return {range, std::sqrt((J * covariance * J.transpose()).trace()),
          std::sqrt(covariance.bottomRightCorner<3, 3>().trace())};
}

}  // namespace perch
