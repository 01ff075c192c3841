#pragma once

#include <filesystem>
#include <memory>
#include <string_view>

namespace perch {

// A file that only grows.
class RecordingFile {
 public:
  virtual ~RecordingFile() = default;
  // All of it or nothing: what a full disk took of it is cut off again. It is with the kernel when this
  // returns, so that the end of the process, however sudden, loses none of it. Throws std::runtime_error
  // naming the file and the cause.
  virtual void append(std::string_view bytes) = 0;
};

// What a recorder writes to. Used by several threads.
class RecordingDisk {
 public:
  virtual ~RecordingDisk() = default;
  // An empty file, in place of one of that name. Throws std::runtime_error naming the file and the cause.
  virtual std::unique_ptr<RecordingFile> create(const std::filesystem::path& file) = 0;
  // What is left for files of ours, in bytes; empty space nobody knows of counts as plenty.
  virtual double bytes_left(const std::filesystem::path& folder) = 0;
  // Waits until all that was written is on the disk under this folder, so that a loss of power leaves it.
  // Throws std::runtime_error.
  virtual void sync(const std::filesystem::path& folder) = 0;
};

std::shared_ptr<RecordingDisk> real_disk();

}  // namespace perch
