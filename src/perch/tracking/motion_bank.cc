#include "perch/tracking/motion_bank.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// s: gusts come and go within seconds.
constexpr double kMemory = 3.0;
// Twenty to one. At less, chance alone makes the choice flutter.
constexpr double kClearLead = 3.0;
// What was much less likely once must be able to come back within a few times the memory.
constexpr double kFarthestBehind = 30.0;
constexpr double kDeafFor = 1.0;  // s
// Within a few tenths of a second any motion is a straight line, and the calmest explains it best. Until then
// the one that allows for most speaks: else the velocity above a ship's deck is off by 25 cm/s after half a
// second, where its sigma says 11.
constexpr double kProving = 0.9;  // s
// Chi-squares that one honest measurement in 10,000 exceeds, of 3 and of 6 degrees of freedom.
constexpr double kGateOf3Over6 = 21.1 / 27.9;

}  // namespace

MotionBank::MotionBank(std::vector<BodyNoise> bodies, std::vector<PadNoise> pads)
    : bodies_(std::move(bodies)), pads_(std::move(pads)) {}

void MotionBank::start(const Motion& motion) {
  members_.clear();
  for (const BodyNoise& body : bodies_) members_.push_back({body, pads_.front(), motion, 0});
  speaker_ = 0;
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

template <typename InnovationOf>
bool MotionBank::take(const InnovationOf& innovation_of, double gate) {
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
    member.log_likelihood += surprises[i].log_density;
  }
  for (size_t i = 0; i < members_.size(); ++i) {
    if (!(surprises[i].squared <= gate)) members_[i].motion = teacher->motion;
  }
  choose();
  return true;
}

void MotionBank::choose() {
  size_t best = 0;
  for (size_t i = 1; i < members_.size(); ++i) {
    if (members_[i].log_likelihood > members_[best].log_likelihood) best = i;
  }
  const double top = members_[best].log_likelihood;
  for (Member& member : members_) {
    member.log_likelihood = std::max(member.log_likelihood - top, -kFarthestBehind);
  }
  if (tracked_ > kProving && members_[speaker_].log_likelihood < -kClearLead) speaker_ = best;
}

bool MotionBank::see(const UncertainRigid3& pad_from_body, double gate) {
  return take([&](const Motion& motion) { return motion.of_pose(pad_from_body); }, gate);
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
  speaker_ *= pads_.size();
}

// Of each body's filters the likeliest is kept.
void MotionBank::forget_world() {
  std::vector<Member> kept;
  const size_t spoke = speaker_ / pads_.size();
  for (size_t i = 0; i < members_.size(); i += pads_.size()) {
    const auto first = members_.begin() + static_cast<std::ptrdiff_t>(i);
    kept.push_back(*std::max_element(
        first, first + static_cast<std::ptrdiff_t>(pads_.size()),
        [](const Member& a, const Member& b) { return a.log_likelihood < b.log_likelihood; }));
    kept.back().motion.forget_world();
    kept.back().pad = pads_.front();
  }
  members_ = std::move(kept);
  speaker_ = spoke;
  refused_.fill(0);
}

void MotionBank::hear(const AutopilotSample& sample, double gate, int patience) {
  if (*std::max_element(refused_.begin(), refused_.end()) >= patience) {
    forget_world();
    deaf_ = kDeafFor;
  }
  const bool meeting = !motion().knows_world();
  if (meeting && (deaf_ > 0 || !sample.world_from_body)) return;
  if (meeting) meet_world(sample);
  const auto part = [&](size_t which, const auto& innovation_of) {
    refused_[which] = take(innovation_of, gate * kGateOf3Over6) ? 0 : refused_[which] + 1;
  };
  if (sample.world_from_body && !meeting) {
    part(0, [&](const Motion& motion) {
      return motion.of_attitude(*sample.world_from_body, sample.attitude_sigma);
    });
  }
  if (sample.body_velocity_in_world) {
    part(1, [&](const Motion& motion) {
      return motion.of_velocity(*sample.body_velocity_in_world, sample.velocity_sigma);
    });
  }
  if (sample.angular_velocity_in_body) {
    part(2, [&](const Motion& motion) {
      return motion.of_angular_velocity(*sample.angular_velocity_in_body, sample.angular_velocity_sigma);
    });
  }
}

}  // namespace perch
