#include "perch/station/client_feed.h"

#include <algorithm>

namespace perch {
namespace {

// Rows of half a second at 30 Hz.
constexpr double kReserve = 15.0 * kStateRowBytes;
// 0.2 s at 64 kbit/s, for which live rows wait.
constexpr size_t kGapRowsInMessage = 10;
// That come at 30 Hz while a message is put together, and some.
constexpr size_t kRowsOfATurn = 6;
constexpr int64_t kPictureInGap = 2'000'000'000;
// What a packet holds; and no more than 20 parts a second, which are all acknowledged.
constexpr double kLeastPart = 1200, kMostPart = 16000, kPartsPerSecond = 20;

}  // namespace

ClientFeed::ClientFeed(double bandwidth_kbit, int64_t now_ns)
    : bytes_per_second_(bandwidth_kbit * 125),
      tokens_(bytes_per_second_),
      part_bytes_(
          static_cast<size_t>(std::clamp(bytes_per_second_ / kPartsPerSecond, kLeastPart, kMostPart))),
      refilled_ns_(now_ns),
      progress_ns_(now_ns) {}

void ClientFeed::refill(int64_t now_ns) {
  tokens_ += bytes_per_second_ * 1e-9 * static_cast<double>(now_ns - refilled_ns_);
  // At least what one picture takes, or a small budget would never allow any.
  tokens_ = std::min(tokens_, std::max(bytes_per_second_, picture_bytes_ + 2 * kReserve));
  refilled_ns_ = now_ns;
}

void ClientFeed::ask_from(uint32_t sequence, const StateRing& ring) {
  asked_ = true;
  live_from_ = ring.next();
  gap_end_ = ring.next();
  gap_first_ = std::clamp(sequence, ring.first(), ring.next());
  gap_stride_ = std::max(1u, (gap_end_ - gap_first_ + kMostGapRows - 1) / kMostGapRows);
}

std::vector<uint32_t> ClientFeed::live_rows(const StateRing& ring, size_t room) {
  const uint32_t from = std::max(live_from_, ring.first()), count = ring.next() - from;
  if (count == 0 || room == 0) return {};
  const uint32_t wanted = std::min(count, static_cast<uint32_t>(room));
  std::vector<uint32_t> rows;
  // The last of each of `wanted` equal parts.
  for (uint32_t i = 1; i <= wanted; ++i)
    rows.push_back(from + static_cast<uint32_t>(uint64_t{i} * count / wanted) - 1);
  live_from_ = ring.next();
  return rows;
}

std::vector<uint32_t> ClientFeed::gap_rows(const StateRing& ring, size_t room) {
  gap_first_ = std::max(gap_first_, ring.first());
  std::vector<uint32_t> rows;
  while (rows.size() < room && gap_end_ > gap_first_) {
    rows.push_back(gap_end_ - 1);
    gap_end_ = gap_end_ - gap_first_ > gap_stride_ ? gap_end_ - gap_stride_ : gap_first_;
  }
  std::reverse(rows.begin(), rows.end());
  return rows;
}

std::vector<uint32_t> ClientFeed::next_rows(const StateRing& ring, int64_t now_ns) {
  refill(now_ns);
  if (!asked_ || in_flight_ > kMostInFlight || now_ns - rows_ns_ < kRowsEvery) return {};
  const auto room = [this](double reserve) {
    return static_cast<size_t>(std::max(0.0, tokens_ - reserve - double{kOverhead}) / double{kStateRowBytes});
  };
  // As many as are not outdated when they are there, and those of one turn: after a stall the rest belongs to
  // the gap no more.
  const size_t most = std::max((kMostInFlight - in_flight_) / kStateRowBytes, kRowsOfATurn);
  std::vector<uint32_t> rows = live_rows(ring, std::min(room(0), most));
  if (may_send_part(now_ns)) {
    const size_t left = std::min(room(kReserve), kGapRowsInMessage);
    std::vector<uint32_t> gap = gap_rows(ring, left > rows.size() ? left - rows.size() : 0);
    gap.insert(gap.end(), rows.begin(), rows.end());
    rows = std::move(gap);
  }
  if (!rows.empty()) rows_ns_ = now_ns;
  return rows;
}

bool ClientFeed::may_begin_picture(int64_t now_ns) {
  refill(now_ns);
  if (!whole() && picture_ns_ && now_ns - *picture_ns_ < kPictureInGap) return false;
  return asked_ && may_send_part(now_ns) && tokens_ >= picture_bytes_ + kReserve;
}

bool ClientFeed::may_send_part(int64_t now_ns) const {
  return in_flight_ <= kLittleInFlight &&
         (messages_.empty() || now_ns - messages_.front().sent_ns < kShortlyInFlight);
}

void ClientFeed::began_picture(size_t bytes, int64_t now_ns) {
  picture_bytes_ = static_cast<double>(bytes);
  picture_ns_ = now_ns;
}

void ClientFeed::sent(size_t bytes, int64_t now_ns) {
  refill(now_ns);
  if (messages_.empty()) progress_ns_ = now_ns;
  messages_.push_back({bytes + kOverhead, now_ns});
  in_flight_ += bytes + kOverhead;
  tokens_ -= static_cast<double>(bytes + kOverhead);
}

bool ClientFeed::acknowledged(uint64_t message, int64_t now_ns) {
  if (message > acknowledged_ + messages_.size()) return false;
  while (acknowledged_ < message) {
    in_flight_ -= messages_.front().bytes;
    messages_.pop_front();
    ++acknowledged_;
  }
  progress_ns_ = now_ns;
  return true;
}

double ClientFeed::stalled(int64_t now_ns) const {
  return messages_.empty() ? 0 : 1e-9 * static_cast<double>(now_ns - progress_ns_);
}

}  // namespace perch
