#pragma once

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "perch/flight/recording_disk.h"

namespace perch {

// Rows for a file: taken in from any thread without waiting for the disk, written by one thread later.
//
//   add --> waiting (bounded) --> write: file, or kept for the next write when the disk refuses it
class AppendLog {
 public:
  // `header` begins the file, which is made by create() or the first write that has a row.
  AppendLog(RecordingDisk& disk, std::filesystem::path file, std::string header, size_t most_waiting_bytes);

  // False: too much is waiting for a disk that does not keep up, and the row is lost.
  bool add(std::string_view row);

  // These belong to the writing thread. Both throw std::runtime_error when the disk refuses.
  void create();
  void write();

 private:
  RecordingDisk& disk_;
  const std::filesystem::path path_;
  const std::string header_;
  const size_t most_waiting_bytes_;
  std::mutex mutex_;     // of waiting_
  std::string waiting_;  // both strings keep their capacity: a steady run allocates nothing
  std::string writing_;
  std::unique_ptr<RecordingFile> file_;
};

}  // namespace perch
