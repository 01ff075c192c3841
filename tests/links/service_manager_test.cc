#include "perch/links/service_manager.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdlib>
#include <string>

#include "support/temp_folder.h"

namespace perch {
namespace {

using std::chrono::microseconds;

// The other end, as systemd has it.
class Listener {
 public:
  explicit Listener(const std::string& name) : fd_(socket(AF_UNIX, SOCK_DGRAM, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    name.copy(address.sun_path, sizeof(address.sun_path) - 1);
    const bool abstract = name[0] == '@';
    if (abstract) address.sun_path[0] = '\0';
    const size_t size = offsetof(sockaddr_un, sun_path) + name.size() + (abstract ? 0 : 1);
    EXPECT_EQ(bind(fd_, reinterpret_cast<sockaddr*>(&address), static_cast<socklen_t>(size)), 0);
  }
  ~Listener() { close(fd_); }
  std::string next() const {
    char text[256];
    const ssize_t size = recv(fd_, text, sizeof(text), MSG_DONTWAIT);
    return size < 0 ? "(nothing)" : std::string(text, static_cast<size_t>(size));
  }

 private:
  int fd_;
};

class ServiceManagerTest : public testing::Test {
 protected:
  ServiceManagerTest() { clear(); }
  ~ServiceManagerTest() override { clear(); }
  static void clear() {
    for (const char* name : {"NOTIFY_SOCKET", "WATCHDOG_USEC", "WATCHDOG_PID"}) unsetenv(name);
  }
  static void set(const char* name, const std::string& value) { setenv(name, value.c_str(), 1); }
  TempFolder folder_;
};

TEST_F(ServiceManagerTest, SaysWhatItIsTold) {
  const std::string abstract = "@perch-test-" + std::to_string(getpid());
  for (const std::string& name : {(folder_ / "notify").string(), abstract}) {
    const Listener listener(name);
    set("NOTIFY_SOCKET", name);
    ServiceManager manager;
    manager.ready("SEARCH");
    manager.alive();
    manager.status("two\nlines");
    manager.stopping();
    EXPECT_EQ(listener.next(), "READY=1");
    EXPECT_EQ(listener.next(), "STATUS=SEARCH");
    EXPECT_EQ(listener.next(), "WATCHDOG=1");
    EXPECT_EQ(listener.next(), "STATUS=two lines");
    EXPECT_EQ(listener.next(), "STOPPING=1");
  }
}

TEST_F(ServiceManagerTest, AWatchdogIsOnlyWhatIsMeantForThisProcess) {
  const std::string name = (folder_ / "notify").string();
  const Listener listener(name);
  set("WATCHDOG_USEC", "3000000");
  EXPECT_EQ(ServiceManager().watchdog(), std::nullopt);  // nobody to tell
  set("NOTIFY_SOCKET", name);
  EXPECT_EQ(ServiceManager().watchdog(), microseconds(3'000'000));
  set("WATCHDOG_PID", std::to_string(getpid()));
  EXPECT_EQ(ServiceManager().watchdog(), microseconds(3'000'000));
  set("WATCHDOG_PID", std::to_string(getpid() + 1));
  EXPECT_EQ(ServiceManager().watchdog(), std::nullopt);
  unsetenv("WATCHDOG_PID");
  for (const char* wrong : {"", "0", "-5", "3s", "99999999999999999999"}) {
    set("WATCHDOG_USEC", wrong);
    EXPECT_EQ(ServiceManager().watchdog(), std::nullopt) << wrong;
  }
}

TEST_F(ServiceManagerTest, NobodyThereIsNoHarm) {
  ServiceManager().ready("");
  for (const std::string& name : {std::string(), (folder_ / "gone").string(), std::string(300, 'x')}) {
    set("NOTIFY_SOCKET", name);
    ServiceManager manager;
    manager.ready("");
    manager.alive();
  }
}

TEST_F(ServiceManagerTest, AManagerThatDoesNotReadIsNotWaitedFor) {
  const std::string name = (folder_ / "notify").string();
  const Listener listener(name);
  set("NOTIFY_SOCKET", name);
  ServiceManager manager;
  for (int i = 0; i < 10'000; ++i) manager.alive();  // far more than a socket's queue holds
}

}  // namespace
}  // namespace perch
