#pragma once

#include <cstdint>
#include <string>

#include "perch/config/section.h"

namespace perch {

struct StationOptions {
  bool on = false;                    // the configuration has outputs.station
  std::string address = "127.0.0.1";  // an IP address of this machine; "0.0.0.0" or "::" for all
  uint16_t port = 8080;               // 0: any that is free
  std::string token;                  // what whoever looks has to know; empty: nothing
  bool control = false;               // may start and stop the recording, mark events, centre the head
  double bandwidth = 200;             // kbit/s to each client

  // Connections of all kinds, and those that watch. What is more is closed at once.
  size_t most_connections = 64;
  size_t most_watching = 8;
  // A request that is not whole by then is none: whoever sends a byte now and then is not waited for.
  double request_timeout = 10;  // s
  // A client that has acknowledged nothing for so long is hung up on; its page comes again by itself.
  double stall_timeout = 30;  // s
  int send_buffer = 32768;    // bytes that the kernel holds for a client; more would be old when they arrive
};

// outputs.station: {listen: 127.0.0.1:8080, token: FILE, control: false, bandwidth: 200}. Throws ConfigError,
// also when the address can be reached from outside and there is no token.
StationOptions read_station_options(Section& outputs);

}  // namespace perch
