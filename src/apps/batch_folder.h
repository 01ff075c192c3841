#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "batch_key.h"

namespace perch {

// OUT, the folder that a batch writes to. Several processes may write to it at once, on several machines, and
// any may be killed at any moment: a flight is written into a folder of its process's own,
//
//   OUT/.part/HOST-XXXXXX/FLIGHTNAME,
//
// and its files are renamed into OUT/FLIGHTNAME when all are whole; last comes complete.json, which holds the
// key and the files' sizes. So a flight is finished where complete.json says so and the sizes are true; files
// that a power cut shortened are not (one that it filled with nothing, at its full size, is not noticed). All
// processes hold a shared lock on OUT/.lock: who finds nobody else there removes what the killed ones of its
// own machine left. What is of all flights (batch_season.h) one process writes at a time.
class BatchFolder {
 public:
  // Creates it where it is not there. Throws std::runtime_error naming what cannot be written.
  explicit BatchFolder(std::filesystem::path folder);
  ~BatchFolder();
  BatchFolder(const BatchFolder&) = delete;
  BatchFolder& operator=(const BatchFolder&) = delete;

  const std::filesystem::path& path() const { return folder_; }
  // OUT/FLIGHTNAME.
  std::filesystem::path of(const std::string& flight) const { return folder_ / flight; }
  bool is_finished(const std::string& flight, const BatchKey& key) const;

  // Puts a file into OUT that all its flights share, where it is not there yet as it should be.
  void share(const std::string& name, std::string_view content) const;

  // An empty folder for a flight's files, of this process alone. From any thread, as is the next.
  std::filesystem::path begin(const std::string& flight) const;
  // Makes what was written there the flight's result.
  void finish(const std::string& flight, const BatchKey& key) const;
  // The flight has no result (any more).
  void forget(const std::string& flight) const;

 private:
  void remove_leftovers() const;

  std::filesystem::path folder_, parts_, own_;
  int lock_ = -1;
};

}  // namespace perch
