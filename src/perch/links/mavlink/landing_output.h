#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "perch/geometry/uncertainty.h"
#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/vehicle_history.h"
#include "perch/links/mavlink/vehicle_link.h"
#include "perch/tracking/vehicle_state.h"

namespace perch::mavlink {

// What an autopilot wants to be told, and how.
//   ardupilot  LANDING_TARGET, BODY_FRD: from the body's origin, as of the send time minus PLND_LAG
//   px4        LANDING_TARGET, LOCAL_NED: the pad's place, with attitude and position of the moment of
//   exposure px4-vte    TARGET_RELATIVE, BODY_FRD or LOCAL_OFFSET_NED, of the moment of exposure, with its
//   uncertainty
enum class LandingProfile { kNone, kArdupilot, kPx4, kPx4Vte };

std::string_view name_of(LandingProfile profile);  // "ardupilot", ...
std::optional<LandingProfile> profile_named(std::string_view name);
// From the heartbeat, and on PX4 from VTE_EN, which older ones do not have; kNone, and nothing is sent, until
// that is answered or asked for in vain, and for other autopilots.
LandingProfile profile_for(const Autopilot& autopilot, const ParameterReader& parameters);

// The pad as seen from the body at the moment of exposure.
struct PadSighting {
  int64_t capture_ns = 0;                   // mid-exposure, our CLOCK_MONOTONIC
  UncertainRigid3 body_from_pad;            // body axes FRD
  std::optional<Eigen::Vector3d> velocity;  // of the body relative to the pad, in body axes, m/s
  std::optional<Eigen::Vector3d> rate;      // of the body relative to the pad, in body axes, rad/s
  bool trusted = false;  // neither ambiguous nor unverified nor predicted for too long: the caller knows
};

PadSighting sighting_from(const VehicleState& state, int64_t capture_ns, bool trusted);

enum class LandingRefusal {
  kNone,
  kNoLink,  // no autopilot, or one we know no profile for
  kUntrusted,
  kNotFinite,   // a number, rotation or covariance that is none
  kStale,       // seen too long ago
  kFuture,      // seen later than now: two clocks got mixed
  kRepeated,    // not newer than the last that was sent
  kNoAttitude,  // not known at the moment it is needed for
  kNoPosition,
  kReset,  // the autopilot's map was moved since the exposure
};
inline constexpr size_t kLandingRefusals = 10;
std::string_view name_of(LandingRefusal refusal);

// An answer is one of the two, or none and the reason.
struct LandingMessage {
  LandingRefusal refusal = LandingRefusal::kNone;
  std::optional<LandingTarget> landing_target;
  std::optional<TargetRelative> target_relative;
};

struct LandingOptions {
  std::optional<LandingProfile> profile;  // absent: from the heartbeat
  // Older sightings are not sent: at 1 m/s^2 unknown a prediction over 0.5 s is off by 12 cm.
  double max_age = 0.5;  // s
  // Used where PLND_LAG could not be read: its default.
  double lag = 0.02;  // s
};

// Each makes the message of one profile, or says why not. Ages and trust have been looked at by then.
LandingMessage ardupilot_message(const PadSighting& sighting, const VehicleHistory& history,
                                 int64_t target_ns);
LandingMessage px4_message(const PadSighting& sighting, const VehicleHistory& history);
LandingMessage px4_vte_message(const PadSighting& sighting, const VehicleHistory& history);

// From sightings to bytes: chooses the profile, refuses what must not be sent, counts both.
//
//   stream.write(output.bytes(sighting_from(state, capture_ns, trusted), link, monotonic_ns()));
class LandingOutput {
 public:
  explicit LandingOutput(const LandingOptions& options = {}) : options_(options) {}

  // The frame to send at once; empty when refused.
  std::vector<uint8_t> bytes(const PadSighting& sighting, VehicleLink& link, int64_t now_ns);

  LandingProfile profile(const VehicleLink& link) const;
  LandingRefusal last_refusal() const { return last_refusal_; }
  uint64_t sent() const { return count(LandingRefusal::kNone); }
  uint64_t count(LandingRefusal refusal) const { return counts_[static_cast<size_t>(refusal)]; }

 private:
  LandingMessage message(const PadSighting& sighting, const VehicleLink& link, int64_t now_ns) const;
  LandingRefusal refusal_before(const PadSighting& sighting, const VehicleLink& link, int64_t now_ns) const;

  LandingOptions options_;
  std::optional<int64_t> last_capture_ns_;
  LandingRefusal last_refusal_ = LandingRefusal::kNone;
  std::array<uint64_t, kLandingRefusals> counts_{};
};

}  // namespace perch::mavlink
