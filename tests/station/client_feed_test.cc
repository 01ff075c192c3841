#include "perch/station/client_feed.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <set>

namespace perch {
namespace {

constexpr int64_t kMs = 1'000'000, kSecond = 1'000'000'000;
constexpr size_t kPicture = 8000;  // bytes

// A client behind a radio of so many kbit/s, watched at 30 frames a second: a message arrives when those
// before it have, and is acknowledged 100 ms later.
class Radio {
 public:
  Radio(double budget_kbit, double radio_kbit) : feed(budget_kbit, 0), bytes_per_ns_(radio_kbit * 125e-9) {
    feed.ask_from(0, ring);
  }
  void run(double seconds, bool acknowledges = true) {
    const int64_t end_ns = now_ns + static_cast<int64_t>(seconds * 1e9);
    for (; now_ns < end_ns; now_ns += kMs) {
      if (now_ns % (33 * kMs) == 0) ring.add({});
      while (acknowledges && !acks_.empty() && acks_.front() <= now_ns) {
        acks_.pop_front();
        ASSERT_TRUE(feed.acknowledged(++acknowledged_, now_ns));
      }
      if (now_ns % (50 * kMs) == 0) offer();
    }
  }
  void offer() {
    const auto rows = feed.next_rows(ring, now_ns);
    for (const uint32_t row : rows) {
      EXPECT_TRUE(got.insert(row).second) << row << " came twice";
      if (row + 1 == ring.next()) newest_ns = now_ns;
    }
    if (!rows.empty()) send(4 + rows.size() * kStateRowBytes);
    if (left_ == 0 && feed.may_begin_picture(now_ns)) {
      left_ = kPicture;
      feed.began_picture(kPicture, now_ns);
    }
    while (left_ > 0 && feed.may_send_part(now_ns)) {
      const size_t part = std::min(left_, feed.part_bytes());
      left_ -= part;
      if (left_ == 0) ++pictures;
      send(4 + part);
    }
  }

  StateRing ring;
  ClientFeed feed;
  std::set<uint32_t> got;
  int pictures = 0;
  size_t bytes = 0;
  int64_t now_ns = 0, newest_ns = 0, worst_delay_ns = 0;

