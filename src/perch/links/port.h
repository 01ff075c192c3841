#pragma once

#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <functional>
#include <memory>

#include "perch/links/stream_url.h"

namespace perch {

// One kind of connection, as ByteStream drives it: open, then one read and at most one write under way, until
// an error; close; open again. A port is only used, and only calls back, within the io_context's run.
class Port {
 public:
  using Error = boost::system::error_code;
  using Done = std::function<void(const Error&)>;
  using DoneBytes = std::function<void(const Error&, size_t)>;

  virtual ~Port() = default;
  virtual void open(Done done) = 0;
  virtual void read(boost::asio::mutable_buffer buffer, DoneBytes done) = 0;
  // All of the buffer.
  virtual void write(boost::asio::const_buffer buffer, DoneBytes done) = 0;
  // Calls under way end with an error.
  virtual void close() = 0;

  // Opening means waiting for someone, for as long as it takes.
  virtual bool waits_to_be_called() const { return false; }
  // An error after which the connection is as good as before.
  virtual bool harmless(const Error&) const { return false; }
};

std::unique_ptr<Port> make_port(boost::asio::io_context& io, const StreamUrl& url);

}  // namespace perch
