#pragma once

#include <filesystem>
#include <span>
#include <string>

namespace perch {

// What the results of a flight depend on, each as a SHA-256 in hexadecimal digits: two runs with equal keys
// give equal results.
struct BatchKey {
  std::string program;        // of the executable: a version's number stays the same while one works on it
  std::string configuration;  // of what the configuration comes to, and of the files that it names
  std::string flight;         // of the names, sizes and times of the flight's files
  bool operator==(const BatchKey&) const = default;
};

std::string program_digest();
// `files` that cannot be read count as empty: who needs them says so.
std::string configuration_digest(const std::string& resolved, std::span<const std::filesystem::path> files);
// Of the flight's mav0 and of what a live run left for its replay. Pictures are not read for it: whoever
// changes one changes its time or its size. A folder that cannot be listed counts as empty.
std::string flight_digest(const std::filesystem::path& flight);

}  // namespace perch
