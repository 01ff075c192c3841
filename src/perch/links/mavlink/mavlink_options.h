#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "perch/config/section.h"
#include "perch/links/mavlink/landing_output.h"
#include "perch/links/mavlink/signing.h"
#include "perch/links/mavlink/vehicle_link.h"
#include "perch/links/stream_url.h"

namespace perch::mavlink {

// `outputs.mavlink` of a run's configuration (docs/FORMATS.md).
struct MavlinkOptions {
  bool send = false;  // the pad's place; without it the autopilot is only listened to
  LandingOptions landing;
  VehicleLinkOptions link;
  std::optional<SigningOptions> signing;
};

// Reads `mavlink` below `outputs` and refuses unknown keys. Where it is there, `send` is true by default.
MavlinkOptions read_mavlink_options(Section& outputs);

// A key of 32 bytes, as such or as 64 hexadecimal digits. Throws ConfigError.
std::array<uint8_t, 32> read_signing_key(const std::filesystem::path& file);

}  // namespace perch::mavlink
