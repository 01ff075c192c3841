#include "perch/links/port.h"

#include <linux/serial.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/serial_port.hpp>
#include <boost/asio/write.hpp>
#include <optional>

namespace perch {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;
using Error = Port::Error;

Error last_error() { return {errno, boost::system::system_category()}; }

class SerialPort : public Port {
 public:
  SerialPort(asio::io_context& io, const StreamUrl& url) : io_(io), url_(url), port_(io) {}

  void open(Done done) override {
    using Base = asio::serial_port_base;
    Error error;
    port_.open(url_.device, error);
    if (!error) port_.set_option(Base::baud_rate(static_cast<unsigned>(url_.baud)), error);
    if (!error) port_.set_option(Base::character_size(8), error);
    if (!error) port_.set_option(Base::parity(Base::parity::none), error);
    if (!error) port_.set_option(Base::stop_bits(Base::stop_bits::one), error);
    if (!error) port_.set_option(Base::flow_control(Base::flow_control::none), error);
    if (!error) hurry();
    asio::post(io_, [done = std::move(done), error] { done(error); });
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    port_.async_read_some(buffer, std::move(done));
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    asio::async_write(port_, buffer, std::move(done));
  }
  void close() override {
    Error ignored;
    port_.close(ignored);
  }

 private:
  // USB converters gather bytes for 16 ms, which would be noise on every arrival time; asked so, they pass
  // them on after 1 ms. Those that cannot say no, and work all the same.
  void hurry() {
    serial_struct serial{};
    if (ioctl(port_.native_handle(), TIOCGSERIAL, &serial) != 0) return;
    serial.flags |= ASYNC_LOW_LATENCY;
    (void)ioctl(port_.native_handle(), TIOCSSERIAL, &serial);
  }

  asio::io_context& io_;
  StreamUrl url_;
  asio::serial_port port_;
};

// Commands are small and must not wait for each other; a peer that is gone shows after some minutes.
void tune(tcp::socket& socket) {
  Error ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
}

class TcpPort : public Port {
 public:
  TcpPort(asio::io_context& io, const StreamUrl& url) : url_(url), resolver_(io), socket_(io) {}

  void open(Done done) override {
    resolver_.async_resolve(url_.host, std::to_string(url_.port),
                            [this, done = std::move(done)](const Error& error, const auto& found) {
                              if (error) return done(error);
                              asio::async_connect(socket_, found,
                                                  [this, done](const Error& failed, const auto&) {
                                                    if (!failed) tune(socket_);
                                                    done(failed);
                                                  });
                            });
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    socket_.async_read_some(buffer, std::move(done));
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    asio::async_write(socket_, buffer, std::move(done));
  }
  void close() override {
    Error ignored;
    resolver_.cancel();
    socket_.close(ignored);
  }

 private:
  StreamUrl url_;
  tcp::resolver resolver_;
  tcp::socket socket_;
};

// The address to listen at; any of this machine's when no host is given.
template <class Protocol>
typename Protocol::endpoint local_endpoint(const StreamUrl& url, Error& error) {
  if (url.host.empty()) return {Protocol::v4(), url.port};
  return {asio::ip::make_address(url.host, error), url.port};
}

// Always accepts: whoever calls anew takes the line, for the old caller may be gone without a word.
class TcpListenPort : public Port {
 public:
  TcpListenPort(asio::io_context& io, const StreamUrl& url)
      : io_(io), url_(url), acceptor_(io), socket_(io) {}

  void open(Done done) override {
    Error error;
    if (!acceptor_.is_open()) listen(error);
    if (error || next_) {
      if (next_) socket_ = std::move(*next_);
      next_.reset();
      asio::post(io_, [done = std::move(done), error] { done(error); });
      return;
    }
    opened_ = std::move(done);
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    socket_.async_read_some(buffer, std::move(done));
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    asio::async_write(socket_, buffer, std::move(done));
  }
  void close() override {
    Error ignored;
    socket_.close(ignored);
    opened_ = nullptr;
  }
  bool waits_to_be_called() const override { return true; }

 private:
  void listen(Error& error) {
    const auto endpoint = local_endpoint<tcp>(url_, error);
    if (!error) acceptor_.open(endpoint.protocol(), error);
    if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
    if (!error) acceptor_.bind(endpoint, error);
    if (!error) acceptor_.listen(1, error);
    if (!error) return accept();
    Error ignored;
    acceptor_.close(ignored);
  }

  void accept() {
    acceptor_.async_accept([this](const Error& error, tcp::socket caller) {
      if (error == asio::error::operation_aborted) return;
      if (!error) take(std::move(caller));
      accept();
    });
  }

