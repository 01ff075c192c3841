#include "perch/links/stream_url.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "perch/config/error.h"

namespace perch {
namespace {

// What Linux's termios and Boost.Asio can set.
constexpr std::array kBauds = {1200,    2400,    4800,    9600,    19200,   38400,   57600,
                               115200,  230400,  460800,  500000,  576000,  921600,  1000000,
                               1152000, 1500000, 2000000, 2500000, 3000000, 3500000, 4000000};

// The part of the URL not read yet, which knows its place.
struct Rest {
  std::string_view whole;
  size_t at = 0;

  std::string_view text() const { return whole.substr(at); }
  bool take(std::string_view prefix) {
    if (!text().starts_with(prefix)) return false;
    at += prefix.size();
    return true;
  }
  [[noreturn]] void fail(const std::string& expected) const {
    throw ConfigError(std::string(whole) + ": character " + std::to_string(at + 1) + ": expected " +
                      expected + ", found " +
                      (text().empty() ? "nothing" : "\"" + std::string(text()) + "\""));
  }
};

std::optional<long> number_of(std::string_view text) {
  long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) return std::nullopt;
  return value;
}

int read_baud(const Rest& rest) {
  const auto baud = number_of(rest.text());
  if (!baud || std::find(kBauds.begin(), kBauds.end(), *baud) == kBauds.end())
    rest.fail("a baud rate such as 57600, 115200 or 921600");
  return static_cast<int>(*baud);
}

void read_serial(Rest& rest, bool short_form, StreamUrl& url) {
  const size_t separator = short_form ? rest.text().rfind(':') : rest.text().find('?');
  url.device = rest.text().substr(0, separator);
  if (url.device.empty() || url.device[0] != '/') rest.fail("the path of a serial port, as /dev/ttyUSB0");
  if (separator == std::string_view::npos) return;
  rest.at += separator + 1;
  if (!short_form && !rest.take("baud=")) rest.fail("baud=RATE");
  url.baud = read_baud(rest);
}

void read_address(Rest& rest, StreamUrl& url) {
  const bool listens = url.kind == StreamKind::kTcpListen || url.kind == StreamKind::kUdpListen;
  const bool brackets = rest.text().starts_with('[');
  const size_t end = brackets ? rest.text().find(']') : rest.text().find(':');
  if (end == std::string_view::npos) rest.fail(brackets ? "a closing ]" : "HOST:PORT");
  url.host = brackets ? rest.text().substr(1, end - 1) : rest.text().substr(0, end);
  if (url.host.empty() && !listens) rest.fail("a host before the port");
  rest.at += end + (brackets ? 1 : 0);
  if (!rest.take(":")) rest.fail(":PORT");
  const auto port = number_of(rest.text());
  if (!port || *port < 1 || *port > 65535) rest.fail("a port from 1 to 65535");
  url.port = static_cast<uint16_t>(*port);
}

}  // namespace

StreamUrl parse_stream_url(std::string_view text) {
  Rest rest{text};
  StreamUrl url;
  url.text = text;
  rest.take("mavlink+");
  struct Scheme {
    std::string_view name;
    StreamKind kind, short_kind;
  };
  // "udp:" with no slashes is what autopilots' people write for a port to listen at.
  constexpr Scheme kSchemes[] = {
      {"serial:", StreamKind::kSerial, StreamKind::kSerial},
      {"tcp:", StreamKind::kTcp, StreamKind::kTcp},
      {"tcp-listen:", StreamKind::kTcpListen, StreamKind::kTcpListen},
      {"udp:", StreamKind::kUdp, StreamKind::kUdpListen},
      {"udp-listen:", StreamKind::kUdpListen, StreamKind::kUdpListen},
      {"stdio:", StreamKind::kStdio, StreamKind::kStdio},
  };
  for (const Scheme& scheme : kSchemes) {
    if (!rest.take(scheme.name)) continue;
    const bool short_form = !rest.take("//");
    url.kind = short_form ? scheme.short_kind : scheme.kind;
    if (url.kind == StreamKind::kSerial) {
      read_serial(rest, short_form, url);
    } else if (url.kind == StreamKind::kStdio) {
      if (!rest.text().empty()) rest.fail("nothing after stdio:");
    } else {
      read_address(rest, url);
    }
    return url;
  }
  rest.fail("serial:, tcp:, tcp-listen:, udp:, udp-listen: or stdio:");
}

}  // namespace perch
