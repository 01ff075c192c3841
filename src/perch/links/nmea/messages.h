#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "perch/geometry/geodetic.h"
#include "perch/links/nmea/sentence.h"

namespace perch::nmea {

// GGA's field 6. What is not named here (6: dead reckoning, 7: set by hand, 8: simulated) is no measurement.
enum class FixQuality : uint8_t {
  kNone = 0,
  kGnss = 1,
  kDifferential = 2,
  kPps = 3,
  kRtk = 4,
  kRtkFloat = 5
};

// "RTK fixed"
const char* name_of(FixQuality quality);

// A time of day is UTC's, ns since midnight; a leap second is the 86401st of its day.

struct Gga {
  int64_t of_day_ns = 0;
  FixQuality quality = FixQuality::kNone;
  Geodetic
      place;  // meaningful with a quality; its height is above the geoid where the separation is not told
  int satellites = 0;
  std::optional<double> hdop;
};

struct Rmc {
  int64_t of_day_ns = 0;
  bool valid = false;
  std::optional<double> speed;   // over ground, m/s
  std::optional<double> course;  // over ground from true north, rad
};

// HDT, THS
struct TrueHeading {
  std::optional<double> heading;  // rad; empty where the receiver has none
};

// GST: standard deviations, m.
struct Gst {
  int64_t of_day_ns = 0;
  std::optional<double> north, east, up;
};

// PASHR (OxTS, Trimble, NovAtel, Applanix, ArduPilot: not Ashtech's own, whose first field is a word),
// PSXN,23 (Seapath) and PRDID (Teledyne RDI). All count roll with the left side up, pitch with the bow up and
// heading to the right from true north as positive: ZYX angles of FRD axes in NED. rad.
struct Attitude {
  std::optional<int64_t> of_day_ns;  // PASHR alone
  std::optional<double> heading;     // may be missing while it is not aligned: HDT can stand in
  double roll = 0, pitch = 0;
  std::optional<double> sigma;  // the largest of the three that PASHR tells
};

struct Unknown {};    // a sentence of another kind
struct Malformed {};  // one of ours with fields that it cannot have

using Message = std::variant<Unknown, Malformed, Gga, Rmc, TrueHeading, Gst, Attitude>;

// Strict: the number of fields, each one's form, its range. A field that may be empty is nothing then; any
// other makes the sentence malformed.
Message decode(const Sentence& sentence);

}  // namespace perch::nmea