 private:
  void send(size_t size) {
    feed.sent(size, now_ns);
    bytes += size + ClientFeed::kOverhead;
    const auto takes =
        static_cast<int64_t>(static_cast<double>(size + ClientFeed::kOverhead) / bytes_per_ns_);
    free_ns_ = std::max(free_ns_, now_ns) + takes;
    worst_delay_ns = std::max(worst_delay_ns, free_ns_ - now_ns);
    acks_.push_back(free_ns_ + 100 * kMs);
  }
  double bytes_per_ns_;
  int64_t free_ns_ = 0;
  std::deque<int64_t> acks_;
  uint64_t acknowledged_ = 0;
  size_t left_ = 0;  // of a picture
};

TEST(ClientFeed, KeepsItsBudgetAndSendsEveryRow) {
  Radio radio(200, 10000);
  radio.run(20);
  // A second's worth may come at once at the beginning.
  EXPECT_LE(static_cast<double>(radio.bytes), 21 * 25000);
  EXPECT_GE(radio.got.size() + 5, radio.ring.next() - 1u);
  EXPECT_GT(radio.pictures, 20);
}

TEST(ClientFeed, ThinsPicturesFirstAndStatesLast) {
  Radio poor(64, 10000), tiny(24, 10000);
  poor.run(30);
  tiny.run(30);
  EXPECT_GE(poor.got.size() + 5, poor.ring.next() - 1u);  // all states
  EXPECT_GT(poor.pictures, 2);
  EXPECT_LT(poor.pictures, 20);
  EXPECT_LE(static_cast<double>(tiny.bytes), 31 * 3000);
  EXPECT_GT(tiny.got.size(), tiny.ring.next() / 4);  // of thinned states still some
  EXPECT_LT(tiny.got.size(), tiny.ring.next());
  EXPECT_EQ(tiny.pictures, 0);
  EXPECT_GT(tiny.newest_ns, tiny.now_ns - 2 * kSecond);
}

TEST(ClientFeed, NeverFillsASlowerRadioThanItsBudget) {
  Radio radio(200, 64);
  radio.run(30);
  // The most that is under way while states are sent, and a message on top: 5.3 kB of this radio's 8 kB/s.
  EXPECT_LE(radio.worst_delay_ns, static_cast<int64_t>(0.7 * kSecond));
  EXPECT_GT(radio.pictures, 3);
  EXPECT_GT(radio.got.size() + 15, radio.ring.next());
}

// A radio that does not even carry the states: they are thinned, the newest always among them.
TEST(ClientFeed, ThinsStatesForARadioThatDoesNotCarryThem) {
  Radio radio(200, 32);
  radio.run(30);
  // The most that is under way, and a part or some rows of a gap on top: 5.3 kB of this radio's 4 kB/s.
  EXPECT_LE(radio.worst_delay_ns, static_cast<int64_t>(1.4 * kSecond));
  EXPECT_GT(radio.got.size(), radio.ring.next() / 2);
  EXPECT_LT(radio.got.size(), radio.ring.next());
  EXPECT_GT(radio.newest_ns, radio.now_ns - static_cast<int64_t>(1.5 * kSecond));  // and 0.1 s for the answer
}

TEST(ClientFeed, SendsNothingMoreToAClientThatStalls) {
  Radio radio(200, 1000);
  radio.run(2);
  const size_t before = radio.bytes;
  radio.run(30, false);
  EXPECT_LE(radio.bytes - before, ClientFeed::kMostInFlight + kPicture + 30 * kStateRowBytes);
  EXPECT_GT(radio.feed.stalled(radio.now_ns), 28);
}

TEST(ClientFeed, FillsTheGapOfAClientThatComesBack) {
  Radio radio(200, 10000);
  radio.run(1);
  StateRing& ring = radio.ring;
  const uint32_t has = ring.next();
  for (int i = 0; i < 300; ++i) ring.add({});  // 10 s away
  radio.feed.ask_from(has, ring);
  EXPECT_FALSE(radio.feed.whole());
  radio.run(6);
  EXPECT_TRUE(radio.feed.whole());
  for (uint32_t row = has; row + 10 < ring.next(); ++row) EXPECT_TRUE(radio.got.count(row)) << row;
}

TEST(ClientFeed, ThinsALongGapEvenly) {
  StateRing ring;
  for (int i = 0; i < 20000; ++i) ring.add({});
  EXPECT_EQ(ring.next() - ring.first(), 9000u);
  ClientFeed feed(100000, 0);
  feed.ask_from(0, ring);
  std::set<uint32_t> got;
  uint64_t messages = 0;
  for (int64_t now = 0; now < 60 * kSecond; now += 100 * kMs) {
    const auto rows = feed.next_rows(ring, now);
    EXPECT_TRUE(std::is_sorted(rows.begin(), rows.end()));
    got.insert(rows.begin(), rows.end());
    if (rows.empty()) continue;
    feed.sent(rows.size() * kStateRowBytes, now);
    feed.acknowledged(++messages, now);
  }
  EXPECT_EQ(got.size(), ClientFeed::kMostGapRows);
  EXPECT_TRUE(got.count(ring.next() - 1));
  EXPECT_LE(*got.begin(), ring.first() + 10);
}

TEST(ClientFeed, KnowsAnAcknowledgementOfWhatWasNeverSent) {
  ClientFeed feed(200, 0);
  feed.sent(100, 0);
  EXPECT_FALSE(feed.acknowledged(2, 0));
  EXPECT_TRUE(feed.acknowledged(1, 0));
  EXPECT_TRUE(feed.acknowledged(1, 0));  // again: nothing new
  EXPECT_EQ(feed.in_flight(), 0u);
}

}  // namespace
}  // namespace perch
