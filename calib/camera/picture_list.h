#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace perch {

// What a user names: pictures to be taken as they are, and sequences of which a few frames are chosen.
struct PictureList {
  std::vector<std::filesystem::path> files;  // each once
  std::vector<std::string> sequences;        // "video:FILE", "flight:FOLDER"; as open_image_source has them
};

// Each argument is a picture's file, a glob ("board/*.jpg"), a folder of pictures, a video, a recorded flight
// (a folder with mav0), or one of these as video:, flight: or images:. Throws std::runtime_error naming what
// is not there.
PictureList list_pictures(const std::vector<std::string>& arguments);

}  // namespace perch
