#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace perch {

// A TCP client that sends any bytes, well-formed or not.
class RawClient {
 public:
  // How long what comes at once is waited for, on a machine that others load.
  static constexpr double kPatience = 20;  // s

  explicit RawClient(uint16_t port, int receive_buffer = 0) : socket_(socket(AF_INET, SOCK_STREAM, 0)) {
    if (receive_buffer > 0)
      setsockopt(socket_, SOL_SOCKET, SO_RCVBUF, &receive_buffer, sizeof(receive_buffer));
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    connected_ = connect(socket_, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0;
  }
  RawClient(RawClient&& other) noexcept
      : socket_(std::exchange(other.socket_, -1)),
        connected_(other.connected_),
        buffer_(std::move(other.buffer_)) {}
  ~RawClient() {
    if (socket_ >= 0) close(socket_);
  }

  bool connected() const { return connected_; }
  bool send(const std::string& bytes) const {
    return ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }
  // What has come until the other side closes, or nothing came for so long.
  std::string receive(double seconds) {
    std::string all = std::exchange(buffer_, {});
    while (fill(seconds)) all += std::exchange(buffer_, {});
    return all;
  }
  // The other side has closed within the time; what it sent until then is dropped.
  bool closed_within(double seconds = kPatience) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    while (std::chrono::steady_clock::now() < end) {
      pollfd waiting{socket_, POLLIN, 0};
      if (poll(&waiting, 1, 20) <= 0) continue;
      char bytes[4096];
      if (recv(socket_, bytes, sizeof(bytes), 0) <= 0) return true;
    }
    return false;
  }
  std::string request(const std::string& text) {
    send(text);
    return receive(kPatience);
  }

  // ---- WebSocket ----

  // True: it is open.
  bool upgrade(const std::string& host, const std::string& origin, const std::string& more = {}) {
    send("GET /live HTTP/1.1\r\nHost: " + host + "\r\nOrigin: " + origin +
         "\r\nConnection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Key: "
         "dGhlIHNhbXBsZSBub25jZQ==\r\n" +
         more + "\r\n");
    while (buffer_.find("\r\n\r\n") == std::string::npos && fill(kPatience)) {
    }
    head_ = buffer_.substr(0, buffer_.find("\r\n\r\n"));
    buffer_.erase(0, head_.size() + 4);
    return head_.starts_with("HTTP/1.1 101 ");
  }
  const std::string& head() const { return head_; }
  // A frame with a mask of zeros, as clients have to mask.
  static std::string frame(uint8_t first, const std::string& payload) {
    std::string bytes{static_cast<char>(first)};
    if (payload.size() < 126) {
      bytes += static_cast<char>(128 | payload.size());
    } else {
      bytes += static_cast<char>(128 | 126);
      bytes += static_cast<char>(payload.size() >> 8);
      bytes += static_cast<char>(payload.size() & 255);
    }
    return bytes + std::string(4, '\0') + payload;
  }
  bool say(const std::string& text) const { return send(frame(0x81, text)); }
  struct Message {
    int opcode = -1;  // 1 text, 2 binary, 8 close; -1: none came
    std::string payload;
  };
  Message next(double seconds = kPatience) {
    while (buffer_.size() < 2 && fill(seconds)) {
    }
    if (buffer_.size() < 2) return {};
    size_t length = static_cast<uint8_t>(buffer_[1]) & 127, head = 2;
    if (length == 126) head = 4;
    if (length == 127) head = 10;
    while (buffer_.size() < head && fill(seconds)) {
    }
    if (head > 2) {
      length = 0;
      for (size_t i = 2; i < head; ++i) length = length << 8 | static_cast<uint8_t>(buffer_[i]);
    }
    while (buffer_.size() < head + length && fill(seconds)) {
    }
    if (buffer_.size() < head + length) return {};
    Message message{buffer_[0] & 15, buffer_.substr(head, length)};
    buffer_.erase(0, head + length);
    return message;
  }

 private:
  bool fill(double seconds) {
    pollfd waiting{socket_, POLLIN, 0};
    if (poll(&waiting, 1, static_cast<int>(1000 * seconds)) <= 0) return false;
    char bytes[65536];
    const ssize_t got = recv(socket_, bytes, sizeof(bytes), 0);
    if (got <= 0) return false;
    buffer_.append(bytes, static_cast<size_t>(got));
    return true;
  }

  int socket_;
  bool connected_ = false;
  std::string buffer_, head_;
};

}  // namespace perch
