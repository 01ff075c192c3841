#include "perch/links/nmea/messages.h"

#include <charconv>
#include <cmath>

#include "perch/geometry/euler.h"

namespace perch::nmea {
namespace {

constexpr double kMetresPerSecondFromKnots = 1852.0 / 3600;

bool digits_only(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789") == std::string_view::npos;
}

// Reads the fields of one sentence. The first that cannot be makes it bad, whatever follows.
class Fields {
 public:
  explicit Fields(const Sentence& sentence) : fields_(sentence.fields) {}

  bool good() const { return good_; }
  void counts(size_t least, size_t most) {
    good_ = good_ && fields_.size() >= least && fields_.size() <= most;
  }
  std::string_view text(size_t i) const { return i < fields_.size() ? fields_[i] : std::string_view{}; }
  void expect(size_t i, std::string_view what) { good_ = good_ && text(i) == what; }

  // A decimal number within [low, high]; no exponent, no "inf".
  std::optional<double> number(size_t i, double low, double high) {
    std::string_view field = text(i);
    if (field.empty()) return std::nullopt;
    if (field.size() > 1 && field[0] == '+' && field[1] != '-') field.remove_prefix(1);
    double value = 0;
    const auto [rest, error] =
        std::from_chars(field.data(), field.data() + field.size(), value, std::chars_format::fixed);
    if (error != std::errc{} || rest != field.data() + field.size() || !(value >= low && value <= high)) {
      good_ = false;
      return std::nullopt;
    }
    return value;
  }
  double needed(size_t i, double low, double high) {
    const auto value = number(i, low, high);
    if (!value) good_ = false;
    return value.value_or(0);
  }
  int whole(size_t i, int most) {
    if (!digits_only(text(i)) || text(i).size() > 4) good_ = false;
    return good_ ? static_cast<int>(needed(i, 0, most)) : 0;
  }

