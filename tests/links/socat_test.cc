// Two programs that know only one kind of connection each, joined by socat, as docs/PTZ.md shows.

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <memory>

#include "perch/links/byte_stream.h"
#include "support/child_program.h"
#include "support/free_port.h"
#include "support/temp_folder.h"

namespace perch {
namespace {

using namespace std::chrono_literals;

TEST(Socat, BridgesASerialPortAndTcp) {
  constexpr char kSocat[] = "/usr/bin/socat";
  if (access(kSocat, X_OK) != 0) GTEST_SKIP() << "no socat: scripts/setup installs it";
  const TempFolder folder;
  const std::string port = std::to_string(free_tcp_port()), terminal = folder / "tty";
  // The terminal first: socat opens the second address when the first is there, and waits at a listening one.
  ChildProgram bridge(
      folder, kSocat,
      {"PTY,link=" + terminal + ",raw,echo=0", "TCP-LISTEN:" + port + ",bind=127.0.0.1,reuseaddr"});
  for (int i = 0; i < 4000 && !std::filesystem::exists(terminal); ++i) usleep(10'000);
  ASSERT_TRUE(std::filesystem::exists(terminal)) << bridge.err();
  StreamOptions quick;
  quick.first_retry = 0.01;
  quick.last_retry = 0.05;
  ByteStream serial(parse_stream_url("serial:" + terminal + ":9600"), quick);
  ByteStream network(parse_stream_url("tcp://127.0.0.1:" + port), quick);
  // Every value of a byte: a terminal that is not raw eats some.
  std::vector<uint8_t> sent(256);
  for (size_t i = 0; i < sent.size(); ++i) sent[i] = static_cast<uint8_t>(i);
  std::vector<uint8_t> there, back;
  bool wrote = false;
  const auto until = std::chrono::steady_clock::now() + 40s;
  while (std::chrono::steady_clock::now() < until && (there.size() < 256 || back.size() < 256)) {
    serial.run(1ms, [&](const Chunk& c) { back.insert(back.end(), c.bytes.begin(), c.bytes.end()); });
    network.run(1ms, [&](const Chunk& c) { there.insert(there.end(), c.bytes.begin(), c.bytes.end()); });
    if (!wrote && serial.statistics().open && network.statistics().open)
      wrote = serial.write(sent) && network.write(sent);
  }
  EXPECT_EQ(there, sent);
  EXPECT_EQ(back, sent);
}

}  // namespace
}  // namespace perch
