#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "links/mavlink/fake_autopilot.h"
#include "perch/links/byte_stream.h"

namespace perch::mavlink {

// The fake autopilot in real time, at a UDP port of this machine: a thread of its own, a millisecond a step.
class UdpAutopilot {
 public:
  struct Arrival {
    int64_t arrived_ns = 0;  // CLOCK_MONOTONIC
    LandingTarget target;
  };

  UdpAutopilot() : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address = loopback();
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
    socklen_t size = sizeof(address);
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    autopilot_.booted_ns = monotonic_ns() - 500 * kSecond;
    thread_ = std::thread([this] { run(); });
  }
  ~UdpAutopilot() {
    stop_ = true;
    thread_.join();
    close(socket_);
  }

  std::string url() const { return "mavlink+udp://127.0.0.1:" + std::to_string(port_); }

  // Looks at the autopilot, or changes it, between two steps.
  template <class Work>
  auto with(const Work& work) {
    const std::lock_guard lock(mutex_);
    return work(autopilot_);
  }
  std::vector<Arrival> landing_targets() const {
    const std::lock_guard lock(mutex_);
    return arrivals_;
  }
  // Any bytes, as they are, to whoever spoke to us last.
  void send_raw(const std::vector<uint8_t>& bytes) const {
    const std::lock_guard lock(mutex_);
    send_to_peer(bytes);
  }

 private:
  static sockaddr_in loopback() {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    return address;
  }

  void send_to_peer(const std::vector<uint8_t>& bytes) const {
    if (peer_.sin_port == 0) return;
    (void)sendto(socket_, bytes.data(), bytes.size(), MSG_DONTWAIT, reinterpret_cast<const sockaddr*>(&peer_),
                 sizeof(peer_));
  }

  void run() {
    std::vector<uint8_t> buffer(2048);
    while (!stop_) {
      pollfd waiting{socket_, POLLIN, 0};
      const bool readable = poll(&waiting, 1, 1) > 0;
      const std::lock_guard lock(mutex_);
      if (readable) {
        sockaddr_in from{};
        socklen_t size = sizeof(from);
        const ssize_t got = recvfrom(socket_, buffer.data(), buffer.size(), MSG_DONTWAIT,
                                     reinterpret_cast<sockaddr*>(&from), &size);
        if (got > 0) {
          peer_ = from;
          const std::span bytes(buffer.data(), static_cast<size_t>(got));
          autopilot_.receive(bytes, monotonic_ns());
          note_landing_targets(bytes);
        }
      }
      autopilot_.step(monotonic_ns(),
                      [&](const std::vector<uint8_t>& bytes, int64_t) { send_to_peer(bytes); });
    }
  }

  // With the time at which they really came: the fake autopilot hears everything later.
  void note_landing_targets(std::span<const uint8_t> bytes) {
    parser_.parse_datagram(bytes, [&](const Frame& frame) {
      if (const auto target = decode<LandingTarget>(frame)) arrivals_.push_back({monotonic_ns(), *target});
    });
  }

  int socket_;
  uint16_t port_ = 0;
  mutable std::mutex mutex_;
  sockaddr_in peer_{};
  FakeAutopilot autopilot_;
  FrameParser parser_;
  std::vector<Arrival> arrivals_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

}  // namespace perch::mavlink
