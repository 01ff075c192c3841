#pragma once

#include <chrono>
#include <optional>
#include <string>

namespace perch {

// Tells the service manager how a service does, by the datagram protocol of sd_notify(3): systemd names a
// socket in NOTIFY_SOCKET, and how often it wants a sign of life in WATCHDOG_USEC. Without a service manager
// nothing happens. Never waits: a word that cannot be said at once is not said.
class ServiceManager {
 public:
  // Of this process's environment.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  // One line for `systemctl status`.
  void status(const std::string& text);
  void ready(const std::string& status_text);
  void alive();
  void stopping();

  // Silence for so long, and the service is killed and started anew.
  std::optional<std::chrono::microseconds> watchdog() const { return watchdog_; }

 private:
  void send(const std::string& state);

  int socket_ = -1;  // -1: there is none to tell
  std::optional<std::chrono::microseconds> watchdog_;
};

}  // namespace perch
