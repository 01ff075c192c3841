#include "perch/config/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace perch {

AtomicFile::AtomicFile(std::filesystem::path file) : file_(std::move(file)), part_(file_.string() + ".part") {
  errno = 0;
  stream_.open(part_, std::ios::binary | std::ios::trunc);
  if (!stream_) fail();
}

AtomicFile::~AtomicFile() {
  if (part_.empty()) return;
  stream_.close();
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void AtomicFile::append(std::string_view text) {
  errno = 0;
  stream_.write(text.data(), static_cast<std::streamsize>(text.size()));
  if (!stream_) fail();
}

void AtomicFile::commit() {
  errno = 0;
  stream_.flush();
  if (!stream_) fail();
  stream_.close();
  // To the disk before the name: after a power cut a renamed file could be empty otherwise.
  const int descriptor = open(part_.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail();
  const bool synced = fsync(descriptor) == 0 || errno == EINVAL;  // EINVAL: a file system without
  const int error = errno;
  close(descriptor);
  errno = error;
  if (!synced) fail();
  if (std::rename(part_.c_str(), file_.c_str()) != 0) fail();
  part_.clear();
}

void AtomicFile::fail() const {
  throw std::runtime_error(file_.string() + ": cannot be written: " +
                           (errno ? std::generic_category().message(errno) : "an earlier error"));
}

void write_whole_file(const std::filesystem::path& file, std::string_view text) {
  AtomicFile out(file);
  out.append(text);
  out.commit();
}

}  // namespace perch
