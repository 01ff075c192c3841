#include "perch/simulation/simulated_evi_d30.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace perch {
namespace {

constexpr double kDeg = M_PI / 180;
constexpr double kPanCount = kDeg / 8.8, kTiltCount = kDeg / 12;
constexpr double kPanLimit = 100 * kDeg, kTiltLimit = 25 * kDeg;
constexpr double kPanSpeed = 80 * kDeg / 24, kTiltSpeed = 50 * kDeg / 20;  // a step
constexpr int kPanSteps = 24, kTiltSteps = 20;
constexpr double kZoomCounts = 0x3FF;

constexpr int64_t kStepNs = 1'000'000;
constexpr size_t kHistory = 500;  // steps
constexpr size_t kLongest = 16;
constexpr uint8_t kLengthError = 1, kSyntaxError = 2, kBufferFull = 3, kCancelled = 4, kNoSocket = 5;

std::optional<int> nibbles(const std::vector<uint8_t>& bytes, size_t at) {
  int value = 0;
  for (size_t i = at; i < at + 4; ++i) {
    if (bytes[i] > 0x0F) return std::nullopt;
    value = value << 4 | bytes[i];
  }
  return value >= 0x8000 ? value - 0x10000 : value;
}

void append_nibbles(std::vector<uint8_t>& bytes, long value) {
  const auto bits = static_cast<uint16_t>(value);
  for (const int shift : {12, 8, 4, 0}) bytes.push_back(static_cast<uint8_t>((bits >> shift) & 0xF));
}

std::optional<double> sense(uint8_t byte, uint8_t negative, uint8_t positive) {
  if (byte == negative) return -1;
  if (byte == positive) return 1;
  if (byte == 3) return 0;
  return std::nullopt;
}

bool starts(const std::vector<uint8_t>& bytes, std::initializer_list<uint8_t> after_header) {
  return bytes.size() > after_header.size() &&
         std::equal(after_header.begin(), after_header.end(), bytes.begin() + 1);
}

}  // namespace

void SimulatedEviD30::receive(std::span<const uint8_t> bytes) {
  if (options_.over_ip) {
    if (bytes.size() < 8) return;
    const auto number = [&](size_t at, size_t size) {
      uint32_t value = 0;
      for (size_t i = 0; i < size; ++i) value = value << 8 | bytes[at + i];
      return value;
    };
    const uint32_t type = number(0, 2);
    if (number(2, 2) != bytes.size() - 8) return;
    if (type == 0x0200) return;  // its numbers are taken as they come
    if (type != 0x0100 && type != 0x0110) return;
    partial_sequence_ = number(4, 4);
    bytes = bytes.subspan(8);
    partial_.clear();
  }
  for (const uint8_t byte : bytes) {
    partial_.push_back(byte);
    if (byte != 0xFF) continue;
    if (partial_.size() >= 3) {
      ++counters_.packets;
      inbox_.push_back({partial_, partial_sequence_});
    }
    partial_.clear();
  }
}

std::vector<std::vector<uint8_t>> SimulatedEviD30::advance(int64_t time_ns) {
  if (now_ns_ < 0) now_ns_ = next_field_ns_ = time_ns;
  while (now_ns_ + kStepNs <= time_ns) step(now_ns_ + kStepNs);
  return std::exchange(outbox_, {});
}

void SimulatedEviD30::step(int64_t time_ns) {
  now_ns_ = time_ns;
  if (now_ns_ >= next_field_ns_) {
    next_field_ns_ += std::llround(options_.field * 1e9);
    if (!inbox_.empty()) {
      const Packet packet = std::move(inbox_.front());
      inbox_.pop_front();
      execute(packet);
    }
  }
  while (!orders_.empty() && orders_.front().from_ns <= now_ns_) {
    const Order order = orders_.front();
    orders_.pop_front();
    for (size_t i = 0; i < 2; ++i) {
      Axis& axis = i == 0 ? pan_ : tilt_;
      axis.drive = order.drive[i];
      axis.most = order.most[i];
      axis.goal = order.goal[i];
      if (axis.goal && order.relative) *axis.goal += axis.angle;
    }
  }
  const double dt = static_cast<double>(kStepNs) * 1e-9;
  pan_.step(dt, options_.acceleration, kPanLimit);
  tilt_.step(dt, options_.acceleration, kTiltLimit);
  zoom_ += std::clamp(zoom_goal_ - zoom_, -options_.zoom_speed * dt, options_.zoom_speed * dt);
  history_.push_back({now_ns_, pan_.angle, tilt_.angle, zoom_});
  if (history_.size() > kHistory) history_.pop_front();
  const bool arrived = orders_.empty() && !pan_.goal && !tilt_.goal;
  for (uint8_t i = 1; i < sockets_.size(); ++i) {
    if (!sockets_[i].busy) continue;
    if (sockets_[i].moves ? arrived : zoom_ == zoom_goal_) complete(i);
  }
}

