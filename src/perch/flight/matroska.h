#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace perch {

// The little of Matroska (RFC 9559) that a video needs which is whole after every append: a segment of
// unknown length with one FFV1 track, no index, and then a cluster a frame.
struct MatroskaVideo {
  int width = 0, height = 0;
  int64_t frame_ns = 0;            // as a player should assume
  std::string_view codec_private;  // FFV1's extradata
};

std::string matroska_header(const MatroskaVideo& video);
// A frame that needs no other; the time is since the start.
void append_matroska_cluster(int64_t time_ms, std::string_view frame, std::string& text);

}  // namespace perch
