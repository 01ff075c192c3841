// The station's server as browsers and attackers meet it, over sockets of this machine.

#include "perch/station/station.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <functional>

#include "station/raw_client.h"
#include "support/rng.h"
#include "support/sharp_target.h"

namespace perch {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using Json = nlohmann::json;

void sleep(double seconds) { std::this_thread::sleep_for(std::chrono::duration<double>(seconds)); }

class StationTest : public testing::Test {
 protected:
  StationTest() {
    options_.on = true;
    options_.port = 0;
    // What is to be hung up on is, long before it would be anyway.
    options_.request_timeout = options_.stall_timeout = 5 * RawClient::kPatience;
  }
  void start() {
    station_ = std::make_unique<Station>(
        options_,
        StationScene{
            sharp_target(), CameraModel::pinhole(400, 400, 319.5, 239.5, 640, 480), {}, "test", false});
    host_ = "127.0.0.1:" + std::to_string(station_->port());
    origin_ = "http://" + host_;
  }
  RawClient client() const { return RawClient(station_->port()); }
  std::string get(const std::string& path = "/", const std::string& more = "") const {
    return client().request("GET " + path + " HTTP/1.1\r\nHost: " + host_ + "\r\nConnection: close\r\n" +
                            more + "\r\n");
  }
  // The server's thread comes to it, sooner or later.
  static bool comes(const std::function<bool()>& condition) {
    for (int i = 0; i < 2000 && !condition(); ++i) sleep(0.01);
    return condition();
  }
  // The server still does what it is there for.
  void expect_well() const { EXPECT_THAT(get(), StartsWith("HTTP/1.1 200 OK")); }
  // A page that has said where it stands.
  RawClient watcher(Json* hello = nullptr) const {
    RawClient page = client();
    EXPECT_TRUE(page.upgrade(host_, origin_)) << page.head();
    const Json greeting = Json::parse(page.next().payload);
    if (hello) *hello = greeting["hello"];
    page.say(R"({"ack":1})");
    page.say(Json{{"from", {{"session", greeting["hello"]["session"]}, {"sequence", 0}}}}.dump());
    return page;
  }
  static StateRow row_at(int64_t timestamp_ns) {
    StateRow row;
    row.timestamp_ns = timestamp_ns;
    row.values.fill(static_cast<float>(timestamp_ns));
    return row;
  }
  // The times of the rows that come until the last is there.
  static std::vector<int64_t> rows_until(RawClient& page, int64_t last, uint64_t acknowledged = 1) {
    std::vector<int64_t> times;
    while (times.empty() || times.back() != last) {
      const auto message = page.next();
      if (message.opcode < 0) break;
      page.say(Json{{"ack", ++acknowledged}}.dump());
      if (message.opcode != 2 || message.payload[0] != 1) continue;
      for (size_t at = 4; at < message.payload.size(); at += kStateRowBytes) {
        int64_t time = 0;
        std::memcpy(&time, message.payload.data() + at + 8, sizeof(time));
        times.push_back(time);
      }
    }
    return times;
  }

