#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace perch {

enum class StreamKind { kSerial, kTcp, kTcpListen, kUdp, kUdpListen, kStdio };

// Where bytes come from and go to.
//
//   serial:///dev/ttyUSB0?baud=9600      or serial:/dev/ttyUSB0:9600; 57600 baud when none is given
//   tcp://host:port                      or tcp:host:port
//   tcp-listen://:port                   one client; a new one takes the place of the old
//   udp://host:port                      sends there, and hears the answers
//   udp-listen://:port                   or udp:0.0.0.0:port; answers to whom it heard last
//   stdio:                               standard input and output
//
// Each may be written with "mavlink+" before it. A host is a name, an IPv4 address or an IPv6 one in
// brackets.
struct StreamUrl {
  StreamKind kind = StreamKind::kStdio;
  std::string device;  // serial
  int baud = 57600;    // what telemetry ports start with
  std::string host;    // network; empty: any of this machine's addresses
  uint16_t port = 0;
  std::string text;  // as it was written, for messages

  bool datagrams() const { return kind == StreamKind::kUdp || kind == StreamKind::kUdpListen; }
};

// Throws ConfigError: "tcp://host:99999: character 12: expected a port from 1 to 65535, found "99999"".
StreamUrl parse_stream_url(std::string_view text);

}  // namespace perch
