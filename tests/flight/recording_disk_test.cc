#include "perch/flight/recording_disk.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/resource.h>

#include "support/temp_folder.h"

namespace perch {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

// The largest file this process may write, for a while: a disk that takes a part of a write and then nothing.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() { setrlimit(RLIMIT_FSIZE, &before_); }

 private:
  rlimit before_{};
};

TEST(RecordingDisk, CutsOffWhatAFullDiskTookOfARow) {
  const TempFolder folder;
  const auto file = real_disk()->create(folder / "a.csv");
  file->append("one\n");
  {
    const FileSizeLimit limit(6);
    EXPECT_THAT([&] { file->append("two\n"); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("a.csv: cannot be written: "))));
    EXPECT_EQ(read_file(folder / "a.csv"), "one\n");
  }
  file->append("three\n");
  EXPECT_EQ(read_file(folder / "a.csv"), "one\nthree\n");
}

TEST(RecordingDisk, SaysWhichFileAndWhy) {
  const auto disk = real_disk();
  EXPECT_THAT([&] { disk->create("/dev/full")->append("x"); },
              ThrowsMessage<std::runtime_error>("/dev/full: cannot be written: No space left on device"));
  EXPECT_THAT(
      [&] { disk->create("/no/such/folder/a"); },
      ThrowsMessage<std::runtime_error>("/no/such/folder/a: cannot be written: No such file or directory"));
  EXPECT_GT(disk->bytes_left("/"), 0);
}

}  // namespace
}  // namespace perch
