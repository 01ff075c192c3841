#include "calib/mount/hand_eye.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "perch/geometry/euler.h"
#include "perch/geometry/so3.h"

namespace perch {
namespace {

constexpr int kHandful = 5;    // 0.7^5: one handful in six has no wrong pose among a third of them
constexpr int kHandfuls = 40;  // then all miss once in a thousand times

Eigen::Matrix3d rotation_of(const Eigen::Matrix<double, 9, 1>& vec) {
  const Eigen::Map<const Eigen::Matrix3d> m(vec.data());
  return nearest_rotation(m.determinant() < 0 ? Eigen::Matrix3d(-m) : Eigen::Matrix3d(m));
}

std::pair<Eigen::Quaterniond, Eigen::Quaterniond> shah(std::span<const HandEyePair> pairs) {
  Eigen::Matrix<double, 9, 9> T = Eigen::Matrix<double, 9, 9>::Zero();
  for (const HandEyePair& pair : pairs) {
    const Eigen::Matrix3d R_W = pair.world_from_body.rotation.toRotationMatrix();
    const Eigen::Matrix3d R_K = pair.base_from_pad.rotation.toRotationMatrix();
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) T.block<3, 3>(3 * i, 3 * j) += R_K(j, i) * R_W;
    }
  }
  const Eigen::JacobiSVD<Eigen::Matrix<double, 9, 9>> svd(T, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d mount = rotation_of(svd.matrixV().col(0));
  // The pad's follows from the mount's; its own singular vector may have the other sign.
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const HandEyePair& pair : pairs) {
    sum += pair.world_from_body.rotation * mount * pair.base_from_pad.rotation.toRotationMatrix();
  }
  return {Eigen::Quaterniond(mount), Eigen::Quaterniond(nearest_rotation(sum))};
}

// R_W (R_M t_K + t_M) + t_W = t_P, linear in t_M and t_P; t_M drawn weakly to the nominal one, which decides
// where the flight does not tell.
std::pair<Eigen::Vector3d, Eigen::Vector3d> translations(std::span<const HandEyePair> pairs,
                                                         const Eigen::Quaterniond& mount,
                                                         const Eigen::Vector3d& nominal) {
  Eigen::Matrix<double, 6, 6> N = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
  for (const HandEyePair& pair : pairs) {
    Eigen::Matrix<double, 3, 6> J;
    J << pair.world_from_body.rotation.toRotationMatrix(), -Eigen::Matrix3d::Identity();
    const Eigen::Vector3d y =
        -(pair.world_from_body * (mount * pair.base_from_pad.translation)) - J.leftCols<3>() * nominal;
    N += J.transpose() * J;
    g += J.transpose() * y;
  }
  N.topLeftCorner<3, 3>().diagonal().array() += 1e-3 * static_cast<double>(pairs.size());
  const Eigen::Matrix<double, 6, 1> x = N.ldlt().solve(g);
  return {x.head<3>() + nominal, x.tail<3>()};
}

// Where rotations say too little: the path of the camera over the pad, as vision has it, laid over the
// body's.
std::optional<Eigen::Quaterniond> pad_rotation_by_path(std::span<const HandEyePair> pairs,
                                                       const Eigen::Vector3d& lever_arm) {
  Eigen::Vector3d mean_seen = Eigen::Vector3d::Zero(), mean_flown = mean_seen;
  const auto seen = [](const HandEyePair& p) -> Eigen::Vector3d {
    return inverse(p.base_from_pad).translation;
  };
  const auto flown = [&](const HandEyePair& p) -> Eigen::Vector3d { return p.world_from_body * lever_arm; };
  for (const HandEyePair& p : pairs) {
    mean_seen += seen(p) / static_cast<double>(pairs.size());
    mean_flown += flown(p) / static_cast<double>(pairs.size());
  }
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const HandEyePair& p : pairs) sum += (flown(p) - mean_flown) * (seen(p) - mean_seen).transpose();
  if (!(sum.norm() > 1e-9)) return std::nullopt;
  return Eigen::Quaterniond(nearest_rotation(sum));
}

void keep_better(std::span<const HandEyePair> pairs, const Rigid3& mount, const Rigid3& pad, HandEye& best) {
  const double misfit = median_misfit(pairs, mount, pad);
  if (misfit < best.misfit) best = {mount, pad, misfit};
}

