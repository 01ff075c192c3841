#include "perch/station/station_options.h"

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <charconv>
#include <fstream>
#include <iterator>

#include "perch/config/error.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

// 16 characters at random are 80 bits, even of letters in one case.
constexpr size_t kLeastToken = 16, kMostToken = 256;

std::string read_token(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || fs::is_directory(file)) throw ConfigError(file.string() + ": cannot be read");
  std::string text(kMostToken + 3, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(stream.gcount()));
  text.erase(text.find_last_not_of(" \t\r\n") + 1);
  const bool printable = text.find_first_of(" \t\r\n") == std::string::npos &&
                         std::all_of(text.begin(), text.end(), [](char c) { return c > ' ' && c < '\x7f'; });
  // Not what was found instead: it may be the token with a slip of the pen.
  if (text.size() < kLeastToken || text.size() > kMostToken || !printable)
    throw ConfigError(file.string() + ": expected a token of 16 to 256 letters, digits and signs");
  return text;
}

// "127.0.0.1:8080", "[::1]:8080"
bool split(const std::string& listen, StationOptions& options) {
  const size_t colon = listen.rfind(':');
  if (colon == std::string::npos) return false;
  std::string host = listen.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  } else if (host.find(':') != std::string::npos) {
    return false;
  }
  boost::system::error_code error;
  boost::asio::ip::make_address(host, error);
  const char* begin = listen.data() + colon + 1;
  const char* end = listen.data() + listen.size();
  const auto [stop, problem] = std::from_chars(begin, end, options.port);
  if (error || problem != std::errc{} || stop != end) return false;
  options.address = host;
  return true;
}

}  // namespace

StationOptions read_station_options(Section& outputs) {
  StationOptions options;
  options.on = outputs.has("station");
  Section station = outputs.section("station");
  std::string listen = "127.0.0.1:8080";
  station.read("listen", listen);
  if (!split(listen, options)) station.fail("listen", "ADDRESS:PORT, such as 127.0.0.1:8080 or [::1]:8080");
  fs::path token;
  if (station.has("token")) {
    station.read("token", token);
    options.token = read_token(token);
  }
  if (options.token.empty() && !boost::asio::ip::make_address(options.address).is_loopback())
    station.fail("listen", "127.0.0.1, or a `token` beside it, as others can reach this address");
  station.read("control", options.control);
  // Below it even the states alone do not fit, thinned as they are.
  station.read("bandwidth", options.bandwidth, Range{16, 100000});
  station.done();
  return options;
}

}  // namespace perch
