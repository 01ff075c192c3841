#pragma once

#include <span>
#include <string_view>

namespace perch {

// A file of the page, compiled into the program: the table below is all that can be asked for, so no path
// leads anywhere else.
struct Asset {
  std::string_view path;  // "/station.js"
  std::string_view type;  // "text/javascript"
  std::string_view gzip;  // its bytes, compressed
  std::string_view etag;  // "\"...\"", of its content
  bool open = false;      // for whoever asks: what the log-in looks like
};

std::span<const Asset> station_assets();

}  // namespace perch
