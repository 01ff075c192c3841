#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

namespace perch {

enum class BodyAxis { kForward, kRight, kDown };  // of FRD

// On the bench: somebody holds the pad still, moves it along one axis of the vehicle and holds it still
// again; that it was seen to move that way shows that the frames' signs and axes are right.
//
//   resting --still for kStill--> moving --moved by kLeastMove and still again--> a verdict
class AxisTest {
 public:
  explicit AxisTest(BodyAxis axis) : axis_(axis) {}

  struct Verdict {
    bool good = false;
    std::string seen;  // "20 cm forward", "18 cm to the left, 3 cm up"
  };
  // The pad's place in body axes at a moment; a verdict once there is one.
  std::optional<Verdict> see(int64_t time_ns, const Eigen::Vector3d& pad_in_body);

  // The pad was still: it may be moved now.
  bool may_move() const { return start_.has_value(); }

  static constexpr int64_t kStill = 1'000'000'000;  // ns
  static constexpr double kStillWithin = 0.02;      // m: what hands do
  static constexpr double kLeastMove = 0.15;        // m: ten times that, nearly
  static constexpr double kMostAside = 0.35;        // of the way along: 20 deg

 private:
  struct Place {
    int64_t time_ns;
    Eigen::Vector3d pad_in_body;
  };
  // Where it was all through the last kStill; nothing while it moves.
  std::optional<Eigen::Vector3d> resting_place() const;
  Verdict verdict(const Eigen::Vector3d& moved) const;

  BodyAxis axis_;
  std::deque<Place> last_;
  std::optional<Eigen::Vector3d> start_;
};

// "forward", "to the right", "down".
std::string direction_name(BodyAxis axis);

}  // namespace perch
