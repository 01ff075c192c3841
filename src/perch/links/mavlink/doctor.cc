#include "perch/links/mavlink/doctor.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

using Severity = FindingSeverity;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.4g", value);
  return text;
}

// A parameter that is a set of bits; from the wire it may be any number.
bool has_bit(double value, int64_t bit) {
  return value >= 0 && value < 1e9 && (static_cast<int64_t>(value) & bit) != 0;
}

// Collects findings about one snapshot.
struct Examination {
  const VehicleSnapshot& is;
  std::vector<Finding> findings;

  void add(Severity severity, const std::string& subject, const std::string& found, const std::string& why,
           const std::string& remedy = "") {
    findings.push_back({severity, subject, found, why, remedy});
  }

  std::optional<double> value(const std::string& name) const {
    const auto found = is.parameters.find(name);
    return found == is.parameters.end() ? std::nullopt : std::optional(found->second);
  }

  // A finding about a parameter that is there and for which `wrong` holds.
  template <class Wrong>
  void parameter(const std::string& name, Severity severity, Wrong wrong, const std::string& why,
                 const std::string& remedy = "") {
    if (const auto v = value(name); v && wrong(*v)) add(severity, name, number(*v), why, remedy);
  }
};

const auto kIsZero = [](double v) { return v == 0; };
const auto kIsNotZero = [](double v) { return v != 0; };

// ---- Links and clocks, alike for all.

void examine_clock(Examination& e) {
  if (!e.is.clock && e.is.asked) {
    return e.add(Severity::kWarning, "clock", "unknown",
                 "answers count as of the middle of their round trip, and may be off by half of it",
                 "have it answer TIMESYNC or SYSTEM_TIME, on a quicker line");
  }
  if (!e.is.clock) {
    return e.add(Severity::kError, "TIMESYNC", "unanswered",
                 "without it no attitude of the autopilot can be put beside a picture",
                 "connect to a port with MAVLink 2 on which the autopilot answers TIMESYNC");
  }
  const double round_trip = static_cast<double>(e.is.clock->min_round_trip_ns) * 1e-9;
  // mavlink_timesync.h: exchanges that took longer do not count.
  if (e.is.autopilot.is_px4() && round_trip > 0.010) {
    e.add(Severity::kWarning, "TIMESYNC round trip", number(1e3 * round_trip) + " ms",
          "above 10 ms PX4 does not use our time stamps but the time of arrival, without a word",
          "connect by Ethernet, USB or a serial port with 921600 baud, not by a radio");
  }
  // mavlink_timesync.h: the estimate counts as converged after 500 exchanges, which at 10 Hz take 50 s.
  if (e.is.autopilot.is_px4() && e.is.asked_for_time == 0) {
    e.add(Severity::kWarning, "TIMESYNC of PX4", "not asked",
          "PX4 does not learn our clock and takes a measurement for as old as it is on arrival",
          "set the port's MAV_0_MODE (_1_, _2_) to Onboard");
  } else if (e.is.autopilot.is_px4() && e.is.asked_for_time < 500) {
    e.add(Severity::kNote, "TIMESYNC of PX4",
          number(static_cast<double>(e.is.asked_for_time)) + " of 500 exchanges",
          "until then PX4 takes a measurement for as old as it is on arrival");
  }
}

void examine_streams(Examination& e) {
  const auto low = [&](const std::string& what, double hz, double least, Severity severity,
                       const std::string& why) {
    if (hz < least)
      e.add(severity, what, number(hz) + " Hz", why,
            "raise the port's baud rate and allow SET_MESSAGE_INTERVAL; " + number(least) + " Hz are wanted");
  };
  if (e.is.attitude_hz < 20) {
    low("attitude rate", e.is.attitude_hz, 20, Severity::kError,
        "between samples so far apart a turn is not known, and the pad is put into the wrong place");
  } else {
    low("attitude rate", e.is.attitude_hz, 50, Severity::kWarning,
        "a vehicle turns by degrees between two samples");
  }
  const bool needs_position = e.is.profile == LandingProfile::kPx4;
  low("position rate", e.is.position_hz, 10, needs_position ? Severity::kError : Severity::kWarning,
      needs_position ? "PX4 is told the pad's place in its own map, for which its position is needed"
                     : "the vehicle's own acceleration is missing from the prediction");
  if (needs_position && e.is.position_hz >= 10 && e.is.odometry_hz == 0) {
    e.add(Severity::kWarning, "ODOMETRY", "not received",
          "it alone tells when PX4 moves its map; small moves between exposure and sending go unnoticed",
          "allow SET_MESSAGE_INTERVAL for message 331");
  }
  if (e.is.autopilot.is_px4() && e.is.global_hz == 0) {
    e.add(Severity::kWarning, "GLOBAL_POSITION_INT", "not received",
          "PX4 refuses a precision landing without a valid global position", "wait for a GNSS fix");
  }
  if (e.is.gimbal) {
    low("gimbal rate", e.is.gimbal_hz, 20, e.is.gimbal_hz == 0 ? Severity::kError : Severity::kWarning,
        "the camera's direction is not known at the exposure");
  }
  if (e.is.lost_fraction > 0.05) {
    e.add(Severity::kWarning, "lost frames", number(100 * e.is.lost_fraction) + " %",
          "measurements are lost the same way", "lower other streams' rates or use a better link");
  }
}

