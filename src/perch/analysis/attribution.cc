#include "perch/analysis/attribution.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr int kUnknowns = 14;
using Row = Eigen::Matrix<double, 6, kUnknowns>;
using Normal = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using Values = Eigen::Matrix<double, kUnknowns, 1>;

struct Cause {
  const char* name;
  const char* unit;
  int first, size;
  double prior;  // deviation of each number
};
constexpr Cause kCauses[] = {{"mount rotation", "rad", 0, 3, 10 * kRadFromDeg},
                             {"lever arm", "m", 3, 3, 0.5},
                             {"pad position", "m", 6, 3, 0.5},
                             {"pad rotation", "rad", 9, 3, 10 * kRadFromDeg},
                             {"time offset", "s", 12, 1, 0.2},
                             {"lens scale", "", 13, 1, 0.05}};
constexpr size_t kFewest = 20;  // frames; 14 unknowns from fewer say nothing

struct Compared {
  PoseError error;  // vision minus navigation, pad axes
  Row by;           // of the error, by each cause
};

// The body in the pad frame by navigation, `later` seconds after a picture.
std::optional<Rigid3> navigated(const FrameChain& chain, const Flight& flight, int64_t camera_ns,
                                double later) {
  const auto sample = flight.nav.at(navigation_time_ns(chain, camera_ns + std::llround(1e9 * later)));
  if (!sample) return std::nullopt;
  return pad_from_body_by_navigation(chain, sample->world_from_body);
}

std::optional<Compared> compare(const Estimate& estimate, const FrameChain& chain, const Flight& flight) {
  if (estimate.status != EstimateStatus::kOk || !estimate.pad_from_body) return std::nullopt;
  constexpr double kStep = 0.02;  // s
  const auto navigation = navigated(chain, flight, estimate.timestamp_ns, 0);
  const auto before = navigated(chain, flight, estimate.timestamp_ns, -kStep);
  const auto after = navigated(chain, flight, estimate.timestamp_ns, kStep);
  if (!navigation || !before || !after) return std::nullopt;
  const Rigid3& vision = estimate.pad_from_body->mean;
  const Rigid3 pad_from_camera = inverse(estimate.camera_from_target.mean * chain.target_from_pad);
  const Eigen::Matrix3d R = vision.rotation.toRotationMatrix();
  Compared c;
  c.error = pose_error(*navigation, vision);
  c.by.setZero();
  // The camera is where it is seen; a mount turned by phi about the camera turns the body about it, one moved
  // by t moves the body: d = R (p - Exp(phi) p) = R [p]x phi, p the camera in the body.
  const Eigen::Vector3d p = (inverse(vision) * pad_from_camera).translation;
  c.by.block<3, 3>(0, 0) = R * skew(p);
  c.by.block<3, 3>(3, 0) = R;
  c.by.block<3, 3>(0, 3) = R;
  // A pad that lies elsewhere than configured takes navigation's place over it along the other way.
  c.by.block<3, 3>(0, 6) = -Eigen::Matrix3d::Identity();
  c.by.block<3, 3>(0, 9) = skew(navigation->translation);
  c.by.block<3, 3>(3, 9) = -Eigen::Matrix3d::Identity();
  // With a larger offset, vision is of an earlier moment than navigation was taken for.
  c.by.block<6, 1>(0, 12) = -pose_error(*before, *after) / (2 * kStep);
  // A lens longer than configured shows the target nearer than it is, x and y being the same.
  c.by.block<3, 1>(0, 13) =
      (pad_from_camera.rotation * Eigen::Vector3d(0, 0, estimate.camera_from_target.mean.translation.z()));
  if (!c.error.allFinite() || !c.by.allFinite()) return std::nullopt;
  return c;
}

