#include "perch/links/byte_stream.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "support/free_port.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

// Long enough for a machine that does other work; a test that passes does not wait for it.
constexpr auto kPatience = 40s;

StreamOptions quick() {
  StreamOptions options;
  options.first_retry = 0.01;
  options.last_retry = 0.05;
  return options;
}

// A stream with all it has received.
struct End {
  explicit End(const std::string& url, const StreamOptions& options = quick())
      : stream(parse_stream_url(url), options) {}
  void run() {
    stream.run(1ms, [&](const Chunk& chunk) {
      received.append(chunk.bytes.begin(), chunk.bytes.end());
      ++chunks;
      datagram = chunk.datagram;
      arrival_ns = chunk.arrival_ns;
    });
  }
  bool write(const std::string& text) {
    return stream.write({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  }
  bool open() const { return stream.statistics().open; }

  ByteStream stream;
  std::string received;
  int chunks = 0;
  bool datagram = false;
  int64_t arrival_ns = 0;
};

// Runs the ends until `done`; false when it takes too long.
template <class Done, class... Ends>
bool run_until(Done done, Ends&... ends) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (!done()) {
    if (std::chrono::steady_clock::now() > until) return false;
    (ends.run(), ...);
  }
  return true;
}

// The master's side of a pseudo terminal.
struct Terminal {
  Terminal() : master(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    EXPECT_EQ(grantpt(master), 0);
    EXPECT_EQ(unlockpt(master), 0);
    name = ptsname(master);
  }
  ~Terminal() { close(master); }
  void write(const std::string& text) const {
    EXPECT_EQ(::write(master, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::string read() const {
    char buffer[1024];
    const ssize_t size = ::read(master, buffer, sizeof(buffer));
    return size > 0 ? std::string(buffer, static_cast<size_t>(size)) : "";
  }
  int master;
  std::string name;
};

TEST(ByteStream, ASerialPortCarriesEveryByteUnchangedBothWays) {
  const Terminal terminal;
  End end("serial://" + terminal.name + "?baud=115200");
  ASSERT_TRUE(run_until([&] { return end.open(); }, end));
  std::string all;  // among them what a terminal would act upon: ^C, ^D, CR, XOFF
  for (int i = 0; i < 256; ++i) all.push_back(static_cast<char>(i));
  const int64_t before = monotonic_ns();
  terminal.write(all);
  ASSERT_TRUE(run_until([&] { return end.received.size() >= 256; }, end));
  EXPECT_EQ(end.received, all);
  EXPECT_FALSE(end.datagram);
  EXPECT_GE(end.arrival_ns, before);
  EXPECT_LE(end.arrival_ns, monotonic_ns());

  EXPECT_TRUE(end.write(all));
  std::string echoed;
  ASSERT_TRUE(run_until([&] { return (echoed += terminal.read()).size() >= 256; }, end));
  EXPECT_EQ(echoed, all);
}

TEST(ByteStream, ASerialPortThatGoesAndComesBackIsOpenedAgain) {
  const TempFolder folder;
  const std::string name = (folder / "tty").string();
  End end("serial:" + name + ":57600");
  ASSERT_TRUE(run_until([&] { return end.stream.statistics().open_failed >= 2; }, end));
  EXPECT_EQ(end.stream.statistics().last_error, "serial:" + name + ":57600: No such file or directory");
  for (int times = 1; times <= 2; ++times) {
    const Terminal terminal;
    std::filesystem::create_symlink(terminal.name, name);
    ASSERT_TRUE(run_until([&] { return end.open(); }, end));
    terminal.write("x");
    ASSERT_TRUE(run_until([&] { return end.received.size() == static_cast<size_t>(times); }, end));
    EXPECT_EQ(end.stream.statistics().opened, static_cast<uint64_t>(times));
    std::filesystem::remove(name);
  }
  ASSERT_TRUE(run_until([&] { return !end.open(); }, end));
  EXPECT_EQ(end.stream.statistics().disconnected, 2u);
}

TEST(ByteStream, TcpFindsItsListenerWheneverThatComes) {
  const std::string port = std::to_string(free_tcp_port());
  End client("tcp://127.0.0.1:" + port);
  ASSERT_TRUE(run_until([&] { return client.stream.statistics().open_failed >= 2; }, client));
  for (int times = 1; times <= 2; ++times) {
    End server("tcp-listen://:" + port);
    ASSERT_TRUE(run_until([&] { return client.open() && server.open(); }, client, server));
    EXPECT_TRUE(client.write("ping"));
    EXPECT_TRUE(server.write("pong"));
    client.received.clear();
    ASSERT_TRUE(
        run_until([&] { return client.received == "pong" && server.received == "ping"; }, client, server));
  }
  ASSERT_TRUE(run_until([&] { return !client.open(); }, client));
  EXPECT_EQ(client.stream.statistics().opened, 2u);
  EXPECT_EQ(client.stream.statistics().disconnected, 2u);
  EXPECT_FALSE(client.write("nobody"));
}

TEST(ByteStream, WhoCallsAnewTakesTheLine) {
  const std::string port = std::to_string(free_tcp_port());
  End server("tcp-listen://127.0.0.1:" + port);
  ASSERT_TRUE(run_until([&] { return true; }, server));
  server.run();
  End first("tcp://127.0.0.1:" + port);
  ASSERT_TRUE(run_until([&] { return first.open() && server.open(); }, first, server));
  StreamOptions patient = quick();
  patient.first_retry = patient.last_retry = 100;  // the first does not call again
  End second("tcp://localhost:" + port, patient);
  ASSERT_TRUE(
      run_until([&] { return second.open() && server.stream.statistics().opened == 2; }, second, server));
  EXPECT_TRUE(server.write("yours"));
  EXPECT_TRUE(run_until([&] { return second.received == "yours"; }, second, server));
  EXPECT_EQ(first.received, "");
}

TEST(ByteStream, UdpAnswersToWhomItHeardLast) {
  const std::string port = std::to_string(free_udp_port());
  End base("udp:127.0.0.1:" + port);
  End one("udp://127.0.0.1:" + port), two("udp://localhost:" + port);
  ASSERT_TRUE(run_until([&] { return base.open() && one.open() && two.open(); }, base, one, two));
  base.write("to nobody");
  ASSERT_TRUE(run_until([&] { return base.stream.statistics().writes_dropped == 1; }, base));

  one.write("one");
  ASSERT_TRUE(run_until([&] { return base.received == "one"; }, base, one, two));
  EXPECT_TRUE(base.datagram);
  base.write("1");
  ASSERT_TRUE(run_until([&] { return one.received == "1"; }, base, one, two));
  two.write("two");
  ASSERT_TRUE(run_until([&] { return base.received == "onetwo"; }, base, one, two));
  base.write("2");
  ASSERT_TRUE(run_until([&] { return two.received == "2"; }, base, one, two));
  EXPECT_EQ(one.received, "1");
}

TEST(ByteStream, EachWriteIsADatagramAndOneToNobodyBreaksNothing) {
  const std::string port = std::to_string(free_udp_port());
  End out("udp://127.0.0.1:" + port);
  ASSERT_TRUE(run_until([&] { return out.open(); }, out));
  for (int i = 0; i < 20; ++i) {  // refused by ICMP
    out.write("x");
    out.run();
  }
  EXPECT_TRUE(out.open());
  End in("udp-listen://:" + port);
  ASSERT_TRUE(run_until([&] { return in.open(); }, in, out));
  out.write("ab");
  out.write("cd");
  ASSERT_TRUE(run_until([&] { return in.chunks >= 2; }, in, out));
  EXPECT_EQ(in.received, "abcd");
  EXPECT_EQ(out.stream.statistics().disconnected, 0u);
}

TEST(ByteStream, AWriterNeverWaitsForAReaderThatDoesNotRead) {
  const Terminal terminal;  // whose other side nobody reads: it holds some kB
  End end("serial:" + terminal.name);
  ASSERT_TRUE(run_until([&] { return end.open(); }, end));
  const std::string message(100, 'm');
  std::vector<std::chrono::nanoseconds> took;
  const auto begin = std::chrono::steady_clock::now();
  for (auto last = begin; took.size() < 2000;) {
    end.write(message);
    end.run();
    const auto now = std::chrono::steady_clock::now();
    took.push_back(now - std::exchange(last, now));
  }
  // 1 ms is what run() may wait each time, and it does as nothing happens.
  std::nth_element(took.begin(), took.begin() + 1000, took.end());
  EXPECT_LT(took[1000], 20ms);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2000 * 1ms + kPatience);
  const StreamStatistics statistics = end.stream.statistics();
  EXPECT_GT(statistics.writes_dropped, 1500u);

  // Whole messages were dropped, the oldest: what is left comes out in full.
  end.write("last");
  std::string all;
  ASSERT_TRUE(run_until([&] { return (all += terminal.read()).ends_with("last"); }, end));
  EXPECT_EQ(all.size() % 100, 4u);
}

TEST(ByteStream, AMessageLargerThanTheQueueIsDropped) {
  const Terminal terminal;
  End end("serial:" + terminal.name);
  ASSERT_TRUE(run_until([&] { return end.open(); }, end));
  EXPECT_FALSE(end.write(std::string(5000, 'x')));
  EXPECT_EQ(end.stream.statistics().writes_dropped, 1u);
}

TEST(ByteStream, AnotherThreadMayWriteAndWake) {
  const Terminal terminal;
  End end("serial:" + terminal.name);
  ASSERT_TRUE(run_until([&] { return end.open(); }, end));
  std::thread writer([&] {
    for (int i = 0; i < 100; ++i) end.write("0123456789");
    end.stream.wake();
  });
  std::string all;
  EXPECT_TRUE(run_until([&] { return (all += terminal.read()).size() == 1000; }, end));
  writer.join();
  std::thread waker([&] { end.stream.wake(); });
  const auto begin = std::chrono::steady_clock::now();
  end.stream.run(60s, [](const Chunk&) {});
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 30s);
  waker.join();
}

TEST(ByteStream, StandardInputAndOutputAreAStreamThatEndsOnce) {
  int in[2], out[2];
  ASSERT_EQ(pipe(in), 0);
  ASSERT_EQ(pipe(out), 0);
  const int old_in = dup(STDIN_FILENO), old_out = dup(STDOUT_FILENO);
  dup2(in[0], STDIN_FILENO);
  dup2(out[1], STDOUT_FILENO);
  std::optional<End> end("stdio:");
  const bool opened = run_until([&] { return end->open(); }, *end);
  const bool wrote = end->write("answer");
  EXPECT_EQ(::write(in[1], "question", 8), 8);
  const bool heard = run_until([&] { return end->received == "question"; }, *end);
  close(in[1]);
  const bool ended = run_until([&] { return end->stream.ended(); }, *end);
  end.reset();
  dup2(old_in, STDIN_FILENO);
  dup2(old_out, STDOUT_FILENO);
  char text[10] = {};
  EXPECT_EQ(read(out[0], text, sizeof(text)), 6);
  EXPECT_STREQ(text, "answer");
  EXPECT_TRUE(opened && wrote && heard && ended);
  for (const int descriptor : {in[0], out[0], out[1], old_in, old_out}) close(descriptor);
}

}  // namespace
}  // namespace perch