  StationOptions options_;
  std::unique_ptr<Station> station_;
  std::string host_, origin_;
};

TEST_F(StationTest, TellsAPageWhatTheEstimatorSaid) {
  start();
  for (int64_t t = 1; t <= 20; ++t) station_->post(row_at(t));
  Json hello;
  RawClient page = watcher(&hello);
  EXPECT_EQ(hello["columns"].size(), size_t{StateRow::kValues});
  EXPECT_EQ(hello["row_bytes"], kStateRowBytes);
  EXPECT_EQ(hello["pad"]["patches"].size(), sharp_target().patches.size());
  EXPECT_EQ(rows_until(page, 20).size(), 20u);
  station_->post(row_at(21));
  EXPECT_EQ(rows_until(page, 21, 2), std::vector<int64_t>{21});
}

TEST_F(StationTest, SendsAPictureOnceOneIsLookedAt) {
  start();
  EXPECT_FALSE(station_->wants_picture());
  RawClient page = watcher();
  ASSERT_TRUE(comes([&] { return station_->wants_picture(); }));
  auto seen = std::make_shared<SeenPicture>();
  seen->grey = cv::Mat(480, 640, CV_8UC1, cv::Scalar(90));
  seen->estimate.timestamp_ns = 77;
  station_->post(std::shared_ptr<const SeenPicture>(seen));
  std::string picture;
  for (uint64_t acknowledged = 1, last = 0; !last;) {
    const auto part = page.next();
    page.say(Json{{"ack", ++acknowledged}}.dump());
    ASSERT_EQ(part.opcode, 2);
    ASSERT_EQ(part.payload[0], 2);
    ASSERT_LE(part.payload.size(), 4 + 1250u);  // a twentieth of a second at 200 kbit/s
    last = static_cast<uint64_t>(part.payload[1]);
    picture += part.payload.substr(4);
  }
  uint32_t length = 0;
  std::memcpy(&length, picture.data(), 4);
  const Json json = Json::parse(picture.substr(4, length));
  EXPECT_EQ(json["t"], "77");
  EXPECT_EQ(picture.size(), 4 + length + json["jpeg"].get<size_t>() + json["bits"].get<size_t>());
}

TEST_F(StationTest, FillsTheGapOfAPageThatComesAgain) {
  start();
  for (int64_t t = 1; t <= 5; ++t) station_->post(row_at(t));
  Json hello;
  { watcher(&hello); }
  for (int64_t t = 6; t <= 9; ++t) station_->post(row_at(t));
  sleep(0.2);  // fetched
  RawClient page = client();
  ASSERT_TRUE(page.upgrade(host_, origin_));
  page.next();
  page.say(R"({"ack":1})");
  page.say(Json{{"from", {{"session", hello["session"]}, {"sequence", 4}}}}.dump());
  EXPECT_EQ(rows_until(page, 9), (std::vector<int64_t>{4, 5, 6, 7, 8, 9}));
}

TEST_F(StationTest, SkipsAPageThatStallsAndServesTheOthers) {
  options_.stall_timeout = 3;
  start();
  RawClient stalled = watcher(), well = watcher();
  for (int64_t t = 1; t <= 40; ++t) {
    station_->post(row_at(t));
    sleep(0.002);
  }
  EXPECT_THAT(rows_until(well, 40), testing::Contains(40));
  EXPECT_TRUE(stalled.closed_within());
  expect_well();
}

TEST_F(StationTest, TakesCommandsOnlyWhereControlIsAllowed) {
  start();
  RawClient page = watcher();
  page.say(R"({"do":"record"})");
  EXPECT_TRUE(page.closed_within());
  EXPECT_TRUE(station_->take_commands().empty());

  station_.reset();
  options_.control = true;
  start();
  RawClient pilot = watcher();
  pilot.say(R"({"do":"mark","text":"gust"})");
  pilot.say(R"({"do":"stop"})");
  std::vector<StationCommand> commands;
  comes([&] {
    for (auto& command : station_->take_commands()) commands.push_back(command);
    return commands.size() >= 2;
  });
  ASSERT_EQ(commands.size(), 2u);
  EXPECT_EQ(commands[0].kind, StationCommand::Kind::kMark);
  EXPECT_EQ(commands[0].text, "gust");
  EXPECT_EQ(commands[1].kind, StationCommand::Kind::kStopRecording);
}

TEST_F(StationTest, RefusesSocketsOfOtherSitesAndWithoutASession) {
  start();
  for (const std::string origin : {"http://evil.example", "null", "http://127.0.0.1:1"}) {
    RawClient page = client();
    EXPECT_FALSE(page.upgrade(host_, origin));
    EXPECT_THAT(page.head(), StartsWith("HTTP/1.1 403")) << origin;
  }
  RawClient rebound = client();
  EXPECT_FALSE(rebound.upgrade("evil.example", "http://evil.example"));

  station_.reset();
  options_.token = "correct-horse-battery";
  start();
  RawClient stranger = client();
  EXPECT_FALSE(stranger.upgrade(host_, origin_));
  EXPECT_THAT(stranger.head(), StartsWith("HTTP/1.1 401"));
  const std::string form = "token=correct-horse-battery";
  const std::string reply = client().request(
      "POST /login HTTP/1.1\r\nHost: " + host_ + "\r\nOrigin: " + origin_ +
      "\r\nContent-Type: application/x-www-form-urlencoded\r\nConnection: close\r\nContent-Length: " +
      std::to_string(form.size()) + "\r\n\r\n" + form);
  const size_t at = reply.find("perch_session=");
  ASSERT_NE(at, std::string::npos) << reply;
  RawClient page = client();
  EXPECT_TRUE(page.upgrade(host_, origin_, "Cookie: " + reply.substr(at, 14 + 32) + "\r\n")) << page.head();
}

TEST_F(StationTest, SurvivesMalformedRequests) {
  start();
  for (const std::string& bytes :
       {std::string("\r\n\r\n"), std::string("GET\r\n\r\n"), std::string("GET / HTTP/9.9\r\n\r\n"),
        std::string("\0\1\2\3\r\n\r\n", 8), "GET / HTTP/1.1\r\nHost" + std::string(200, ' ') + "\r\n\r\n",
        std::string("POST /login HTTP/1.1\r\nContent-Length: -1\r\n\r\n"),
        std::string("POST /login HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\nfffffffffffffffff\r\n")})
    EXPECT_THAT(client().request(bytes),
                testing::AnyOf(StartsWith("HTTP/1.1 400"), StartsWith("HTTP/1.1 403")))
        << bytes;
  EXPECT_THAT(get("/" + std::string(20000, 'a')), StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(get("/", "X: " + std::string(20000, 'a') + "\r\n"), StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(
      client().request("POST /login HTTP/1.1\r\nHost: " + host_ + "\r\nContent-Length: 100000\r\n\r\n"),
      StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(get("/../../etc/passwd"), StartsWith("HTTP/1.1 404"));
  expect_well();
}

TEST_F(StationTest, SurvivesBytesAtRandom) {
  start();
  TestRng rng;
  const std::string good = "GET / HTTP/1.1\r\nHost: " + host_ + "\r\nConnection: close\r\n\r\n";
  for (int i = 0; i < 100; ++i) {
    std::string bytes = good;
    for (int k = 1 + rng.index(4); k > 0; --k)
      bytes[static_cast<size_t>(rng.index(static_cast<int>(bytes.size())))] = static_cast<char>(rng.bits());
    client().send(bytes);
  }
  RawClient page = watcher();
  for (int i = 0; i < 100; ++i) {
    RawClient one = watcher();
    std::string frame = RawClient::frame(0x81, R"({"ack":1})");
    frame[static_cast<size_t>(rng.index(static_cast<int>(frame.size())))] = static_cast<char>(rng.bits());
    one.send(frame);
    if (i % 4 != 3) continue;
    // No more than may watch: `page`, and `one` where it is still listened to.
    EXPECT_TRUE(comes([&] { return station_->counts().watching <= 2; }));
  }
  expect_well();
}

TEST_F(StationTest, HangsUpOnMessagesThatAreNone) {
  start();
  const std::string deep = std::string(1000, '[');
  for (const std::string& message :
       {std::string("{"), std::string("[]"), std::string("17"), std::string("{}"), deep,
        std::string(R"({"ack":-1})"), std::string(R"({"ack":1e300})"), std::string(R"({"ack":99})"),
        std::string(R"({"from":{"session":1,"sequence":0}})"),
        std::string(R"({"from":{"session":"","sequence":99999999999}})"),
        std::string(R"({"view":{"grey":1}})"), std::string(R"({"view":7})"),
        std::string(R"({"do":"reboot"})"), std::string("\"\xff\"")}) {
    RawClient page = watcher();
    page.say(message);
    EXPECT_TRUE(page.closed_within()) << message;
  }
  for (const std::string& frame :
       {RawClient::frame(0x82, "{}"), RawClient::frame(0x83, "x"), RawClient::frame(0xf1, "x"),
        RawClient::frame(0x81, std::string(2000, ' ')), std::string("\x81\x05hello")}) {
    RawClient page = watcher();
    page.send(frame);
    EXPECT_TRUE(page.closed_within());
  }
  RawClient flood = watcher();
  for (int i = 0; i < 500 && flood.say(R"({"ack":1})"); ++i) {
  }
  EXPECT_TRUE(flood.closed_within());
  expect_well();
}

TEST_F(StationTest, WaitsForNoSlowRequestAndBearsMoreConnectionsThanItTakes) {
  options_.request_timeout = 0.5;
  start();
  RawClient slow = client();
  slow.send("GET / HTTP/1.1\r\nHo");
  std::vector<RawClient> many;
  for (int i = 0; i < 300; ++i) many.push_back(client());
  // A byte now and then does not keep it: the time is that of the whole request.
  for (int i = 0; i < 8 && slow.send("s"); ++i) sleep(0.1);
  EXPECT_TRUE(slow.closed_within());
  EXPECT_LE(station_->counts().connections, options_.most_connections);
  EXPECT_TRUE(comes([&] { return station_->counts().refused > 100; }));
  many.clear();
  EXPECT_TRUE(comes([&] { return station_->counts().connections == 0; }));
  expect_well();
}

TEST_F(StationTest, IsWatchedByNoMoreThanItTakes) {
  start();
  std::vector<RawClient> watchers;
  for (size_t i = 0; i < options_.most_watching; ++i) watchers.push_back(watcher());
  RawClient more = client();
  EXPECT_FALSE(more.upgrade(host_, origin_));
  EXPECT_THAT(more.head(), StartsWith("HTTP/1.1 503"));
}

TEST_F(StationTest, SaysWhereItCannotListen) {
  start();
  options_.port = station_->port();
  try {
    Station(options_, {sharp_target(), CameraModel::pinhole(1, 1, 1, 1, 2, 2), {}, "", false});
    ADD_FAILURE();
  } catch (const std::runtime_error& e) {
    EXPECT_THAT(e.what(), HasSubstr("outputs.station.listen: " + host_ + ": "));
  }
}

}  // namespace
}  // namespace perch
