#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace perch {

// Cuts one direction of a MAVLink link into the records of a .tlog, which QGroundControl, MAVProxy and
// pymavlink open: 8 bytes, big-endian, microseconds since 1970, and one frame. Frames are known by their
// first byte and length alone; no byte is left out: what is no frame becomes a record of its own before the
// next one, at the latest after 280 bytes, the length of the longest frame.
class TlogFramer {
 public:
  // Bytes as they came, and the time that is to stand before the frames that end in them.
  void add(int64_t unix_us, std::span<const uint8_t> bytes, std::string& tlog);
  // The rest, as it is: the link has ended, or bytes after it are missing.
  void flush(std::string& tlog);

 private:
  void add(uint8_t byte, std::string& tlog);
  size_t frame_length() const;

  std::string partial_;  // begins with a frame's first byte, or has none
  int64_t time_us_ = 0;  // of its last byte
};

}  // namespace perch
