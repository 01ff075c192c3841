#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "perch/links/mavlink/messages_system.h"

namespace perch::mavlink {

// What landing on vision depends on, by MAV_AUTOPILOT; nothing for an autopilot we do not know.
std::vector<std::string> landing_parameters(uint8_t autopilot);

// PX4 puts the bytes of an integer where the float is, ArduPilot its value.
double parameter_value(const ParamValue& message, uint8_t autopilot);

// Asks for parameters by name, again until each has come or has to be taken for absent.
class ParameterReader {
 public:
  // Starts anew. What is known of these names, a value or that there is none, stays so until it is read
  // again: after a cut of the link it is better than nothing.
  void read(const std::vector<std::string>& names);

  // The name to ask for now, if any.
  std::optional<std::string> ask(int64_t now_ns);
  // Any parameter that comes is kept, asked for or not, when it is one of ours.
  void receive(const ParamValue& message, uint8_t autopilot);

  bool complete() const;
  const std::map<std::string, double>& values() const { return values_; }
  // Asked for in vain: this autopilot has none of the name.
  std::set<std::string> absent() const;

 private:
  struct Wanted {
    int tries = 0;
    int64_t asked_ns = 0;
    bool known = false;
    bool in_vain = false;  // before the last read()
  };
  std::map<std::string, Wanted> wanted_;
  std::map<std::string, double> values_;
};

}  // namespace perch::mavlink
