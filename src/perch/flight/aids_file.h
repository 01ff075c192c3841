#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "perch/estimator/estimator.h"

namespace perch {

// run/aids.csv of docs/FORMATS.md: exactly what a live run's estimator was given beside each picture, so that
// a replay gives its estimates again bit for bit. A frame is a row for each thing the autopilot said since
// the last frame, in the order it was given, and then the frame's own row, which makes it whole.

struct FrameAid {
  int64_t timestamp_ns = 0;  // the frame's
  Estimator::Aid aid;
};

std::string aids_header();
void append_aid(int64_t frame_timestamp_ns, const Estimator::Aid& aid, std::string& csv);

// In the file's order. Frames that are not whole are skipped and noted with file and line; std::runtime_error
// when there is no such file or its columns are others.
std::vector<FrameAid> read_aids(const std::filesystem::path& file, std::vector<std::string>& problems);

}  // namespace perch