// One candidate of each kind from some of the pairs.
void try_some(std::span<const HandEyePair> some, std::span<const HandEyePair> all, const Rigid3& nominal,
              HandEye& best) {
  const auto [mount, pad] = shah(some);
  const auto [t_mount, t_pad] = translations(some, mount, nominal.translation);
  keep_better(all, {mount, t_mount}, {pad, t_pad}, best);
  if (const auto by_path = pad_rotation_by_path(some, nominal.translation)) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const HandEyePair& p : some) {
      sum += (p.world_from_body.rotation.conjugate() * *by_path * p.base_from_pad.rotation.conjugate())
                 .toRotationMatrix();
    }
    const Eigen::Quaterniond turned(nearest_rotation(sum));
    const auto [t, tp] = translations(some, turned, nominal.translation);
    keep_better(all, {turned, t}, {*by_path, tp}, best);
  }
}

}  // namespace

double hand_eye_misfit(const HandEyePair& pair, const Rigid3& mount, const Rigid3& pad) {
  const Rigid3 seen = pair.world_from_body * mount * pair.base_from_pad;
  const double degrees = kDegFromRad * seen.rotation.angularDistance(pad.rotation);
  const double unit = 0.03 + 0.01 * pair.base_from_pad.translation.norm();
  const double misfit = std::hypot(degrees, (seen.translation - pad.translation).norm() / unit);
  return std::isfinite(misfit) ? misfit : 1e9;
}

double median_misfit(std::span<const HandEyePair> pairs, const Rigid3& mount, const Rigid3& pad) {
  std::vector<double> misfits;
  for (const HandEyePair& pair : pairs) misfits.push_back(hand_eye_misfit(pair, mount, pad));
  if (misfits.empty()) return INFINITY;
  const auto middle = misfits.begin() + static_cast<std::ptrdiff_t>(misfits.size() / 2);
  std::nth_element(misfits.begin(), middle, misfits.end());
  return *middle;
}

Rigid3 pad_of(std::span<const HandEyePair> pairs, const Rigid3& mount) {
  std::vector<Rigid3> places;
  for (const HandEyePair& p : pairs) places.push_back(p.world_from_body * mount * p.base_from_pad);
  if (places.empty()) return {};
  // The place that the others are nearest to, of a few; then the mean of those near it.
  const size_t step = std::max<size_t>(1, places.size() / 50);
  Rigid3 best;
  double least = INFINITY;
  for (size_t i = 0; i < places.size(); i += step) {
    if (const double misfit = median_misfit(pairs, mount, places[i]); misfit < least) {
      least = misfit;
      best = places[i];
    }
  }
  Eigen::Vector3d turn = Eigen::Vector3d::Zero(), move = Eigen::Vector3d::Zero();
  int count = 0;
  for (size_t i = 0; i < places.size(); ++i) {
    if (hand_eye_misfit(pairs[i], mount, best) > 2 * least) continue;
    turn += so3_log(places[i].rotation * best.rotation.conjugate());
    move += places[i].translation - best.translation;
    ++count;
  }
  if (count == 0) return best;
  return {(so3_exp(turn / count) * best.rotation).normalized(), best.translation + move / count};
}

HandEye solve_hand_eye(std::span<const HandEyePair> pairs, const Rigid3& nominal) {
  HandEye best;
  if (pairs.size() < 3) return best;
  keep_better(pairs, nominal, pad_of(pairs, nominal), best);
  try_some(pairs, pairs, nominal, best);
  uint64_t state = 1;
  for (int k = 0; k < kHandfuls && pairs.size() > kHandful; ++k) {
    std::vector<HandEyePair> some;
    for (int i = 0; i < kHandful; ++i) {
      state = state * 6364136223846793005ULL + 1442695040888963407ULL;  // Knuth's MMIX generator
      some.push_back(pairs[(state >> 33) % pairs.size()]);
    }
    try_some(some, pairs, nominal, best);
  }
  // Of those that agree with the best.
  for (int round = 0; round < 2; ++round) {
    std::vector<HandEyePair> agreeing;
    for (const HandEyePair& p : pairs) {
      if (hand_eye_misfit(p, best.mount, best.pad) < 3 * best.misfit + 0.5) agreeing.push_back(p);
    }
    if (agreeing.size() >= 3) try_some(agreeing, pairs, nominal, best);
  }
  return best;
}

}  // namespace perch
