#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>

#include "perch/links/stream_url.h"

namespace perch {

// CLOCK_MONOTONIC, ns: the clock of every time in this room.
int64_t monotonic_ns();

// Bytes that came in at once.
struct Chunk {
  std::span<const uint8_t> bytes;  // valid during the call alone
  int64_t arrival_ns = 0;          // CLOCK_MONOTONIC
  bool datagram = false;           // one whole datagram; else a piece of a stream, of any size
};

struct StreamOptions {
  // What waits to be sent. More would be old when it leaves: 4 kB are 0.7 s at 57600 baud.
  size_t max_queued_bytes = 4096;
  // Between two attempts to open, doubled each time up to the longest.
  double first_retry = 0.1;  // s
  double last_retry = 5.0;   // s
  // A connection that is not there by then is tried anew.
  double open_timeout = 5.0;  // s
};

struct StreamStatistics {
  bool open = false;
  uint64_t opened = 0;       // times
  uint64_t open_failed = 0;  // times
  uint64_t disconnected = 0;
  uint64_t bytes_in = 0;
  uint64_t chunks_in = 0;
  uint64_t bytes_out = 0;
  uint64_t writes_dropped = 0;  // by a full queue, or with nobody to send to
  std::string last_error;       // "tcp://10.0.0.1:5760: Connection refused"
};

// A stream of bytes that mends itself: opened by URL, and opened again with back-off when it breaks.
//
//   ByteStream stream(parse_stream_url("mavlink+udp:0.0.0.0:14550"));
//   while (running) stream.run(10ms, [&](const Chunk& chunk) { link.receive(chunk...); });   // one thread
//   stream.write(bytes);                                                                  // any thread
//
// No call waits for the other side. All input and output is done within run().
class ByteStream {
 public:
  using OnChunk = std::function<void(const Chunk&)>;

  explicit ByteStream(const StreamUrl& url, const StreamOptions& options = {});
  ~ByteStream();
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  // Waits until something happens, `wait` at the most, and does what there is to do.
  void run(std::chrono::nanoseconds wait, const OnChunk& on_chunk);
  // Ends a run() that waits. From any thread.
  void wake();

  // Queues bytes that belong together: they are sent whole or not at all, a datagram each. When the queue is
  // full the oldest are dropped, for the newest measurement is the one worth having. False when these were.
  // From any thread.
  bool write(std::span<const uint8_t> bytes);

  // Nothing will come any more: the end of standard input.
  bool ended() const;
  // From any thread.
  StreamStatistics statistics() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace perch