void examine_reading(Examination& e) {
  if (!e.is.unread.empty()) {
    std::string names;
    for (const std::string& name : e.is.unread) names += (names.empty() ? "" : ", ") + name;
    e.add(Severity::kWarning, "parameters", "not all read", "nothing is known of " + names,
          "wait, or look at the link");
  }
  if (e.is.autopilot.armed())
    e.add(Severity::kNote, "vehicle", "armed", "what is set now may take effect in flight");
}

// ---- ArduPilot: AC_PrecLand.

void examine_ardupilot_source(Examination& e) {
  e.parameter(
      "PLND_TYPE", Severity::kError, [](double v) { return v != 1; },
      "LANDING_TARGET is listened to with 1 (MAVLink) alone", "set PLND_TYPE to 1 and reboot");
  e.parameter(
      "PLND_ORIENT", Severity::kError, [](double v) { return v != kOrientationDown; },
      "Perch sends a vector in body axes, for which the sensor must be said to look down",
      "set PLND_ORIENT to 25 and reboot");
  e.parameter("PLND_YAW_ALIGN", Severity::kError, kIsNotZero,
              "the vector is in body axes already and would be turned a second time",
              "set PLND_YAW_ALIGN to 0");
  for (const char* name : {"PLND_CAM_POS_X", "PLND_CAM_POS_Y", "PLND_CAM_POS_Z"}) {
    e.parameter(name, Severity::kError, kIsNotZero,
                "the camera's place is in Perch's frames.body_from_base; given twice, the lens lands on the "
                "pad instead "
                "of the vehicle",
                std::string("set ") + name +
                    " to 0; to touch down beside the pad's centre use PLND_LAND_OFS_X and _Y");
  }
  e.parameter("PLND_EST_TYPE", Severity::kWarning, kIsZero, "the raw sensor makes it twitch and knows no lag",
              "set PLND_EST_TYPE to 1 (Kalman filter)");
  for (const char* name : {"PLND_LAND_OFS_X", "PLND_LAND_OFS_Y"}) {
    e.parameter(name, Severity::kNote, kIsNotZero,
                "it touches down so many centimetres beside the pad's centre");
  }
}

void examine_ardupilot_lag(Examination& e) {
  e.parameter(
      "PLND_LAG", Severity::kWarning, [](double v) { return v < 0.02 || v > 0.25; },
      "ArduPilot cuts it to 0.02..0.25 s", "set PLND_LAG within 0.02..0.25 and reboot");
  const auto lag = e.value("PLND_LAG");
  // Predicting over 0.1 s misses 1 cm at 2 m/s^2.
  if (lag && e.is.latency && std::abs(*lag - *e.is.latency) > 0.1) {
    const double wanted = std::clamp(*e.is.latency, 0.02, 0.25);
    e.add(Severity::kWarning, "PLND_LAG", number(*lag),
          "from exposure to sending it takes " + number(*e.is.latency) +
              " s: each vector is predicted over the difference",
          "set PLND_LAG to " + number(wanted) + " and reboot");
  }
}

