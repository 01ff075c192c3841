#pragma once

#include <cstdlib>
#include <filesystem>

namespace perch {

// The development flights, which are not part of the repository: $PERCH_SHARED, else `shared` beside it.
// Empty when they are not there; then a test says so: if (shared_flight("x").empty()) GTEST_SKIP() << ...
inline std::filesystem::path shared_flight(const std::filesystem::path& name) {
  const char* folder = std::getenv("PERCH_SHARED");
  const std::filesystem::path shared =
      folder ? folder : std::filesystem::path(PERCH_SOURCE_DIR).parent_path() / "shared";
  const std::filesystem::path flight = shared / "flights" / name;
  return std::filesystem::is_directory(flight) ? flight : std::filesystem::path{};
}

}  // namespace perch
