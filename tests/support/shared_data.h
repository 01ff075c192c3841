#pragma once

#include <cstdlib>
#include <filesystem>

namespace perch {

// A file or folder of the flights that are measured against and too large for the repository:
// $PERCH_SHARED/WHAT, else ../shared/WHAT beside the sources. Ask exists() and GTEST_SKIP without it.
inline std::filesystem::path shared_data(const std::filesystem::path& what) {
  const char* folder = std::getenv("PERCH_SHARED");
  return (folder ? std::filesystem::path(folder) : std::filesystem::path(PERCH_SOURCE_DIR) / "../shared") /
         what;
}

}  // namespace perch
