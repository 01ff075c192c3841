#include "calib/camera/picture_list.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>

#include "perch/camera/picture_source.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

bool has_extension(const fs::path& file, std::initializer_list<std::string_view> extensions) {
  std::string own = file.extension().string();
  std::transform(own.begin(), own.end(), own.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(extensions.begin(), extensions.end(), own) != extensions.end();
}

bool is_picture(const fs::path& file) {
  return has_extension(file, {".png", ".jpg", ".jpeg", ".pgm", ".ppm", ".bmp", ".tif", ".tiff"});
}

bool is_video(const fs::path& file) {
  return has_extension(file, {".mkv", ".mp4", ".avi", ".mov", ".webm", ".m4v", ".ts"});
}

void add_glob(const std::string& pattern, std::vector<fs::path>& files) {
  const auto source = open_pictures(pattern, Channel::kGrey);
  Frame frame;
  while (source->advance(frame)) files.push_back(frame.file);
}

void add_folder(const fs::path& folder, PictureList& list) {
  std::vector<fs::path> pictures;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_picture(entry.path())) pictures.push_back(entry.path());
  }
  if (pictures.empty())
    throw std::runtime_error(folder.string() + ": neither a recorded flight nor pictures in it");
  std::sort(pictures.begin(), pictures.end(),
            [](const fs::path& a, const fs::path& b) { return natural_less(a.string(), b.string()); });
  list.files.insert(list.files.end(), pictures.begin(), pictures.end());
}

void add(const std::string& argument, PictureList& list) {
  std::error_code ignored;
  if (argument.starts_with("video:") || argument.starts_with("flight:")) {
    list.sequences.push_back(argument);
  } else if (argument.starts_with("images:")) {
    add_glob(argument.substr(7), list.files);
  } else if (fs::is_directory(argument, ignored)) {
    if (fs::exists(fs::path(argument) / "mav0", ignored)) {
      list.sequences.push_back("flight:" + argument);
    } else {
      add_folder(argument, list);
    }
  } else if (fs::exists(argument, ignored)) {
    if (is_video(argument)) {
      list.sequences.push_back("video:" + argument);
    } else {
      list.files.emplace_back(argument);
    }
  } else if (argument.find_first_of("*?[") != std::string::npos) {
    add_glob(argument, list.files);
  } else {
    throw std::runtime_error(argument + ": no such file");
  }
}

}  // namespace

PictureList list_pictures(const std::vector<std::string>& arguments) {
  PictureList list;
  for (const std::string& argument : arguments) add(argument, list);
  std::vector<fs::path> once;
  for (const fs::path& file : list.files) {
    if (std::find(once.begin(), once.end(), file) == once.end()) once.push_back(file);
  }
  list.files = once;
  return list;
}

}  // namespace perch
