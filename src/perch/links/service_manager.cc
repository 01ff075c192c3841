#include "perch/links/service_manager.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <cstdlib>
#include <cstring>
#include <string_view>

namespace perch {
namespace {

// A datagram socket that sends to this name; -1 where that cannot be. A name that begins with @ is of Linux's
// abstract ones, which begin with a NUL.
int connected_to(std::string_view name) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.empty() || name.size() >= sizeof(address.sun_path)) return -1;
  std::copy(name.begin(), name.end(), address.sun_path);
  if (address.sun_path[0] == '@') address.sun_path[0] = '\0';
  const int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const auto size = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + name.size());
  if (fd >= 0 && connect(fd, reinterpret_cast<const sockaddr*>(&address), size) == 0) return fd;
  if (fd >= 0) close(fd);
  return -1;
}

std::optional<int64_t> number_of(const char* text) {
  if (!text) return std::nullopt;
  int64_t value = 0;
  const char* end = text + std::strlen(text);
  const auto [stop, error] = std::from_chars(text, end, value);
  if (error != std::errc() || stop != end || value <= 0) return std::nullopt;
  return value;
}

}  // namespace

ServiceManager::ServiceManager() {
  if (const char* name = std::getenv("NOTIFY_SOCKET")) socket_ = connected_to(name);
  const auto period = number_of(std::getenv("WATCHDOG_USEC"));
  // WATCHDOG_PID: whom it is meant for; a shell that started us may have inherited it.
  const auto whom = number_of(std::getenv("WATCHDOG_PID"));
  if (socket_ >= 0 && period && (!whom || *whom == getpid())) watchdog_ = std::chrono::microseconds(*period);
}

ServiceManager::~ServiceManager() {
  if (socket_ >= 0) close(socket_);
}

void ServiceManager::send(const std::string& state) {
  if (socket_ >= 0) (void)::send(socket_, state.data(), state.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
}

void ServiceManager::status(const std::string& text) {
  std::string line = text;
  std::replace(line.begin(), line.end(), '\n', ' ');  // a new line would begin another variable
  send("STATUS=" + line);
}

void ServiceManager::ready(const std::string& status_text) {
  send("READY=1");
  status(status_text);
}

void ServiceManager::alive() { send("WATCHDOG=1"); }
void ServiceManager::stopping() { send("STOPPING=1"); }

}  // namespace perch