void SimulatedEviD30::Axis::step(double dt, double acceleration, double limit) {
  double wanted = drive;
  if (goal) {
    const double left = std::clamp(*goal, -limit, limit) - angle;
    // Brakes in time.
    wanted = std::copysign(std::min(most, std::sqrt(2 * acceleration * std::abs(left))), left);
    if (std::abs(left) < 1e-4) {
      goal.reset();
      drive = wanted = speed = 0;
    }
  }
  speed += std::clamp(wanted - speed, -acceleration * dt, acceleration * dt);
  angle += speed * dt;
  if (std::abs(angle) > limit) {
    angle = std::copysign(limit, angle);
    speed = 0;
  }
}

SimulatedEviD30::Head SimulatedEviD30::at(int64_t time_ns) const {
  if (history_.empty()) return {time_ns, pan_.angle, tilt_.angle, zoom_};
  const auto after = std::lower_bound(history_.begin(), history_.end(), time_ns,
                                      [](const Head& h, int64_t t) { return h.time_ns < t; });
  if (after == history_.begin()) return history_.front();
  if (after == history_.end()) return history_.back();
  const Head& a = *std::prev(after);
  const Head& b = *after;
  const double s = static_cast<double>(time_ns - a.time_ns) / static_cast<double>(b.time_ns - a.time_ns);
  return {time_ns, a.pan + s * (b.pan - a.pan), a.tilt + s * (b.tilt - a.tilt),
          a.zoom + s * (b.zoom - a.zoom)};
}

void SimulatedEviD30::restart() {
  partial_.clear();
  inbox_.clear();
  orders_.clear();
  sockets_ = {};
  pan_.goal.reset();
  tilt_.goal.reset();
  pan_.drive = tilt_.drive = 0;
  send({header(), 0x38, 0xFF}, 0);
}

void SimulatedEviD30::knock(double pan, double tilt) {
  pan_.angle = std::clamp(pan_.angle + pan, -kPanLimit, kPanLimit);
  tilt_.angle = std::clamp(tilt_.angle + tilt, -kTiltLimit, kTiltLimit);
}

void SimulatedEviD30::zoom_by_hand(double zoom) { zoom_ = zoom_goal_ = zoom; }

void SimulatedEviD30::send(std::vector<uint8_t> bytes, uint32_t sequence) {
  if (options_.over_ip) {
    std::vector<uint8_t> datagram{0x01, 0x11, 0x00, static_cast<uint8_t>(bytes.size())};
    for (const int shift : {24, 16, 8, 0}) datagram.push_back(static_cast<uint8_t>(sequence >> shift));
    datagram.insert(datagram.end(), bytes.begin(), bytes.end());
    bytes = std::move(datagram);
  }
  outbox_.push_back(std::move(bytes));
}

void SimulatedEviD30::error(const Packet& packet, uint8_t socket, uint8_t code) {
  ++counters_.errors;
  send({header(), static_cast<uint8_t>(0x60 | socket), code, 0xFF}, packet.sequence);
}

void SimulatedEviD30::complete(uint8_t socket) {
  send({header(), static_cast<uint8_t>(0x50 | socket), 0xFF}, sockets_[socket].sequence);
  sockets_[socket] = {};
}

void SimulatedEviD30::execute(const Packet& packet) {
  const auto& bytes = packet.bytes;
  if (bytes[0] == 0x88) return execute_broadcast(packet);
  if (bytes[0] != (0x80 | address_)) return;  // passed on down the chain, where nobody is
  if (bytes.size() > kLongest) return error(packet, 0, kLengthError);
  if (bytes.size() == 3 && (bytes[1] & 0xF0) == 0x20) {
    const uint8_t socket = bytes[1] & 0x0F;
    if (socket < 1 || socket > 2 || !sockets_[socket].busy) return error(packet, socket, kNoSocket);
    if (sockets_[socket].moves) {
      orders_.clear();
      for (Axis* axis : {&pan_, &tilt_}) {
        axis->goal.reset();
        axis->drive = 0;
      }
    } else {
      zoom_goal_ = zoom_;
    }
    sockets_[socket] = {};
    return error(packet, socket, kCancelled);
  }
  if (bytes[1] == 0x09) return inquire(packet);
  if (bytes[1] != 0x01) return error(packet, 0, kSyntaxError);
  if (starts(bytes, {0x01, 0x00, 0x01})) {  // IF_Clear
    sockets_ = {};
    return send({header(), 0x50, 0xFF}, packet.sequence);
  }
  command(packet);
}

void SimulatedEviD30::execute_broadcast(const Packet& packet) {
  const auto& bytes = packet.bytes;
  if (bytes.size() == 4 && bytes[1] == 0x30) {
    if (bytes[2] < 1 || bytes[2] > 7) return;
    address_ = bytes[2];
    send({0x88, 0x30, static_cast<uint8_t>(address_ + 1), 0xFF}, packet.sequence);
  } else if (starts(bytes, {0x01, 0x00, 0x01})) {
    sockets_ = {};
    send(bytes, packet.sequence);
  }
}

