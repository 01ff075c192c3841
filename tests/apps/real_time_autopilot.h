#pragma once

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>
#include <limits>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "links/mavlink/fake_autopilot.h"
#include "perch/links/byte_stream.h"

namespace perch::mavlink {

// The autopilot's end of a link of this machine. Nothing waits.
class Wire {
 public:
  virtual ~Wire() = default;
  virtual std::string url() const = 0;
  virtual int descriptor() const = 0;  // readable: something may have come
  virtual size_t read(std::span<uint8_t> buffer) = 0;
  // When that had come, on CLOCK_MONOTONIC: where the kernel says so, a test that sleeps does not make it
  // late.
  virtual int64_t arrived_ns() const { return monotonic_ns(); }
  virtual void write(std::span<const uint8_t> bytes) = 0;
  virtual bool datagrams() const { return false; }
};

// A socket at a free port of the loopback interface.
class LoopbackSocket {
 public:
  explicit LoopbackSocket(int type) : fd(socket(AF_INET, type, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    socklen_t size = sizeof(address);
    getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
    place = "127.0.0.1:" + std::to_string(ntohs(address.sin_port));
  }
  ~LoopbackSocket() { close(fd); }
  LoopbackSocket(const LoopbackSocket&) = delete;
  LoopbackSocket& operator=(const LoopbackSocket&) = delete;

  int fd;
  std::string place;
};

class UdpWire : public Wire {
 public:
  UdpWire() {
    const int yes = 1;
    EXPECT_EQ(setsockopt(socket_.fd, SOL_SOCKET, SO_TIMESTAMPNS, &yes, sizeof(yes)), 0);
  }
  std::string url() const override { return "mavlink+udp://" + socket_.place; }
  int descriptor() const override { return socket_.fd; }
  size_t read(std::span<uint8_t> buffer) override {
    sockaddr_in from{};
    iovec place{buffer.data(), buffer.size()};
    alignas(cmsghdr) std::array<char, 128> control{};
    msghdr message{};
    message.msg_name = &from;
    message.msg_namelen = sizeof(from);
    message.msg_iov = &place;
    message.msg_iovlen = 1;
    message.msg_control = control.data();
    message.msg_controllen = control.size();
    const ssize_t got = recvmsg(socket_.fd, &message, MSG_DONTWAIT);
    if (got <= 0) return 0;
    peer_ = from;
    arrived_ns_ = monotonic_ns();
    for (cmsghdr* c = CMSG_FIRSTHDR(&message); c; c = CMSG_NXTHDR(&message, c)) {
      if (c->cmsg_level == SOL_SOCKET && c->cmsg_type == SCM_TIMESTAMPNS) arrived_ns_ -= age_ns(CMSG_DATA(c));
    }
    return static_cast<size_t>(got);
  }
  int64_t arrived_ns() const override { return arrived_ns_; }
  void write(std::span<const uint8_t> bytes) override {
    if (peer_.sin_port == 0) return;
    (void)sendto(socket_.fd, bytes.data(), bytes.size(), MSG_DONTWAIT,
                 reinterpret_cast<const sockaddr*>(&peer_), sizeof(peer_));
  }
  bool datagrams() const override { return true; }

 private:
  // How long ago a stamp of the kernel's is, which is one of CLOCK_REALTIME.
  static int64_t age_ns(const uint8_t* stamp) {
    timespec then{}, now{};
    std::memcpy(&then, stamp, sizeof(then));
    clock_gettime(CLOCK_REALTIME, &now);
    return (now.tv_sec - then.tv_sec) * kSecond + now.tv_nsec - then.tv_nsec;
  }
  LoopbackSocket socket_{SOCK_DGRAM};
  sockaddr_in peer_{};  // whoever spoke to us last
  int64_t arrived_ns_ = 0;
};

// One client, as SITL serves them.
class TcpWire : public Wire {
 public:
  TcpWire() { EXPECT_EQ(listen(socket_.fd, 1), 0); }
  ~TcpWire() override {
    if (client_ >= 0) close(client_);
  }
  std::string url() const override { return "mavlink+tcp://" + socket_.place; }
  int descriptor() const override { return client_ < 0 ? socket_.fd : client_; }
  size_t read(std::span<uint8_t> buffer) override {
    if (client_ < 0) {
      client_ = accept4(socket_.fd, nullptr, nullptr, SOCK_NONBLOCK);
      const int yes = 1;
      setsockopt(client_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof(yes));
      return 0;
    }
    const ssize_t got = recv(client_, buffer.data(), buffer.size(), 0);
    if (got == 0) hang_up();
    return got > 0 ? static_cast<size_t>(got) : 0;
  }
  void write(std::span<const uint8_t> bytes) override {
    if (client_ >= 0) (void)send(client_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
  }

 private:
  void hang_up() {
    close(client_);
    client_ = -1;
  }
  LoopbackSocket socket_{SOCK_STREAM};
  int client_ = -1;
};

// A serial line: the other end of a pseudo-terminal. Reading gets what is there, cut anywhere.
class PtyWire : public Wire {
 public:
  PtyWire() : fd_(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    EXPECT_EQ(grantpt(fd_), 0);
    EXPECT_EQ(unlockpt(fd_), 0);
    std::array<char, 64> name{};
    EXPECT_EQ(ptsname_r(fd_, name.data(), name.size()), 0);
    device_ = name.data();
    line_ = open(device_.c_str(), O_RDWR | O_NOCTTY);  // held open, or reading fails until somebody comes
    termios raw{};
    tcgetattr(line_, &raw);
    cfmakeraw(&raw);
    tcsetattr(line_, TCSANOW, &raw);
  }
  ~PtyWire() override {
    close(line_);
    close(fd_);
  }
  std::string url() const override { return "mavlink+serial://" + device_ + "?baud=921600"; }
  int descriptor() const override { return fd_; }
  size_t read(std::span<uint8_t> buffer) override {
    const ssize_t got = ::read(fd_, buffer.data(), buffer.size());
    heard_ = heard_ || got > 0;
    return got > 0 ? static_cast<size_t>(got) : 0;
  }
  // A line keeps nothing for somebody who comes later, as a pseudo-terminal would.
  void write(std::span<const uint8_t> bytes) override {
    if (heard_) (void)!::write(fd_, bytes.data(), bytes.size());
  }

