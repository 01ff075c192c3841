#include "perch/links/stream_url.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "perch/config/error.h"

namespace perch {
namespace {

TEST(StreamUrl, ReadsEveryForm) {
  struct Case {
    const char* text;
    StreamKind kind;
    const char* place;  // device or host
    int number;         // baud or port
  };
  const Case cases[] = {
      {"serial:///dev/ttyUSB0?baud=9600", StreamKind::kSerial, "/dev/ttyUSB0", 9600},
      {"serial:///dev/ttyUSB0", StreamKind::kSerial, "/dev/ttyUSB0", 57600},
      {"serial:/dev/ttyUSB0", StreamKind::kSerial, "/dev/ttyUSB0", 57600},
      {"mavlink+serial:/dev/ttyAMA0:921600", StreamKind::kSerial, "/dev/ttyAMA0", 921600},
      {"mavlink+udp:0.0.0.0:14550", StreamKind::kUdpListen, "0.0.0.0", 14550},
      {"udp:0.0.0.0:14550", StreamKind::kUdpListen, "0.0.0.0", 14550},
      {"udp://10.1.1.2:14540", StreamKind::kUdp, "10.1.1.2", 14540},
      {"udp-listen://:1", StreamKind::kUdpListen, "", 1},
      {"tcp://localhost:5760", StreamKind::kTcp, "localhost", 5760},
      {"tcp:localhost:5760", StreamKind::kTcp, "localhost", 5760},
      {"tcp://[::1]:65535", StreamKind::kTcp, "::1", 65535},
      {"tcp-listen://:5760", StreamKind::kTcpListen, "", 5760},
      {"stdio:", StreamKind::kStdio, "", 0},
  };
  for (const Case& expected : cases) {
    SCOPED_TRACE(expected.text);
    const StreamUrl url = parse_stream_url(expected.text);
    const bool serial = expected.kind == StreamKind::kSerial;
    EXPECT_EQ(url.kind, expected.kind);
    EXPECT_EQ(serial ? url.device : url.host, expected.place);
    EXPECT_EQ(serial ? url.baud : url.port, expected.number);
    EXPECT_EQ(url.text, expected.text);
  }
}

TEST(StreamUrl, SaysWhereABadOneIsWrongAndWhatWasExpected) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "character 1: expected serial:, tcp:, tcp-listen:, udp:, udp-listen: or stdio:, found nothing"},
      {"ftp://host:1", "character 1: expected serial:"},
      {"mavlink+http:host:1", "character 9: expected serial:"},
      {"serial:ttyUSB0", "character 8: expected the path of a serial port"},
      {"serial:/dev/ttyUSB0:fast",
       "character 21: expected a baud rate such as 57600, 115200 or 921600, found \"fast\""},
      {"serial:/dev/ttyUSB0:57601", "character 21: expected a baud rate"},
      {"serial:///dev/ttyUSB0?speed=1", "character 23: expected baud=RATE"},
      {"tcp://host", "character 7: expected HOST:PORT, found \"host\""},
      {"tcp://:5760", "character 7: expected a host before the port"},
      {"tcp://host:0", "character 12: expected a port from 1 to 65535, found \"0\""},
      {"tcp://host:65536", "character 12: expected a port"},
      {"tcp://host:99999999999999999999999", "character 12: expected a port"},
      {"tcp://host:5760/x", "character 12: expected a port"},
      {"tcp://[::1:5760", "character 7: expected a closing ]"},
      {"tcp://[::1]5760", "character 12: expected :PORT"},
      {"udp-listen://:", "character 15: expected a port from 1 to 65535, found nothing"},
      {"stdio:x", "character 7: expected nothing after stdio:"},
  };
  for (const auto& [text, message] : cases) {
    try {
      parse_stream_url(text);
      ADD_FAILURE() << text << " was taken";
    } catch (const ConfigError& error) {
      EXPECT_THAT(error.what(), testing::StartsWith(std::string(text) + ": " + message));
    }
  }
}

}  // namespace
}  // namespace perch