  // hhmmss or hhmmss.s...
  int64_t of_day_ns(size_t i) {
    const std::string_view field = text(i);
    if (field.size() < 6 || !digits_only(field.substr(0, 6)) || (field.size() > 6 && field[6] != '.') ||
        (field.size() > 7 && !digits_only(field.substr(7)))) {
      good_ = false;
      return 0;
    }
    const auto two = [&](size_t at) { return 10 * (field[at] - '0') + (field[at + 1] - '0'); };
    const int hours = two(0), minutes = two(2), seconds = two(4);
    if (hours > 23 || minutes > 59 || seconds > 60) good_ = false;
    int64_t fraction = 0, unit = 1'000'000'000;
    for (size_t at = 7; at < field.size() && unit > 1; ++at) {
      unit /= 10;
      fraction += unit * (field[at] - '0');
    }
    return (hours * 3600 + minutes * 60 + seconds) * int64_t{1'000'000'000} + fraction;
  }

  // (d)ddmm.mmmm with its hemisphere in the next field, rad.
  double angle(size_t i, size_t degree_digits, char positive, char negative) {
    const std::string_view field = text(i), side = text(i + 1);
    const bool one_side = side.size() == 1 && (side[0] == positive || side[0] == negative);
    const size_t point = std::min(field.find('.'), field.size());
    if (!one_side || point != degree_digits + 2 || !digits_only(field.substr(0, point))) {
      good_ = false;
      return 0;
    }
    const double value = needed(i, 0, 18000);
    const double degrees = std::floor(value / 100), minutes = value - 100 * degrees;
    const double all = degrees + minutes / 60;
    if (!(minutes < 60 && all <= (degree_digits == 2 ? 90 : 180))) good_ = false;
    return (side[0] == positive ? all : -all) * kRadFromDeg;
  }

  std::optional<double> degrees(size_t i, double low, double high) {
    const auto value = number(i, low, high);
    return value ? std::optional(*value * kRadFromDeg) : std::nullopt;
  }

 private:
  std::span<const std::string_view> fields_;
  bool good_ = true;
};

FixQuality quality_of(int number) {
  return number <= static_cast<int>(FixQuality::kRtkFloat) ? static_cast<FixQuality>(number)
                                                           : FixQuality::kNone;
}

// time, lat, N, lon, E, quality, satellites, HDOP, height, M, separation, M, age, station
Gga gga(Fields& f) {
  Gga m;
  f.counts(14, 14);
  const int quality = f.whole(5, 8);
  m.quality = quality_of(quality);
  if (quality == 0) return m;  // all else may be empty, the time too
  m.of_day_ns = f.of_day_ns(0);
  m.place.latitude = f.angle(1, 2, 'N', 'S');
  m.place.longitude = f.angle(3, 3, 'E', 'W');
  m.satellites = f.whole(6, 99);
  m.hdop = f.number(7, 0, 100);
  m.place.height = f.needed(8, -1000, 100'000);
  f.expect(9, "M");
  // The geoid is 107 m below and 86 m above the ellipsoid at most.
  if (const auto separation = f.number(10, -150, 150)) m.place.height += *separation;
  return m;
}

// time, status, lat, N, lon, E, knots, course, date, variation, E, mode and status of later versions
Rmc rmc(Fields& f) {
  Rmc m;
  f.counts(11, 13);
  m.valid = f.text(1) == "A";
  if (!m.valid) {
    f.expect(1, "V");
    return m;
  }
  m.of_day_ns = f.of_day_ns(0);
  f.angle(2, 2, 'N', 'S');
  f.angle(4, 3, 'E', 'W');
  if (const auto knots = f.number(6, 0, 1000)) m.speed = *knots * kMetresPerSecondFromKnots;
  m.course = f.degrees(7, 0, 360);
  return m;
}

TrueHeading hdt(Fields& f) {
  f.counts(2, 2);
  TrueHeading m{f.degrees(0, 0, 360)};
  if (m.heading) f.expect(1, "T");
  return m;
}

// heading, mode (A: by itself; V: not valid)
TrueHeading ths(Fields& f) {
  f.counts(2, 2);
  TrueHeading m{f.degrees(0, 0, 360)};
  if (f.text(1) != "A") m.heading.reset();
  return m;
}

// time, rms, semi-major, semi-minor, orientation, latitude, longitude, height
Gst gst(Fields& f) {
  f.counts(8, 8);
  Gst m;
  if (f.text(0).empty()) return m;  // no fix
  m.of_day_ns = f.of_day_ns(0);
  m.north = f.number(5, 0, 1e6);
  m.east = f.number(6, 0, 1e6);
  m.up = f.number(7, 0, 1e6);
  return m;
}

// time, heading, T, roll, pitch, heave, sigmas of roll, pitch and heading, GNSS quality, INS status
Message pashr(Fields& f) {
  // Ashtech's own sentences have a word here.
  if (!f.text(0).empty() && !digits_only(f.text(0).substr(0, 1))) return Unknown{};
  Attitude m;
  f.counts(10, 11);
  if (f.text(3).empty() && f.text(4).empty()) return Unknown{};  // not aligned yet
  m.of_day_ns = f.of_day_ns(0);
  m.heading = f.degrees(1, 0, 360);
  if (m.heading) f.expect(2, "T");
  m.roll = kRadFromDeg * f.needed(3, -180, 180);
  m.pitch = kRadFromDeg * f.needed(4, -90, 90);
  for (size_t i = 6; i < 9; ++i) {
    if (const auto sigma = f.degrees(i, 0, 180)) m.sigma = std::max(*sigma, m.sigma.value_or(0));
  }
  return m;
}

// 23, roll, pitch, heading, heave
Message psxn(Fields& f) {
  if (f.text(0) != "23") return Unknown{};
  f.counts(5, 5);
  Attitude m;
  m.roll = kRadFromDeg * f.needed(1, -180, 180);
  m.pitch = kRadFromDeg * f.needed(2, -90, 90);
  m.heading = f.degrees(3, 0, 360);
  return m;
}

// pitch, roll, heading
Attitude prdid(Fields& f) {
  f.counts(3, 3);
  Attitude m;
  m.pitch = kRadFromDeg * f.needed(0, -90, 90);
  m.roll = kRadFromDeg * f.needed(1, -180, 180);
  m.heading = f.degrees(2, 0, 360);
  return m;
}

}  // namespace

const char* name_of(FixQuality quality) {
  constexpr const char* kNames[] = {"no fix", "GNSS", "differential", "PPS", "RTK fixed", "RTK float"};
  return kNames[static_cast<size_t>(quality)];
}

Message decode(const Sentence& sentence) {
  Fields fields(sentence);
  Message message;
  if (sentence.is("GGA")) {
    message = gga(fields);
  } else if (sentence.is("RMC")) {
    message = rmc(fields);
  } else if (sentence.is("HDT")) {
    message = hdt(fields);
  } else if (sentence.is("THS")) {
    message = ths(fields);
  } else if (sentence.is("GST")) {
    message = gst(fields);
  } else if (sentence.address == "PASHR") {
    message = pashr(fields);
  } else if (sentence.address == "PSXN") {
    message = psxn(fields);
  } else if (sentence.address == "PRDID") {
    message = prdid(fields);
  }
  return fields.good() ? message : Message(Malformed{});
}

}  // namespace perch::nmea
