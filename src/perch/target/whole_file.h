#pragma once

#include <filesystem>
#include <fstream>
#include <string_view>

namespace perch {

// A file that is written aside and takes its name only when it is whole: an interrupted run leaves the old
// one, or none. Without `keep()` nothing stays.
class WholeFile {
 public:
  explicit WholeFile(std::filesystem::path file);  // throws std::runtime_error when it cannot be written
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  void write(std::string_view bytes);  // errors show in keep()
  void keep();                         // throws std::runtime_error when not all was written

 private:
  std::filesystem::path file_;
  std::filesystem::path aside_;
  std::ofstream stream_;
};

}  // namespace perch
