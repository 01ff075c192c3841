#pragma once

#include <cstddef>
#include <cstdint>

namespace perch {

// What a V4L2 camera is driven by: the kernel, or a test's make-believe. Failures are negative errno values;
// calls that a signal interrupts are made again.
class V4l2Kernel {
 public:
  virtual ~V4l2Kernel() = default;
  virtual int open(const char* path) = 0;  // a descriptor that does not block
  virtual void close(int fd) = 0;
  virtual int ioctl(int fd, unsigned long request, void* argument) = 0;
  virtual void* map(int fd, size_t length, int64_t offset) = 0;  // nullptr when it fails
  virtual void unmap(void* start, size_t length) = 0;
  // Waits for POLLIN or POLLPRI: what is so, 0 when nothing came.
  virtual int poll(int fd, int64_t timeout_ns) = 0;
};

V4l2Kernel& the_kernel();

}  // namespace perch
