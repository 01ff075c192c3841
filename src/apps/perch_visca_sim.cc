// perch-visca-sim: a Sony EVI-D30 that is not there.

#include <fcntl.h>
#include <gflags/gflags.h>
#include <stdlib.h>
#include <termios.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <thread>

#include "perch/links/byte_stream.h"
#include "perch/simulation/serial_line.h"
#include "perch/simulation/simulated_evi_d30.h"
#include "program.h"

DEFINE_string(pty, "", "a name for the pseudo-terminal it is at, a link that is made and taken away again");
DEFINE_string(listen, "", "instead: a UDP port for VISCA over IP, as udp:0.0.0.0:52381");
DEFINE_string(truth, "",
              "where its true angles are sent 250 times a second, as udp://127.0.0.1:5010 (camera.head "
              "of a simulation)");
DEFINE_double(baud, 9600, "of the line; 0: as fast as it can");
DEFINE_double(garble, 0, "part of the bytes of which a bit is turned over, both ways");
DEFINE_int32(seed, 1, "of what is garbled");
DEFINE_double(duration, 0, "ends after so many seconds; 0: only when told to");

namespace perch {
namespace {

using namespace std::chrono_literals;

constexpr char kDescription[] =
    "Acts as a Sony EVI-D30 pan/tilt/zoom camera on a pseudo-terminal (or a later one on a UDP port): its "
    "two\n"
    "sockets, ranges, speeds and delays, and a line of 9600 baud. For perch-live's ptz.device: "
    "visca+serial:PTY.";

std::atomic<bool> stop_requested = false;

// The master's end of a pseudo-terminal with a link to the other one.
class PseudoTerminal {
 public:
  explicit PseudoTerminal(const std::filesystem::path& link)
      : master_(posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK)), link_(link) {
    const char* name = nullptr;
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0 || !(name = ptsname(master_)))
      throw std::runtime_error(std::string("no pseudo-terminal: ") + std::strerror(errno));
    // Held open, so that whoever opens and closes it does not hang up the line.
    slave_ = open(name, O_RDWR | O_NOCTTY);
    termios settings{};
    if (slave_ < 0 || tcgetattr(slave_, &settings) != 0)
      throw std::runtime_error(std::string(name) + ": cannot be opened");
    cfmakeraw(&settings);
    tcsetattr(slave_, TCSANOW, &settings);
    if (!link_.empty()) {
      if (std::filesystem::is_symlink(link_)) std::filesystem::remove(link_);
      std::filesystem::create_symlink(name, link_);
    }
    std::cout << "an EVI-D30 at " << name << std::endl;
  }
  ~PseudoTerminal() {
    std::error_code ignored;
    if (!link_.empty()) std::filesystem::remove(link_, ignored);
    if (slave_ >= 0) close(slave_);
    close(master_);
  }
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;

  std::vector<uint8_t> read() const {
    uint8_t bytes[256];
    const ssize_t size = ::read(master_, bytes, sizeof(bytes));
    return {bytes, bytes + std::max<ssize_t>(size, 0)};
  }
  // Where nobody reads, the terminal is full some time, and a line loses what is sent.
  void write(const std::vector<uint8_t>& bytes) const {
    if (::write(master_, bytes.data(), bytes.size()) < 0) ++lost_;
  }

 private:
  int master_, slave_ = -1;
  std::filesystem::path link_;
  mutable uint64_t lost_ = 0;
};

// The device, at whichever end of a wire.
class Bench {
 public:
  Bench()
      : device_(options()),
        there_(FLAGS_baud, FLAGS_garble, static_cast<uint64_t>(FLAGS_seed)),
        back_(FLAGS_baud, FLAGS_garble, static_cast<uint64_t>(FLAGS_seed) + 1) {
    if (FLAGS_listen.empty()) {
      terminal_ = std::make_unique<PseudoTerminal>(FLAGS_pty);
    } else {
      network_ = std::make_unique<ByteStream>(parse_stream_url(FLAGS_listen));
      std::cout << "an EVI-D30 over IP at " << FLAGS_listen << std::endl;
    }
    if (!FLAGS_truth.empty()) truth_ = std::make_unique<ByteStream>(parse_stream_url(FLAGS_truth));
  }

  void turn() {
    if (terminal_) {
      std::this_thread::sleep_for(1ms);
      there_.send(terminal_->read(), monotonic_ns());
      if (const auto bytes = there_.receive(monotonic_ns()); !bytes.empty()) device_.receive(bytes);
    } else {
      network_->run(1ms, [&](const Chunk& chunk) { device_.receive(chunk.bytes); });
    }
    const int64_t now_ns = monotonic_ns();
    for (const auto& packet : device_.advance(now_ns)) {
      if (network_) network_->write(packet);
      back_.send(packet, now_ns);
    }
    const auto bytes = back_.receive(now_ns);
    if (terminal_ && !bytes.empty()) terminal_->write(bytes);
    if (truth_ && now_ns - told_ns_ >= 4'000'000) tell_truth(now_ns);
  }
  const SimulatedEviD30& device() const { return device_; }

 private:
  static EviD30Options options() {
    EviD30Options options;
    options.over_ip = !FLAGS_listen.empty();
    return options;
  }
  void tell_truth(int64_t now_ns) {
    told_ns_ = now_ns;
    const auto head = device_.at(now_ns);
    char text[120];
    const int size = std::snprintf(text, sizeof(text), "%lld %.9f %.9f %.9f\n",
                                   static_cast<long long>(head.time_ns), head.pan, head.tilt, head.zoom);
    truth_->write({reinterpret_cast<const uint8_t*>(text), static_cast<size_t>(size)});
    truth_->run(0ns, [](const Chunk&) {});
  }

  SimulatedEviD30 device_;
  SerialLine there_, back_;
  std::unique_ptr<PseudoTerminal> terminal_;
  std::unique_ptr<ByteStream> network_, truth_;
  int64_t told_ns_ = 0;
};

int run(const CommandLine& line) {
  if (!line.arguments.empty()) throw UsageError("expected flags only, found \"" + line.arguments[0] + '"');
  if (!(FLAGS_garble >= 0 && FLAGS_garble <= 1)) throw UsageError("--garble: expected 0 to 1");
  if (!(FLAGS_baud >= 0)) throw UsageError("--baud: expected 0 or more");
  if (!(FLAGS_duration >= 0)) throw UsageError("--duration: expected 0 or more");
  if (!FLAGS_listen.empty() && !FLAGS_pty.empty()) throw UsageError("--listen: expected without --pty");
  std::signal(SIGINT, [](int) { stop_requested = true; });
  std::signal(SIGTERM, [](int) { stop_requested = true; });
  Bench bench;
  const int64_t begin_ns = monotonic_ns();
  while (!stop_requested) {
    bench.turn();
    if (FLAGS_duration > 0 && static_cast<double>(monotonic_ns() - begin_ns) > 1e9 * FLAGS_duration) break;
  }
  const auto& counters = bench.device().counters();
  std::cout << counters.packets << " packets, " << counters.commands << " commands, " << counters.inquiries
            << " inquiries, " << counters.errors << " errors\n";
  return 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  return perch::run_program(argc, argv, {"perch-visca-sim", "[--pty LINK] [flags]", perch::kDescription},
                            perch::run);
}