void examine_ardupilot_descent(Examination& e) {
  e.parameter("PLND_XY_DIST_MAX", Severity::kWarning, kIsZero, "it descends however far from the pad it is",
              "set PLND_XY_DIST_MAX to 2.5");
  e.parameter(
      "PLND_XY_DIST_MAX", Severity::kWarning, [](double v) { return v > 0 && v < 0.3; },
      "in wind it may never be that near, and then it never descends", "set PLND_XY_DIST_MAX to 2.5");
  e.parameter("PLND_STRICT", Severity::kWarning, kIsZero, "when the pad is lost it lands where it is",
              "set PLND_STRICT to 1 (retry) or 2 (hover)");
  const auto strict = e.value("PLND_STRICT");
  if (strict && *strict > 0) {
    e.parameter("PLND_RET_MAX", Severity::kWarning, kIsZero,
                "PLND_STRICT asks for retries, and none are allowed", "set PLND_RET_MAX to 4");
  }
  const bool rangefinder = e.is.range_hz > 0;
  const auto least = e.value("PLND_ALT_MIN"), most = e.value("PLND_ALT_MAX");
  for (const auto& [name, limit] : {std::pair("PLND_ALT_MIN", least), {"PLND_ALT_MAX", most}}) {
    if (rangefinder || !limit || *limit == 0) continue;
    e.add(Severity::kWarning, name, number(*limit),
          "without a rangefinder the pad counts as out of range for ever, and a landing is never retried",
          std::string("mount a rangefinder, or set ") + name + " to 0");
  }
  if (rangefinder && least && most && *most > 0 && *least >= *most) {
    e.add(Severity::kWarning, "PLND_ALT_MIN", number(*least),
          "it is not below PLND_ALT_MAX (" + number(*most) + "), so that the pad is never in range",
          "set PLND_ALT_MIN to 0.75");
  }
}

void examine_ardupilot_range(Examination& e) {
  const auto type = e.value("RNGFND1_TYPE");
  if (!type || *type == 0 || e.is.range_hz > 0) return;
  const auto orientation = e.value("RNGFND1_ORIENT");
  const bool aside = orientation && *orientation != kOrientationDown;
  e.add(Severity::kWarning, aside ? "RNGFND1_ORIENT" : "RNGFND1_TYPE", number(aside ? *orientation : *type),
        aside ? "the rangefinder does not look down"
              : "a rangefinder is set up, but none that looks down reports",
        aside ? "set RNGFND1_ORIENT to 25" : "look at its wiring and its other parameters");
}

void examine_ardupilot(Examination& e) {
  const auto enabled = e.value("PLND_ENABLED");
  if (!enabled && e.is.absent.count("PLND_ENABLED")) {
    return e.add(Severity::kError, "PLND_ENABLED", "missing",
                 "this firmware is built without precision landing",
                 "load one that has it (custom.ardupilot.org)");
  }
  // While it is off the other parameters are hidden.
  if (enabled && *enabled == 0) {
    return e.add(Severity::kError, "PLND_ENABLED", "0", "precision landing is off",
                 "set PLND_ENABLED to 1, reboot and check again: the other parameters show only then");
  }
  examine_ardupilot_source(e);
  examine_ardupilot_lag(e);
  examine_ardupilot_descent(e);
  examine_ardupilot_range(e);
  if (const auto options = e.value("PLND_OPTIONS"); options && has_bit(*options, 1))
    e.add(Severity::kNote, "PLND_OPTIONS", number(*options), "the pad is taken for a moving one");
}

// ---- PX4: precland, the landing target estimator, the vision target estimator.

void examine_px4(Examination& e) {
  e.parameter(
      "RTL_PLD_MD", Severity::kWarning, kIsZero,
      "a return lands without looking for the pad; only missions whose NAV_LAND has param2 = 1 or 2 do",
      "set RTL_PLD_MD to 1 (when seen) or 2 (required)");
  e.parameter(
      "PLD_BTOUT", Severity::kWarning, [](double v) { return v < 1; },
      "the pad counts as lost after less than a second", "set PLD_BTOUT to 5");
  e.parameter(
      "PLD_HACC_RAD", Severity::kWarning, [](double v) { return v < 0.1; },
      "in wind it may never be that near, and then it never descends", "set PLD_HACC_RAD to 0.2");
  const auto mode = e.value("RTL_PLD_MD");
  if (mode && *mode == 2) {
    e.parameter("PLD_MAX_SRCH", Severity::kWarning, kIsZero, "the pad is required, and never searched for",
                "set PLD_MAX_SRCH to 3");
  }
  for (const char* name : {"LTEST_SENS_POS_X", "LTEST_SENS_POS_Y", "LTEST_SENS_POS_Z", "LTEST_SENS_ROT"}) {
    e.parameter(name, Severity::kWarning, kIsNotZero,
                "the camera's place and turn are in Perch's frames.body_from_base; PX4 would apply its own "
                "to an IR-LOCK "
                "sensor that runs beside it",
                std::string("set ") + name + " to 0");
  }
  if (e.is.profile == LandingProfile::kPx4 && e.value("VTE_EN") == 1.0) {
    e.add(Severity::kWarning, "VTE_EN", "1",
          "the estimator waits for TARGET_RELATIVE, and LANDING_TARGET is sent",
          "use the profile px4-vte, or set VTE_EN to 0");
  }
}

