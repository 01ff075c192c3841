#pragma once

#include <filesystem>
#include <fstream>
#include <string_view>

namespace perch {

// A file that is either whole or not there: written as FILE.part, which commit() renames to FILE. Dropped
// without commit (an exception, a signal that ends main cleanly) it leaves what was there before.
//
//   AtomicFile report(out / "report.html");
//   report.stream() << "<html>" << ...;
//   report.commit();
//
// What cannot be written (no such folder, disk full) is a std::runtime_error that names the file and the
// cause.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path file);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void append(std::string_view text);
  // For what prefers a stream; its errors are found by commit().
  std::ostream& stream() { return stream_; }
  // Nothing can be written afterwards.
  void commit();

 private:
  [[noreturn]] void fail() const;

  std::filesystem::path file_, part_;
  std::ofstream stream_;
};

// A file with just this text.
void write_whole_file(const std::filesystem::path& file, std::string_view text);

}  // namespace perch
