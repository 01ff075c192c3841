#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "perch/frames/frame_chain.h"
#include "perch/links/byte_stream.h"

namespace perch {

// Where a simulated head truly is (perch-visca-sim --truth): datagrams "TIME_NS PAN TILT ZOOM", rad, on
// CLOCK_MONOTONIC of the same machine. What is no such line is left out.
class HeadFeed {
 public:
  explicit HeadFeed(const std::string& url) : stream_(parse_stream_url(url)) {}

  struct Told {
    int64_t time_ns;
    HeadAngles angles;
    double zoom;  // 0 widest, 1 narrowest
  };
  // At a time up to half a second back, after taking in what has come; empty when nothing was told within 20
  // ms.
  std::optional<Told> at(int64_t time_ns);

 private:
  void take_in();
  void take(const Chunk& chunk);

  ByteStream stream_;
  std::deque<Told> told_;
};

}  // namespace perch
