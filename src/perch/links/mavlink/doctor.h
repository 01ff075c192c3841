#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "perch/links/mavlink/landing_output.h"
#include "perch/links/mavlink/time_sync.h"
#include "perch/links/mavlink/vehicle_link.h"

namespace perch::mavlink {

// What a check of the set-up looks at, as one moment shows it.
struct VehicleSnapshot {
  bool heard = false;
  Autopilot autopilot;
  LandingProfile profile = LandingProfile::kNone;
  std::map<std::string, double> parameters;
  std::set<std::string> absent;  // asked for in vain
  std::set<std::string> unread;  // not answered yet
  std::optional<ClockEstimate> clock;
  double attitude_hz = 0;
  double position_hz = 0;  // ODOMETRY or LOCAL_POSITION_NED, whichever comes
  double odometry_hz = 0;
  double global_hz = 0;  // GLOBAL_POSITION_INT
  bool asked = false;    // it answers only: without a clock its answers are placed by their round trips
  uint64_t asked_for_time = 0;  // how often the autopilot asked for our time
  double range_hz = 0;          // of a rangefinder that looks down
  double lost_fraction = 0;     // of the autopilot's frames

  // Of our own set-up.
  bool gimbal = false;  // the camera is on one, and its angles come by MAVLink
  double gimbal_hz = 0;
  std::optional<double> latency;  // s, exposure to bytes out, the usual one
};

// The link's part of it; the caller fills in what is ours.
VehicleSnapshot snapshot_of(const VehicleLink& link, LandingProfile profile, int64_t now_ns);

enum class FindingSeverity {
  kNote,     // worth knowing
  kWarning,  // the landing will be worse than it could be, or not what is expected
  kError,    // it will not land on the pad, or somewhere else
};

struct Finding {
  FindingSeverity severity = FindingSeverity::kNote;
  std::string subject;  // the parameter, or "attitude rate" and the like
  std::string found;    // its value: "2", "12 Hz"
  std::string why;
  std::string remedy;  // "set PLND_TYPE to 1"; empty for a note
};

// Everything that is wrong for landing on vision, the worst first. A pure function of the snapshot.
std::vector<Finding> examine(const VehicleSnapshot& snapshot);

// "error: PLND_TYPE is 2: why; set PLND_TYPE to 1"
std::string to_text(const Finding& finding);

}  // namespace perch::mavlink