  void take(tcp::socket caller) {
    tune(caller);
    Error ignored;
    if (opened_) {
      socket_ = std::move(caller);
      std::exchange(opened_, nullptr)(Error());
    } else {
      next_ = std::move(caller);
      socket_.close(ignored);  // the read under way fails, and open() finds the new caller
    }
  }

  asio::io_context& io_;
  StreamUrl url_;
  tcp::acceptor acceptor_;
  tcp::socket socket_;
  std::optional<tcp::socket> next_;
  Done opened_;
};

// What a datagram's way says of one datagram is no reason to open the socket anew: nobody listens yet, no
// route now.
bool of_one_datagram(const Error& error) {
  return error == asio::error::connection_refused || error == asio::error::host_unreachable ||
         error == asio::error::network_unreachable || error == asio::error::message_size ||
         error == asio::error::no_buffer_space;
}

class UdpPort : public Port {
 public:
  UdpPort(asio::io_context& io, const StreamUrl& url) : url_(url), resolver_(io), socket_(io) {}

  void open(Done done) override {
    resolver_.async_resolve(url_.host, std::to_string(url_.port),
                            [this, done = std::move(done)](const Error& error, const auto& found) {
                              if (error) return done(error);
                              Error failed;
                              socket_.open(found.begin()->endpoint().protocol(), failed);
                              if (!failed) socket_.connect(*found.begin(), failed);
                              done(failed);
                            });
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    socket_.async_receive(buffer, std::move(done));
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    socket_.async_send(buffer, std::move(done));
  }
  void close() override {
    Error ignored;
    resolver_.cancel();
    socket_.close(ignored);
  }
  bool harmless(const Error& error) const override { return of_one_datagram(error); }

 private:
  StreamUrl url_;
  udp::resolver resolver_;
  udp::socket socket_;
};

class UdpListenPort : public Port {
 public:
  UdpListenPort(asio::io_context& io, const StreamUrl& url) : io_(io), url_(url), socket_(io) {}

  void open(Done done) override {
    Error error;
    const auto endpoint = local_endpoint<udp>(url_, error);
    if (!error) socket_.open(endpoint.protocol(), error);
    if (!error) socket_.bind(endpoint, error);
    asio::post(io_, [done = std::move(done), error] { done(error); });
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    socket_.async_receive_from(buffer, sender_,
                               [this, done = std::move(done)](const Error& error, size_t size) {
                                 if (!error) answer_to_ = sender_;
                                 done(error, size);
                               });
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    if (answer_to_) return socket_.async_send_to(buffer, *answer_to_, std::move(done));
    asio::post(io_, [done = std::move(done)] { done(asio::error::not_connected, 0); });
  }
  void close() override {
    Error ignored;
    socket_.close(ignored);
  }
  bool harmless(const Error& error) const override {
    return of_one_datagram(error) || error == asio::error::not_connected;
  }

 private:
  asio::io_context& io_;
  StreamUrl url_;
  udp::socket socket_;
  udp::endpoint sender_;
  std::optional<udp::endpoint> answer_to_;
};

class StdioPort : public Port {
 public:
  explicit StdioPort(asio::io_context& io) : io_(io), in_(io), out_(io) {}

  void open(Done done) override {
    Error error;
    assign(in_, STDIN_FILENO, error);
    if (!error) assign(out_, STDOUT_FILENO, error);
    asio::post(io_, [done = std::move(done), error] { done(error); });
  }
  void read(asio::mutable_buffer buffer, DoneBytes done) override {
    in_.async_read_some(buffer, std::move(done));
  }
  void write(asio::const_buffer buffer, DoneBytes done) override {
    asio::async_write(out_, buffer, std::move(done));
  }
  void close() override {
    Error ignored;
    in_.close(ignored);
    out_.close(ignored);
  }

 private:
  // A copy, so that closing it leaves the process its own.
  static void assign(asio::posix::stream_descriptor& to, int descriptor, Error& error) {
    const int copy = dup(descriptor);
    if (copy < 0) {
      error = last_error();
      return;
    }
    to.assign(copy, error);
    if (error) ::close(copy);
  }

  asio::io_context& io_;
  asio::posix::stream_descriptor in_, out_;
};

}  // namespace

std::unique_ptr<Port> make_port(asio::io_context& io, const StreamUrl& url) {
  switch (url.kind) {
    case StreamKind::kSerial:
      return std::make_unique<SerialPort>(io, url);
    case StreamKind::kTcp:
      return std::make_unique<TcpPort>(io, url);
    case StreamKind::kTcpListen:
      return std::make_unique<TcpListenPort>(io, url);
    case StreamKind::kUdp:
      return std::make_unique<UdpPort>(io, url);
    case StreamKind::kUdpListen:
      return std::make_unique<UdpListenPort>(io, url);
    case StreamKind::kStdio:
      return std::make_unique<StdioPort>(io);
  }
  return nullptr;
}

}  // namespace perch
