#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace perch {

// Puts `source` where `target` is to be: a hard link, or a symbolic one where the file system has no hard
// link to it, or with `copy` a file of its own. Throws std::runtime_error naming the file and the cause.
void link_file(const std::filesystem::path& source, const std::filesystem::path& target, bool copy);

// When each frame of a video was taken, ns: a row of a CSV file each, in the column "timestamp [ns]" (or
// [us], [ms], [s]; without a header the first column, ns). Throws std::runtime_error naming file and line of
// a row without a time, since rows after it would be of no known frame.
std::vector<int64_t> read_frame_times(const std::filesystem::path& csv);

// When the video itself says each frame is shown, from 0. Decodes it. Throws std::runtime_error.
std::vector<int64_t> own_frame_times(const std::filesystem::path& video);

// Throws std::runtime_error when the video has not that many frames: which frame a row is of is then unknown.
// Decodes it only where its header says another number, which may be wrong.
void check_frame_count(const std::filesystem::path& video, const std::filesystem::path& csv, size_t rows);

}  // namespace perch