struct Sizes {
  double position, rotation;
  PoseError whiten(const PoseError& e) const {
    PoseError w = e;
    w.head<3>() /= position;
    w.tail<3>() /= rotation;
    return w;
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The deviation of one axis, from the median of lengths in three: 1.538 deviations where they are normal.
Sizes sizes_of(const std::vector<Compared>& all, const Values& x) {
  std::vector<double> position, rotation;
  for (const Compared& c : all) {
    const PoseError left = c.error - c.by * x;
    position.push_back(left.head<3>().norm());
    rotation.push_back(left.tail<3>().norm());
  }
  return {std::max(median(position) / 1.538, 1e-6), std::max(median(rotation) / 1.538, 1e-7)};
}

struct Fit {
  Values x = Values::Zero(), sigma = Values::Zero();
  double left = 0;  // sum of the whitened squares
};

// `causes`: one bit each.
Fit fit(const std::vector<const Compared*>& frames, const Sizes& sizes, unsigned causes) {
  Normal N = Normal::Zero();
  Values g = Values::Zero();
  for (size_t k = 0; k < std::size(kCauses); ++k) {
    for (int i = kCauses[k].first; i < kCauses[k].first + kCauses[k].size; ++i) {
      N(i, i) = causes >> k & 1 ? 1 / (kCauses[k].prior * kCauses[k].prior) : 1e18;
    }
  }
  for (const Compared* c : frames) {
    Row J = c->by;
    J.topRows<3>() /= sizes.position;
    J.bottomRows<3>() /= sizes.rotation;
    N += J.transpose() * J;
    g += J.transpose() * sizes.whiten(c->error);
  }
  const Eigen::LDLT<Normal> ldlt(N);
  Fit result;
  result.x = ldlt.solve(g);
  result.sigma = ldlt.solve(Normal::Identity()).diagonal().cwiseMax(0).cwiseSqrt();
  for (const Compared* c : frames) result.left += sizes.whiten(c->error - c->by * result.x).squaredNorm();
  return result;
}

constexpr unsigned kAll = (1u << std::size(kCauses)) - 1;

std::vector<ErrorCause> causes_of(const std::vector<const Compared*>& frames, const Sizes& sizes,
                                  const Fit& joint) {
  const double total = fit(frames, sizes, 0).left;
  std::vector<ErrorCause> causes;
  for (unsigned k = 0; k < std::size(kCauses); ++k) {
    const Cause& cause = kCauses[k];
    ErrorCause found{cause.name, cause.unit, {}, {}, 0, 0};
    for (int i = cause.first; i < cause.first + cause.size; ++i) {
      found.value.push_back(joint.x[i]);
      found.sigma.push_back(joint.sigma[i]);
    }
    found.alone = std::max(0.0, 1 - fit(frames, sizes, 1u << k).left / total);
    found.only_by_this = std::max(0.0, (fit(frames, sizes, kAll & ~(1u << k)).left - joint.left) / total);
    causes.push_back(found);
  }
  std::stable_sort(causes.begin(), causes.end(),
                   [](const ErrorCause& a, const ErrorCause& b) { return a.alone > b.alone; });
  return causes;
}

}  // namespace

Attribution attribute_errors(const std::vector<Estimate>& estimates, const FrameChain& chain,
                             const Flight& flight) {
  std::vector<Compared> all;
  for (const Estimate& estimate : estimates) {
    if (const auto compared = compare(estimate, chain, flight)) all.push_back(*compared);
  }
  Attribution result;
  if (all.size() < kFewest) return result;
  std::vector<const Compared*> frames;
  for (const Compared& c : all) frames.push_back(&c);
  Fit joint;
  Sizes sizes{0.1, 0.02};  // of a first fit
  for (int round = 0; round < 4; ++round) {
    joint = fit(frames, sizes, kAll);
    sizes = sizes_of(all, joint.x);
    frames.clear();
    for (const Compared& c : all) {
      // 5 deviations in one of two triples: no noise.
      const PoseError left = sizes.whiten(c.error - c.by * joint.x);
      if (std::max(left.head<3>().norm(), left.tail<3>().norm()) < 5 * 1.538) frames.push_back(&c);
    }
    if (frames.size() < kFewest) return result;
  }
  joint = fit(frames, sizes, kAll);
  result.count = frames.size();
  Eigen::Vector4d squares = Eigen::Vector4d::Zero();
  for (const Compared* c : frames) {
    const PoseError left = c->error - c->by * joint.x;
    squares += Eigen::Vector4d(c->error.head<3>().squaredNorm(), c->error.tail<3>().squaredNorm(),
                               left.head<3>().squaredNorm(), left.tail<3>().squaredNorm());
  }
  const Eigen::Vector4d rms = (squares / static_cast<double>(frames.size())).cwiseSqrt();
  result.position_rms = rms[0];
  result.rotation_rms = rms[1];
  result.position_noise = rms[2];
  result.rotation_noise = rms[3];
  result.causes = causes_of(frames, sizes, joint);
  return result;
}

}  // namespace perch