void examine_px4_vte(Examination& e) {
  const auto enabled = e.value("VTE_EN");
  if (!enabled || *enabled == 0) {
    return e.add(
        Severity::kWarning, "VTE_EN", enabled ? "0" : "missing",
        "the vision target estimator does not run; measurements are used as they come, or not at all",
        "set VTE_EN to 1, or use the profile px4");
  }
  // Bit 2: the target's relative position from vision.
  e.parameter(
      "VTE_AID_MASK", Severity::kError, [](double v) { return !has_bit(v, 4); },
      "vision is not among what the estimator fuses", "add 4 to VTE_AID_MASK and reboot");
  e.parameter(
      "VTE_EVP_NOISE", Severity::kWarning, [](double v) { return v > 0.03; },
      "so many metres are the least it believes of a measurement: centimetres are thrown away",
      "set VTE_EVP_NOISE to 0.02");
  e.parameter(
      "VTE_EVA_NOISE", Severity::kNote, [](double v) { return v > 0.06; },
      "so many radians are the least it believes of the pad's yaw");
  e.parameter("VTE_EV_NOISE_MD", Severity::kWarning, kIsNotZero,
              "the uncertainty that Perch sends is not used", "set VTE_EV_NOISE_MD to 0");
}

}  // namespace

VehicleSnapshot snapshot_of(const VehicleLink& link, LandingProfile profile, int64_t now_ns) {
  VehicleSnapshot is;
  is.heard = link.state() == LinkState::kUp;
  is.autopilot = link.autopilot();
  is.profile = profile;
  is.parameters = link.parameters().values();
  is.absent = link.parameters().absent();
  for (const std::string& name : landing_parameters(is.autopilot.autopilot)) {
    if (!is.parameters.count(name) && !is.absent.count(name)) is.unread.insert(name);
  }
  is.clock = link.clock().estimate(now_ns);
  is.odometry_hz = link.rate_hz(Odometry::kId, now_ns);
  is.global_hz = link.rate_hz(GlobalPositionInt::kId, now_ns);
  is.asked = link.asks_each();
  is.asked_for_time = link.clock().statistics().answered;
  is.attitude_hz = std::max(
      {link.rate_hz(AttitudeQuaternion::kId, now_ns), link.rate_hz(Attitude::kId, now_ns), is.odometry_hz});
  is.position_hz = std::max(is.odometry_hz, link.rate_hz(LocalPositionNed::kId, now_ns));
  const RangeSample* range = link.history().ranges().latest();
  if (range && now_ns - range->time_ns < 2'000'000'000)
    is.range_hz = link.rate_hz(DistanceSensor::kId, now_ns);
  is.gimbal_hz = link.rate_hz(GimbalDeviceAttitudeStatus::kId, now_ns);
  const auto& sources = link.parser_statistics().sources;
  if (const auto source = sources.find({is.autopilot.system, mav_component::kAutopilot});
      source != sources.end()) {
    const auto lost = static_cast<double>(source->second.lost);
    is.lost_fraction = lost / (lost + static_cast<double>(source->second.received));
  }
  return is;
}

std::vector<Finding> examine(const VehicleSnapshot& snapshot) {
  Examination e{snapshot, {}};
  if (!snapshot.heard) {
    e.add(Severity::kError, "autopilot", "not heard",
          "no heartbeat of an autopilot has come, or it has stopped",
          "look at the wiring, the port, its baud rate and its protocol (MAVLink 2)");
    return e.findings;
  }
  examine_clock(e);
  examine_streams(e);
  examine_reading(e);
  if (snapshot.autopilot.is_ardupilot()) {
    examine_ardupilot(e);
  } else if (snapshot.autopilot.is_px4()) {
    examine_px4(e);
    if (snapshot.profile == LandingProfile::kPx4Vte) examine_px4_vte(e);
  } else {
    e.add(Severity::kError, "autopilot", "MAV_AUTOPILOT " + number(snapshot.autopilot.autopilot),
          "Perch knows what ArduPilot and PX4 want to be told, and no other",
          "choose outputs.mavlink.profile by hand");
  }
  std::stable_sort(e.findings.begin(), e.findings.end(),
                   [](const Finding& a, const Finding& b) { return a.severity > b.severity; });
  return e.findings;
}

std::string to_text(const Finding& finding) {
  constexpr const char* kNames[] = {"note", "warning", "error"};
  std::string text = std::string(kNames[static_cast<size_t>(finding.severity)]) + ": " + finding.subject +
                     " is " + finding.found + ": " + finding.why;
  if (!finding.remedy.empty()) text += "; " + finding.remedy;
  return text;
}

}  // namespace perch::mavlink
