#include "perch/links/mavlink/parameters.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "perch/links/mavlink/messages.h"
#include "perch/links/mavlink/numbers.h"

namespace perch::mavlink {
namespace {

// Autopilots answer one parameter per pass of a slow loop; over a radio a round trip may take half a second.
constexpr int64_t kAnswerWithin = 700'000'000;
// With 30 % loss each way half of the exchanges fail: eight in a row one time in 200.
constexpr int kMaxTries = 8;
constexpr int kMaxUnderWay = 8;

// The bytes of a float read as an integer.
template <class T>
double as_integer(float value) {
  T integer{};
  std::memcpy(&integer, &value, sizeof(integer));
  return static_cast<double>(integer);
}

}  // namespace

std::vector<std::string> landing_parameters(uint8_t autopilot) {
  if (autopilot == mav_autopilot::kArdupilot) {
    return {"PLND_ENABLED",    "PLND_TYPE",       "PLND_EST_TYPE", "PLND_YAW_ALIGN", "PLND_CAM_POS_X",
            "PLND_CAM_POS_Y",  "PLND_CAM_POS_Z",  "PLND_ORIENT",   "PLND_LAG",       "PLND_XY_DIST_MAX",
            "PLND_ALT_MIN",    "PLND_ALT_MAX",    "PLND_STRICT",   "PLND_RET_MAX",   "PLND_OPTIONS",
            "PLND_LAND_OFS_X", "PLND_LAND_OFS_Y", "RNGFND1_TYPE",  "RNGFND1_ORIENT"};
  }
  if (autopilot == mav_autopilot::kPx4) {
    return {"RTL_PLD_MD",       "PLD_BTOUT",        "PLD_HACC_RAD",     "PLD_FAPPR_ALT",
            "PLD_SRCH_ALT",     "PLD_MAX_SRCH",     "LTEST_MODE",       "LTEST_SENS_ROT",
            "LTEST_SENS_POS_X", "LTEST_SENS_POS_Y", "LTEST_SENS_POS_Z", "VTE_EN",
            "VTE_AID_MASK",     "VTE_EVP_NOISE",    "VTE_EVA_NOISE",    "VTE_EV_NOISE_MD"};
  }
  return {};
}

double parameter_value(const ParamValue& message, uint8_t autopilot) {
  const float value = message.param_value;
  if (autopilot != mav_autopilot::kPx4) return value;
  switch (message.param_type) {
    case mav_param_type::kUint8:
      return as_integer<uint8_t>(value);
    case mav_param_type::kInt8:
      return as_integer<int8_t>(value);
    case mav_param_type::kUint16:
      return as_integer<uint16_t>(value);
    case mav_param_type::kInt16:
      return as_integer<int16_t>(value);
    case mav_param_type::kUint32:
      return as_integer<uint32_t>(value);
    case mav_param_type::kInt32:
      return as_integer<int32_t>(value);
    default:
      return value;
  }
}

void ParameterReader::read(const std::vector<std::string>& names) {
  const std::set<std::string> in_vain = absent();
  wanted_.clear();
  for (const std::string& name : names) wanted_[name].in_vain = in_vain.count(name) > 0;
  std::erase_if(values_, [&](const auto& entry) { return !wanted_.count(entry.first); });
}

std::optional<std::string> ParameterReader::ask(int64_t now_ns) {
  const auto under_way = [&](const Wanted& wanted) {
    return !wanted.known && wanted.tries > 0 && now_ns - wanted.asked_ns < kAnswerWithin;
  };
  int count = 0;
  for (const auto& [name, wanted] : wanted_) count += under_way(wanted);
  if (count >= kMaxUnderWay) return std::nullopt;
  // All once before any again: those that an autopilot does not have keep no other waiting.
  auto next = wanted_.end();
  for (auto entry = wanted_.begin(); entry != wanted_.end(); ++entry) {
    const Wanted& wanted = entry->second;
    if (wanted.known || under_way(wanted) || wanted.tries >= kMaxTries) continue;
    if (next == wanted_.end() || wanted.tries < next->second.tries) next = entry;
  }
  if (next == wanted_.end()) return std::nullopt;
  ++next->second.tries;
  next->second.asked_ns = now_ns;
  return next->first;
}

void ParameterReader::receive(const ParamValue& message, uint8_t autopilot) {
  const std::string name = text_of(message.param_id);
  const auto wanted = wanted_.find(name);
  const double value = parameter_value(message, autopilot);
  if (wanted == wanted_.end() || !std::isfinite(value)) return;
  wanted->second.known = true;
  values_[name] = value;
}

bool ParameterReader::complete() const {
  return std::all_of(wanted_.begin(), wanted_.end(),
                     [](const auto& entry) { return entry.second.known || entry.second.tries >= kMaxTries; });
}

std::set<std::string> ParameterReader::absent() const {
  std::set<std::string> names;
  for (const auto& [name, wanted] : wanted_) {
    if (!wanted.known && (wanted.in_vain || wanted.tries >= kMaxTries)) names.insert(name);
  }
  return names;
}

}  // namespace perch::mavlink