 private:
  int fd_, line_ = -1;
  bool heard_ = false;
  std::string device_;
};

// The fake autopilot in real time, at the other end of a wire: a thread of its own, a millisecond a step.
class RealTimeAutopilot {
 public:
  template <class Message>
  struct Arrival {
    int64_t arrived_ns = 0;  // CLOCK_MONOTONIC
    Message target;
  };

  explicit RealTimeAutopilot(std::unique_ptr<Wire> wire = std::make_unique<UdpWire>(),
                             std::unique_ptr<Signing> signing = nullptr)
      : wire_(std::move(wire)), signing_(std::move(signing)), autopilot_(0, signing_.get()) {
    autopilot_.booted_ns = monotonic_ns() - 500 * kSecond;
    autopilot_.datagrams = wire_->datagrams();
    thread_ = std::thread([this] { run(); });
  }
  ~RealTimeAutopilot() {
    stop_ = true;
    thread_.join();
  }

  std::string url() const { return wire_->url(); }

  // Looks at the autopilot, or changes it, between two steps.
  template <class Work>
  auto with(const Work& work) {
    const std::lock_guard lock(mutex_);
    return work(autopilot_);
  }
  // Those of which it is known to so much when they came: where the kernel does not say so, they may have
  // come since this thread last looked.
  std::vector<Arrival<LandingTarget>> landing_targets(
      int64_t known_to_ns = std::numeric_limits<int64_t>::max()) const {
    const std::lock_guard lock(mutex_);
    std::vector<Arrival<LandingTarget>> known;
    for (const auto& [arrival, not_before_ns] : landing_targets_) {
      if (arrival.arrived_ns - not_before_ns <= known_to_ns) known.push_back(arrival);
    }
    return known;
  }
  std::vector<Arrival<TargetRelative>> relative_targets() const {
    const std::lock_guard lock(mutex_);
    return relative_targets_;
  }
  size_t unsigned_frames() const {
    const std::lock_guard lock(mutex_);
    return unsigned_;
  }
  // Any bytes, as they are.
  void send_raw(const std::vector<uint8_t>& bytes) {
    const std::lock_guard lock(mutex_);
    wire_->write(bytes);
  }
  // Of every so many frames the second half is lost, as a serial port that overruns does; 0: none.
  void cut_every(int frames) {
    const std::lock_guard lock(mutex_);
    cut_every_ = frames;
  }

 private:
  void run() {
    std::vector<uint8_t> buffer(2048);
    int64_t before_ns = monotonic_ns();  // the look before this one, after which nothing was left
    while (!stop_) {
      const int64_t now_ns = monotonic_ns();
      pollfd waiting{wire_->descriptor(), POLLIN, 0};
      const bool readable = poll(&waiting, 1, 1) > 0;
      const std::lock_guard lock(mutex_);
      if (readable) {
        const auto bytes = std::span(buffer).first(wire_->read(buffer));
        autopilot_.receive(bytes, monotonic_ns());
        note_targets(bytes, before_ns);
      }
      before_ns = now_ns;
      autopilot_.step(monotonic_ns(), [&](const std::vector<uint8_t>& bytes, int64_t) {
        const bool cut = cut_every_ > 0 && ++frames_ % cut_every_ == 0;
        wire_->write(std::span(bytes).first(cut ? bytes.size() / 2 : bytes.size()));
      });
    }
  }

  // With the time at which they really came: the fake autopilot hears everything later.
  void note_targets(std::span<const uint8_t> bytes, int64_t before_ns) {
    const int64_t now_ns = wire_->arrived_ns(), not_before_ns = wire_->datagrams() ? now_ns : before_ns;
    const auto note = [&](const Frame& frame) {
      if (const auto m = decode<LandingTarget>(frame))
        landing_targets_.push_back({{now_ns, *m}, not_before_ns});
      if (const auto m = decode<TargetRelative>(frame)) relative_targets_.push_back({now_ns, *m});
      unsigned_ += !frame.is_signed;
    };
    wire_->datagrams() ? parser_.parse_datagram(bytes, note) : parser_.parse(bytes, note);
  }

  std::unique_ptr<Wire> wire_;
  std::unique_ptr<Signing> signing_;
  mutable std::mutex mutex_;  // of what follows, and of the wire's reading and writing
  FakeAutopilot autopilot_;
  FrameParser parser_;
  std::vector<std::pair<Arrival<LandingTarget>, int64_t>> landing_targets_;  // with when it was not there yet
  std::vector<Arrival<TargetRelative>> relative_targets_;
  size_t unsigned_ = 0;
  int cut_every_ = 0;
  uint64_t frames_ = 0;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace perch::mavlink
