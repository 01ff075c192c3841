#include "perch/flight/recording_disk.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <limits>
#include <stdexcept>
#include <system_error>

namespace perch {

namespace fs = std::filesystem;

namespace {

class RealFile : public RecordingFile {
 public:
  explicit RealFile(fs::path file)
      : file_(std::move(file)),
        descriptor_(open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_APPEND | O_CLOEXEC, 0644)) {
    if (descriptor_ < 0) fail(errno);
  }
  ~RealFile() override { close(descriptor_); }
  RealFile(const RealFile&) = delete;
  RealFile& operator=(const RealFile&) = delete;

  void append(std::string_view bytes) override {
    if (torn_) cut();
    size_t done = 0;
    while (done < bytes.size()) {
      const ssize_t n = write(descriptor_, bytes.data() + done, bytes.size() - done);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        const int error = n < 0 ? errno : ENOSPC;
        torn_ = done > 0;
        if (torn_) cut();
        fail(error);
      }
      done += static_cast<size_t>(n);
    }
    size_ += static_cast<off_t>(bytes.size());
  }

 private:
  // Back to the last whole append: half a row would spoil the next one, too.
  void cut() {
    if (ftruncate(descriptor_, size_) != 0) fail(errno);
    torn_ = false;
  }
  [[noreturn]] void fail(int error) const {
    throw std::runtime_error(file_.string() +
                             ": cannot be written: " + std::generic_category().message(error));
  }

  fs::path file_;
  int descriptor_;
  off_t size_ = 0;
  bool torn_ = false;
};

class RealDisk : public RecordingDisk {
 public:
  std::unique_ptr<RecordingFile> create(const fs::path& file) override {
    return std::make_unique<RealFile>(file);
  }
  double bytes_left(const fs::path& folder) override {
    std::error_code error;
    const auto space = fs::space(folder, error);
    return error ? std::numeric_limits<double>::infinity() : static_cast<double>(space.available);
  }
  // Of the whole file system at once: pictures are many files, and their folder's entries count as well.
  void sync(const fs::path& folder) override {
    const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    const bool good = descriptor >= 0 && syncfs(descriptor) == 0;
    const int error = errno;
    if (descriptor >= 0) close(descriptor);
    if (!good) {
      throw std::runtime_error(folder.string() +
                               ": cannot be synchronised: " + std::generic_category().message(error));
    }
  }
};

}  // namespace

std::shared_ptr<RecordingDisk> real_disk() { return std::make_shared<RealDisk>(); }

}  // namespace perch
