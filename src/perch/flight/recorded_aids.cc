#include "perch/flight/recorded_aids.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

fs::path aids_of(const fs::path& flight) { return flight / "run" / "aids.csv"; }

}  // namespace

bool RecordedAids::are_there(const fs::path& flight) {
  std::error_code ignored;
  return fs::exists(aids_of(flight), ignored);
}

RecordedAids::RecordedAids(const fs::path& flight)
    : file_(aids_of(flight)), frames_(read_aids(file_, problems_)) {
  for (size_t i = 0; i < frames_.size(); ++i) index_.emplace(frames_[i].timestamp_ns, i);
}

Estimator::Aid RecordedAids::at(int64_t frame_timestamp_ns) {
  const auto found = index_.find(frame_timestamp_ns);
  if (found == index_.end() || found->second < next_) {
    ++unknown_;
    return {};
  }
  std::vector<AutopilotSample> said;
  for (; next_ < found->second; ++next_, ++dropped_) {
    const auto& missed = frames_[next_].aid.autopilot;
    said.insert(said.end(), missed.begin(), missed.end());
  }
  Estimator::Aid aid = std::move(frames_[next_++].aid);
  aid.autopilot.insert(aid.autopilot.begin(), said.begin(), said.end());
  return aid;
}

std::vector<std::string> RecordedAids::problems() const {
  std::vector<std::string> problems = problems_;
  if (const size_t missing = dropped_ + frames_.size() - next_; missing > 0) {
    problems.push_back(file_.string() + ": " + std::to_string(missing) +
                       " frames of the live run have no picture here: no estimate of them, and the states "
                       "after them are not the live run's");
  }
  if (unknown_ > 0) {
    problems.push_back(file_.string() + ": does not know " + std::to_string(unknown_) +
                       " of the frames: estimated without attitude, head angles and autopilot");
  }
  return problems;
}

}  // namespace perch
