#include "perch/camera/v4l2_kernel.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <cerrno>

namespace perch {

namespace {

// The result of a call, or its negative errno.
template <typename Call>
int retried(const Call& call) {
  int result = 0;
  do result = call();
  while (result < 0 && errno == EINTR);
  return result < 0 ? -errno : result;
}

class Kernel : public V4l2Kernel {
 public:
  int open(const char* path) override {
    return retried([&] { return ::open(path, O_RDWR | O_NONBLOCK | O_CLOEXEC); });
  }
  void close(int fd) override { ::close(fd); }
  int ioctl(int fd, unsigned long request, void* argument) override {
    return retried([&] { return ::ioctl(fd, request, argument); });
  }
  void* map(int fd, size_t length, int64_t offset) override {
    void* start = mmap(nullptr, length, PROT_READ | PROT_WRITE, MAP_SHARED, fd, offset);
    return start == MAP_FAILED ? nullptr : start;
  }
  void unmap(void* start, size_t length) override { munmap(start, length); }
  int poll(int fd, int64_t timeout_ns) override {
    pollfd what{fd, POLLIN | POLLPRI, 0};
    const timespec timeout{timeout_ns / 1'000'000'000, timeout_ns % 1'000'000'000};
    // Interrupted, it says that nothing came: whoever asks knows how long to wait on.
    const int result = ::ppoll(&what, 1, &timeout, nullptr);
    if (result < 0) return errno == EINTR ? 0 : -errno;
    return result == 0 ? 0 : what.revents;
  }
};

}  // namespace

V4l2Kernel& the_kernel() {
  static Kernel kernel;
  return kernel;
}

}  // namespace perch
