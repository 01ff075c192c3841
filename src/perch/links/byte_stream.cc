#include "perch/links/byte_stream.h"

#include <algorithm>
#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <mutex>
#include <vector>

#include "perch/links/port.h"

namespace perch {

namespace asio = boost::asio;
using Error = Port::Error;

int64_t monotonic_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

// closed --open()--> opening --> open --error--> closed, waiting --timer--> opening ...
// Whoever calls back after the connection it was started on has ended is told so by the number it carries.
class ByteStream::Impl {
 public:
  Impl(const StreamUrl& url, const StreamOptions& options)
      : url_(url), options_(options), timer_(io_), port_(make_port(io_, url)), retry_(options.first_retry) {
    asio::post(io_, [this] { open(); });
  }

  void run(std::chrono::nanoseconds wait, const OnChunk& on_chunk) {
    on_chunk_ = &on_chunk;
    io_.restart();
    io_.run_one_for(wait);
    // Not without end, as poll() would under a flood: the caller has other things to do.
    for (int i = 0; i < 100 && io_.poll_one(); ++i) continue;
    on_chunk_ = nullptr;
  }

  void wake() {
    asio::post(io_, [] {});
  }

  bool write(std::span<const uint8_t> bytes) {
    {
      const std::lock_guard lock(mutex_);
      if (!statistics_.open || bytes.size() > options_.max_queued_bytes) {
        ++statistics_.writes_dropped;
        return false;
      }
      while (queued_bytes_ + bytes.size() > options_.max_queued_bytes) drop_oldest();
      queue_.emplace_back(bytes.begin(), bytes.end());
      queued_bytes_ += bytes.size();
    }
    asio::post(io_, [this] { write_next(); });
    return true;
  }

  bool ended() const {
    const std::lock_guard lock(mutex_);
    return ended_;
  }

  StreamStatistics statistics() const {
    const std::lock_guard lock(mutex_);
    return statistics_;
  }

 private:
  void open() {
    const uint64_t connection = ++connection_;
    if (!port_->waits_to_be_called()) {
      timer_.expires_after(std::chrono::duration_cast<std::chrono::steady_clock::duration>(
          std::chrono::duration<double>(options_.open_timeout)));
      timer_.async_wait([this, connection](const Error& error) {
        if (!error && connection == connection_) failed(asio::error::timed_out);
      });
    }
    port_->open([this, connection](const Error& error) {
      if (connection != connection_) return;
      timer_.cancel();
      if (error) return failed(error);
      {
        const std::lock_guard lock(mutex_);
        statistics_.open = true;
        ++statistics_.opened;
      }
      read();
    });
  }

  void read() {
    port_->read(asio::buffer(buffer_), [this, connection = connection_](const Error& error, size_t size) {
      const int64_t now = monotonic_ns();
      if (connection != connection_) return;
      if (error && !port_->harmless(error)) return failed(error);
      if (!error) deliver(now, size);
      read();
    });
  }

  void deliver(int64_t now, size_t size) {
    retry_ = options_.first_retry;  // a connection that gives bytes is a good one
    {
      const std::lock_guard lock(mutex_);
      statistics_.bytes_in += size;
      ++statistics_.chunks_in;
    }
    (*on_chunk_)({std::span(buffer_).first(size), now, url_.datagrams()});
  }

  void write_next() {
    {
      const std::lock_guard lock(mutex_);
      if (writing_ || queue_.empty() || !statistics_.open) return;
      writing_ = true;
      in_flight_ = std::move(queue_.front());
      queue_.pop_front();
      queued_bytes_ -= in_flight_.size();
    }
    port_->write(asio::buffer(in_flight_), [this, connection = connection_](const Error& error, size_t size) {
      {
        const std::lock_guard lock(mutex_);
        writing_ = false;
        statistics_.bytes_out += size;
        if (error) ++statistics_.writes_dropped;
      }
      if (connection == connection_ && error && !port_->harmless(error)) return failed(error);
      write_next();
    });
  }

  // The connection, or the attempt at one, is over.
  void failed(const Error& error) {
    ++connection_;
    timer_.cancel();
    port_->close();
    {
      const std::lock_guard lock(mutex_);
      statistics_.last_error = url_.text + ": " + error.message();
      ++(statistics_.open ? statistics_.disconnected : statistics_.open_failed);
      statistics_.open = false;
      // What waits would be old by the time the link is back.
      while (!queue_.empty()) drop_oldest();
      ended_ = url_.kind == StreamKind::kStdio;
      if (ended_) return;
    }
    timer_.expires_after(std::chrono::duration_cast<std::chrono::steady_clock::duration>(
        std::chrono::duration<double>(retry_)));
    retry_ = std::min(2 * retry_, options_.last_retry);
    timer_.async_wait([this, connection = connection_](const Error& stopped) {
      if (!stopped && connection == connection_) open();
    });
  }

  // With the mutex held.
  void drop_oldest() {
    queued_bytes_ -= queue_.front().size();
    queue_.pop_front();
    ++statistics_.writes_dropped;
  }

  StreamUrl url_;
  StreamOptions options_;
  asio::io_context io_;  // before the port and the timer, which live in it
  asio::steady_timer timer_;
  std::unique_ptr<Port> port_;
  double retry_;  // s
  uint64_t connection_ = 0;
  const OnChunk* on_chunk_ = nullptr;
  std::array<uint8_t, 65536> buffer_{};  // the largest datagram
  std::vector<uint8_t> in_flight_;

  mutable std::mutex mutex_;  // guards what follows
  std::deque<std::vector<uint8_t>> queue_;
  size_t queued_bytes_ = 0;
  bool writing_ = false;
  bool ended_ = false;
  StreamStatistics statistics_;
};

ByteStream::ByteStream(const StreamUrl& url, const StreamOptions& options)
    : impl_(std::make_unique<Impl>(url, options)) {}
ByteStream::~ByteStream() = default;

void ByteStream::run(std::chrono::nanoseconds wait, const OnChunk& on_chunk) { impl_->run(wait, on_chunk); }
void ByteStream::wake() { impl_->wake(); }
bool ByteStream::write(std::span<const uint8_t> bytes) { return impl_->write(bytes); }
bool ByteStream::ended() const { return impl_->ended(); }
StreamStatistics ByteStream::statistics() const { return impl_->statistics(); }

}  // namespace perch
