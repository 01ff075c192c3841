#include "perch/tracking/motion_bank.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// s: gusts come and go within seconds.
constexpr double kMemory = 3.0;
// What was much less likely once must be able to come back within a few times the memory.
constexpr double kFarthestBehind = 30.0;
constexpr double kDeafFor = 1.0;  // s
// Within a few tenths of a second any motion is a straight line, and pictures would prove that a deck in the
// sea stands still: in the first second they count for little in the choice.
constexpr double kProving = 1.0;  // s
constexpr double kNewsWhileProving = 1.0 / 30;
// Of the probability of the likeliest: too little to change what is said.
constexpr double kNegligible = 1e-3;
// Chi-squares that one honest measurement in 10,000 exceeds, of 3 and of 6 degrees of freedom.
constexpr double kGateOf3Over6 = 21.1 / 27.9;

}  // namespace

MotionBank::MotionBank(std::vector<BodyNoise> bodies, std::vector<PadNoise> pads)
    : bodies_(std::move(bodies)), pads_(std::move(pads)) {}

void MotionBank::start(const Motion& motion) {
  members_.clear();
  for (const BodyNoise& body : bodies_) members_.push_back({body, pads_.front(), motion, 0});
  deaf_ = tracked_ = 0;
  refused_.fill(0);
}

void MotionBank::propagate(double dt) {
  const double kept = std::exp(-dt / kMemory);
  deaf_ = std::max(0.0, deaf_ - dt);
  tracked_ += dt;
  for (Member& member : members_) {
    member.motion.propagate(dt, member.body, member.pad);
    member.log_likelihood *= kept;
  }
}

Motion MotionBank::Member::predicted(double dt) const {
  Motion later = motion;
  later.propagate(dt, body, pad);
  return later;
}

double MotionBank::news_of_motion() const { return tracked_ < kProving ? kNewsWhileProving : 1; }

Motion MotionBank::predicted(double dt) const {
  using Error = Eigen::Matrix<double, 12, 1>;
  const auto likeliest = std::max_element(members_.begin(), members_.end(), less_likely);
  Motion together = likeliest->predicted(dt);
  together.forget_world();
  double all = 0;
  Error mean = Error::Zero();
  Eigen::Matrix<double, 12, 12> square = Eigen::Matrix<double, 12, 12>::Zero();
  for (const Member& member : members_) {
    const double probability = std::exp(member.log_likelihood - likeliest->log_likelihood);
    if (probability < kNegligible) continue;
    const Motion motion = member.predicted(dt);
    Error off;
    off << pose_error(together.pad_from_body, motion.pad_from_body), motion.velocity - together.velocity,
        motion.angular_velocity - together.angular_velocity;
    all += probability;
    mean += probability * off;
    square += probability * (motion.P.topLeftCorner<12, 12>() + off * off.transpose());
  }
  mean /= all;
  together.pad_from_body = perturb(together.pad_from_body, mean.head<6>());
  together.velocity += mean.segment<3>(6);
  together.angular_velocity += mean.tail<3>();
  together.P = square / all - mean * mean.transpose();
  return together;
}

template <typename InnovationOf>
bool MotionBank::take(const InnovationOf& innovation_of, double gate, double news) {
  const Member* teacher = nullptr;  // the likeliest of those that believe it
  std::vector<Motion::Surprise> surprises;
  for (const Member& member : members_) {
    surprises.push_back(member.motion.surprise(innovation_of(member.motion)));
    const bool believes = surprises.back().squared <= gate;
    if (believes && (!teacher || member.log_likelihood > teacher->log_likelihood)) teacher = &member;
  }
  if (!teacher) return false;
  for (size_t i = 0; i < members_.size(); ++i) {
    Member& member = members_[i];
    if (surprises[i].squared <= gate) member.motion.correct(innovation_of(member.motion));
    member.log_likelihood += news * surprises[i].log_density;
  }
  for (size_t i = 0; i < members_.size(); ++i) {
    if (!(surprises[i].squared <= gate)) members_[i].motion = teacher->motion;
  }
  const double top = std::max_element(members_.begin(), members_.end(), less_likely)->log_likelihood;
  for (Member& member : members_) {
    member.log_likelihood = std::max(member.log_likelihood - top, -kFarthestBehind);
  }
  return true;
}

bool MotionBank::see(const UncertainRigid3& pad_from_body, double gate) {
  return take([&](const Motion& motion) { return motion.of_pose(pad_from_body); }, gate, news_of_motion());
}

double MotionBank::surprise(const UncertainRigid3& pad_from_body) const {
  const Motion together = predicted(0);
  return together.surprise(together.of_pose(pad_from_body)).squared;
}

void MotionBank::meet_world(const AutopilotSample& sample) {
  std::vector<Member> met;
  for (const Member& member : members_) {
    for (const PadNoise& pad : pads_) {
      met.push_back({member.body, pad, member.motion, member.log_likelihood});
      met.back().motion.meet_world(*sample.world_from_body, sample.attitude_sigma, pad);
    }
  }
  members_ = std::move(met);
}

// Of each body's filters the likeliest is kept.
void MotionBank::forget_world() {
  std::vector<Member> kept;
  for (size_t i = 0; i < members_.size(); i += pads_.size()) {
    const auto first = members_.begin() + static_cast<std::ptrdiff_t>(i);
    kept.push_back(*std::max_element(first, first + static_cast<std::ptrdiff_t>(pads_.size()), less_likely));
    kept.back().motion.forget_world();
    kept.back().pad = pads_.front();
  }
  members_ = std::move(kept);
  refused_.fill(0);
}

void MotionBank::hear(const AutopilotSample& sample, double gate, int patience) {
  if (*std::max_element(refused_.begin(), refused_.end()) >= patience) {
    forget_world();
    deaf_ = kDeafFor;
  }
  const bool meeting = !members_.front().motion.knows_world();
  if (meeting && (deaf_ > 0 || !sample.world_from_body)) return;
  if (meeting) meet_world(sample);
  const auto part = [&](size_t which, double news, const auto& innovation_of) {
    refused_[which] = take(innovation_of, gate * kGateOf3Over6, news) ? 0 : refused_[which] + 1;
  };
  if (sample.world_from_body && !meeting) {
    part(0, news_of_motion(), [&](const Motion& motion) {
      return motion.of_attitude(*sample.world_from_body, sample.attitude_sigma);
    });
  }
  if (sample.body_velocity_in_world) {
    part(1, 1, [&](const Motion& motion) {
      return motion.of_velocity(*sample.body_velocity_in_world, sample.velocity_sigma);
    });
  }
  if (sample.angular_velocity_in_body) {
    part(2, news_of_motion(), [&](const Motion& motion) {
      return motion.of_angular_velocity(*sample.angular_velocity_in_body, sample.angular_velocity_sigma);
    });
  }
}

}  // namespace perch
