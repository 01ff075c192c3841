#include "perch/links/mavlink/mavlink_options.h"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <iterator>

#include "perch/config/error.h"

namespace perch::mavlink {
namespace {

constexpr char kWhitespace[] = " \t\r\n";

std::optional<uint8_t> hexadecimal(std::string_view two) {
  uint8_t value = 0;
  const auto [end, error] = std::from_chars(two.data(), two.data() + two.size(), value, 16);
  if (error != std::errc{} || end != two.data() + two.size()) return std::nullopt;
  return value;
}

void read_byte(Section& section, std::string_view key, uint8_t& value, Range range) {
  int number = value;
  section.read(key, number, range);
  value = static_cast<uint8_t>(number);
}

SigningOptions read_signing(Section signing) {
  SigningOptions options;
  if (!signing.has("key")) signing.fail("key", "a file with the link's key");
  std::filesystem::path file;
  signing.read("key", file);
  options.key = read_signing_key(file);
  read_byte(signing, "link_id", options.link_id, Range{0, 255});
  signing.read("accept_unsigned", options.accept_unsigned);
  signing.done();
  return options;
}

}  // namespace

std::array<uint8_t, 32> read_signing_key(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file)) throw ConfigError(file.string() + ": cannot be read");
  std::string text(std::istreambuf_iterator<char>(stream), {});
  std::array<uint8_t, 32> key{};
  if (text.size() == key.size()) {
    std::copy(text.begin(), text.end(), key.begin());
    return key;
  }
  text.erase(text.find_last_not_of(kWhitespace) + 1);
  bool good = text.size() == 2 * key.size();
  for (size_t i = 0; good && i < key.size(); ++i) {
    const auto byte = hexadecimal(std::string_view(text).substr(2 * i, 2));
    good = byte.has_value();
    key[i] = byte.value_or(0);
  }
  // Not what was found instead: it may be a key with a slip of the pen.
  if (!good) throw ConfigError(file.string() + ": expected a key of 32 bytes or 64 hexadecimal digits");
  return key;
}

MavlinkOptions read_mavlink_options(Section& outputs) {
  MavlinkOptions options;
  options.send = outputs.has("mavlink");
  Section mavlink = outputs.section("mavlink");
  mavlink.read("send", options.send);
  LandingProfile profile = LandingProfile::kNone;
  mavlink.read_choice("profile", profile,
                      {{"auto", LandingProfile::kNone},
                       {"ardupilot", LandingProfile::kArdupilot},
                       {"px4", LandingProfile::kPx4},
                       {"px4-vte", LandingProfile::kPx4Vte}});
  if (profile != LandingProfile::kNone) options.landing.profile = profile;
  mavlink.read("max_age", options.landing.max_age, Range{0.02, 2});
  read_byte(mavlink, "system", options.link.system, Range{0, 255});
  read_byte(mavlink, "component", options.link.component, Range{1, 255});
  mavlink.read("attitude_hz", options.link.attitude_hz, Range{1, 400});
  mavlink.read("position_hz", options.link.position_hz, Range{1, 400});
  if (mavlink.has("signing")) options.signing = read_signing(mavlink.section("signing"));
  mavlink.done();
  return options;
}

}  // namespace perch::mavlink
