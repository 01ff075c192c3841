#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "perch/camera/csv.h"
#include "perch/estimator/estimate.h"

namespace perch {

// estimates.csv, states.csv and pad_from_body.tum of docs/FORMATS.md. Numbers are the shortest that read back
// as the same double, so a file read and written again is the same file. Quaternions have w >= 0.

// Header and rows with their line ends, for those who write as frames come (into an AtomicFile).
std::string estimates_header();
std::string states_header();
void append_estimate(const Estimate& estimate, std::string& csv);
void append_state(const VehicleState& state, std::string& csv);
// Time in s with 9 decimals, exact; no header.
void append_tum(int64_t timestamp_ns, const Rigid3& pad_from_body, std::string& tum);

// Whole files, by AtomicFile; std::runtime_error when they cannot be written.
void write_estimates(const std::filesystem::path& file, std::span<const Estimate> estimates);
void write_states(const std::filesystem::path& file,
                  std::span<const Estimate> estimates);  // those with a state
void write_pad_from_body(const std::filesystem::path& file,
                         std::span<const Estimate> estimates);  // those with one

// What a row holds; the rest of an Estimate keeps its defaults. Rows that cannot be read are skipped and
// noted with file and line; std::runtime_error when there is no such file or its columns are others.
// A live run's, which ends anywhere: with LastLine::kMustEnd.
std::vector<Estimate> read_estimates(const std::filesystem::path& file, std::vector<std::string>& problems,
                                     LastLine last_line = LastLine::kMayLackEnd);
// The covariance has the file's standard deviations on its diagonal and zeros beside it.
std::vector<VehicleState> read_states(const std::filesystem::path& file, std::vector<std::string>& problems,
                                      LastLine last_line = LastLine::kMayLackEnd);

}  // namespace perch
