#include "perch/config/atomic_file.h"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <csignal>

#include "support/temp_folder.h"

namespace perch {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(AtomicFile, IsThereOnceItIsWhole) {
  const TempFolder folder;
  AtomicFile file(folder / "a.csv");
  file.append("one\n");
  file.stream() << 2 << "\n";
  EXPECT_FALSE(fs::exists(folder / "a.csv"));
  file.commit();
  EXPECT_EQ(read_file(folder / "a.csv"), "one\n2\n");
  EXPECT_FALSE(fs::exists(folder / "a.csv.part"));
}

TEST(AtomicFile, LeavesWhatWasThereWhenDropped) {
  const TempFolder folder;
  folder.write("a.csv", "before");
  {
    AtomicFile file(folder / "a.csv");
    file.append("half of ");
  }
  EXPECT_EQ(read_file(folder / "a.csv"), "before");
  EXPECT_FALSE(fs::exists(folder / "a.csv.part"));
  AtomicFile file(folder / "a.csv");
  file.append("after");
  file.commit();
  EXPECT_EQ(read_file(folder / "a.csv"), "after");
}

TEST(AtomicFile, SaysWhatCannotBeWritten) {
  const TempFolder folder;
  EXPECT_THAT([&] { AtomicFile file(folder / "no/such/a.csv"); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("no/such/a.csv: cannot be written: "), HasSubstr("No such file"))));
  fs::create_directory(folder / "taken");
  EXPECT_THAT(
      [&] {
        AtomicFile file(folder / "taken");
        file.commit();
      },
      ThrowsMessage<std::runtime_error>(HasSubstr("taken: cannot be written: ")));
  EXPECT_FALSE(fs::exists(folder / "taken.part"));
}

// A limit on the size of files fails a write as a full disk does.
TEST(AtomicFile, FullDiskLeavesNoHalfFile) {
  const TempFolder folder;
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{10'000, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  const auto write_much = [&](size_t bytes) {
    AtomicFile file(folder / "a.csv");
    file.append(std::string(bytes, 'x'));
    file.commit();
  };
  EXPECT_THAT([&] { write_much(1'000'000); },
              ThrowsMessage<std::runtime_error>(HasSubstr("a.csv: cannot be written: File too large")));
  // Small enough to wait in the buffer until commit.
  EXPECT_THROW(
      {
        AtomicFile file(folder / "a.csv");
        for (int i = 0; i < 10'500; ++i) file.stream() << 'x';
        file.commit();
      },
      std::runtime_error);
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

}  // namespace
}  // namespace perch