void SimulatedEviD30::inquire(const Packet& packet) {
  const auto& bytes = packet.bytes;
  ++counters_.inquiries;
  if (bytes.size() != 5) return error(packet, 0, bytes.size() < 5 ? kLengthError : kSyntaxError);
  std::vector<uint8_t> answer{header(), 0x50};
  if (starts(bytes, {0x09, 0x06, 0x12})) {
    append_nibbles(answer, std::lround(pan_.angle / kPanCount));
    append_nibbles(answer, std::lround(tilt_.angle / kTiltCount));
  } else if (starts(bytes, {0x09, 0x04, 0x47})) {
    append_nibbles(answer, std::lround(zoom_ * kZoomCounts));
  } else if (starts(bytes, {0x09, 0x06, 0x11})) {
    answer.insert(answer.end(), {kPanSteps, kTiltSteps});
  } else if (starts(bytes, {0x09, 0x00, 0x02})) {
    answer.insert(answer.end(), {0x00, 0x20, 0x04, 0x02, 0x01, 0x21, 0x02});
  } else {
    return error(packet, 0, kSyntaxError);
  }
  answer.push_back(0xFF);
  send(std::move(answer), packet.sequence);
}

void SimulatedEviD30::command(const Packet& packet) {
  const auto& bytes = packet.bytes;
  const bool moves = starts(bytes, {0x01, 0x06});
  const bool zoom = starts(bytes, {0x01, 0x04, 0x47}) && bytes.size() == 9 && nibbles(bytes, 4);
  const bool zoom_stop = starts(bytes, {0x01, 0x04, 0x07, 0x00}) && bytes.size() == 6;
  const bool power = starts(bytes, {0x01, 0x04, 0x00}) && bytes.size() == 6;
  if (!moves && !zoom && !zoom_stop && !power) return error(packet, 0, kSyntaxError);
  // A newer movement takes the older one's place: that is done.
  if (moves) {
    for (uint8_t i = 1; i < sockets_.size(); ++i) {
      if (sockets_[i].busy && sockets_[i].moves) complete(i);
    }
  }
  const uint8_t socket = !sockets_[1].busy ? 1 : !sockets_[2].busy ? 2 : 0;
  if (socket == 0) return error(packet, 0, kBufferFull);
  if (moves) return move(packet, socket);
  ++counters_.commands;
  sockets_[socket] = {true, false, packet.sequence};
  if (zoom) zoom_goal_ = std::clamp(static_cast<double>(*nibbles(bytes, 4)) / kZoomCounts, 0.0, 1.0);
  if (zoom_stop) zoom_goal_ = zoom_;
  send({header(), static_cast<uint8_t>(0x40 | socket), 0xFF}, packet.sequence);
}

void SimulatedEviD30::move(const Packet& packet, uint8_t socket) {
  const auto& bytes = packet.bytes;
  Order order;
  order.from_ns = now_ns_ + std::llround(options_.motor_delay * 1e9);
  const uint8_t what = bytes[3];
  const bool speeds =
      bytes.size() > 6 && bytes[4] >= 1 && bytes[4] <= kPanSteps && bytes[5] >= 1 && bytes[5] <= kTiltSteps;
  if (what == 0x01 && bytes.size() == 9 && speeds) {
    const auto pan = sense(bytes[6], 1, 2), tilt = sense(bytes[7], 2, 1);
    if (!pan || !tilt) return error(packet, 0, kSyntaxError);
    order.drive = {*pan * bytes[4] * kPanSpeed, *tilt * bytes[5] * kTiltSpeed};
  } else if ((what == 0x02 || what == 0x03) && bytes.size() == 15 && speeds) {
    const auto pan = nibbles(bytes, 6), tilt = nibbles(bytes, 10);
    if (!pan || !tilt) return error(packet, 0, kSyntaxError);
    order.goal = {*pan * kPanCount, *tilt * kTiltCount};
    order.most = {bytes[4] * kPanSpeed, bytes[5] * kTiltSpeed};
    order.relative = what == 0x03;
  } else if ((what == 0x04 || what == 0x05) && bytes.size() == 5) {
    order.goal = {0.0, 0.0};
    order.most = {kPanSteps * kPanSpeed, kTiltSteps * kTiltSpeed};
  } else {
    return error(packet, 0, kSyntaxError);
  }
  ++counters_.commands;
  sockets_[socket] = {true, true, packet.sequence};
  orders_.push_back(order);
  send({header(), static_cast<uint8_t>(0x40 | socket), 0xFF}, packet.sequence);
  if (what == 0x01) complete(socket);
}

}  // namespace perch
