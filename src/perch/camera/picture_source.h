#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "perch/camera/image_source.h"

namespace perch {

// mav0/cam0 of a recorded flight: the rows of data.csv with the pictures of data/, or with the frames of
// data.mkv, the n-th of the n-th row. Rows whose time cannot be used are skipped and noted; a picture that
// cannot be read keeps its row. Throws std::runtime_error when there is no data.csv.
std::unique_ptr<ImageSource> open_flight_pictures(const std::filesystem::path& folder, Channel channel);

// The files that match, 2.png before 10.png. Names that are all numbers of 10 digits or more, and all
// different, are the times in ns; otherwise the n-th picture is taken at n / 30 s. Throws when nothing
// matches.
std::unique_ptr<ImageSource> open_pictures(const std::string& glob, Channel channel);

// a < b as people sort: runs of digits by their value.
bool natural_less(const std::string& a, const std::string& b);

}  // namespace perch
