#include "perch/target/whole_file.h"

#include <unistd.h>

#include <cerrno>
#include <stdexcept>
#include <system_error>

namespace perch {
namespace {

[[noreturn]] void fail(const std::filesystem::path& file, int error) {
  throw std::runtime_error(file.string() + ": cannot be written: " + std::generic_category().message(error));
}

}  // namespace

WholeFile::WholeFile(std::filesystem::path file) : file_(std::move(file)) {
  // A directory would be found only when the work is done.
  std::error_code ignored;
  if (std::filesystem::is_directory(file_, ignored)) fail(file_, EISDIR);
  aside_ = file_;
  aside_ += ".part" + std::to_string(getpid());  // two runs at once do not write into one another's file
  errno = 0;
  stream_.open(aside_, std::ios::binary | std::ios::trunc);
  if (!stream_) fail(file_, errno);
}

WholeFile::~WholeFile() {
  if (aside_.empty()) return;
  stream_.close();
  std::error_code ignored;
  std::filesystem::remove(aside_, ignored);
}

void WholeFile::write(std::string_view bytes) {
  stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
}

void WholeFile::keep() {
  errno = 0;
  stream_.close();
  if (!stream_) fail(file_, errno != 0 ? errno : EIO);
  std::error_code error;
  std::filesystem::rename(aside_, file_, error);
  if (error) fail(file_, error.value());
  aside_.clear();
}

}  // namespace perch
