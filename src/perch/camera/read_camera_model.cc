#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "perch/camera/camera_model.h"
#include "perch/config/section.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

// Every reader here takes foreign files: their other keys are none of our business, so nobody calls done().

const char* const kNoFisheye = "; mrcal has no fisheye model, calibrate with mrcal's splined model instead";

// Takes what OpenCV and Python write for YAML, line by line as it was, so that messages find their place:
// `%YAML:1.0` is no YAML directive, and b'...' (mrcal's base 85) may hold any bracket or comma.
std::string as_yaml(std::string text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  if (text.starts_with("%YAML:")) text[0] = '#';
  std::string yaml;
  char quote = 0;
  bool comment = false, bytes = false;
  for (size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (comment) {
      comment = c != '\n';
    } else if (quote) {
      if (c == quote) quote = 0;
      if (bytes && quote) continue;
    } else if (c == '#') {
      comment = true;
    } else if (c == '\'' || c == '"') {
      quote = c;
      bytes = !yaml.empty() && yaml.back() == 'b';
      if (bytes) yaml.pop_back();
    }
    yaml += c;
  }
  return yaml;
}

std::string read_text(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::error_code ignored;
  if (!stream || fs::is_directory(file, ignored)) {
    throw ConfigError(file.string() + ": expected a camera model, found no file that can be read");
  }
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// The first of the names that the file has; the first of all when it has none, for the message.
std::string_view spelling(const Section& section, std::initializer_list<std::string_view> names) {
  const auto it = std::find_if(names.begin(), names.end(), [&](auto name) { return section.has(name); });
  return it == names.end() ? *names.begin() : *it;
}

void require(const Section& section, std::string_view key, const std::string& expected) {
  if (!section.has(key)) section.fail(key, expected);
}

int read_size(Section& section, std::initializer_list<std::string_view> names) {
  const std::string_view key = spelling(section, names);
  require(section, key, "a number of pixels");
  int size = 0;
  section.read(key, size, Range{1, 1e6});
  return size;
}

std::array<int, 2> read_sizes(Section& section, std::string_view key) {
  require(section, key, "[width, height]");
  std::vector<double> size;
  section.read(key, size, 2, Range{1, 1e6});
  if (size[0] != std::floor(size[0]) || size[1] != std::floor(size[1]))
    section.fail(key, "whole numbers of pixels");
  return {static_cast<int>(size[0]), static_cast<int>(size[1])};
}

void check_focal(const Section& section, std::string_view key, double fx, double fy) {
  if (fx > 0 && fy > 0) return;
  std::ostringstream expected;
  expected << "focal lengths above 0, not " << fx << " and " << fy;
  section.fail(key, expected.str());
}

// Ours among mrcal's keys (docs/FORMATS.md): the upper triangle by rows.
CameraModel with_covariance(const CameraModel& model, Section& file) {
  constexpr std::string_view kKey = "intrinsics_covariance";
  if (!file.has(kKey)) return model;
  const auto n = static_cast<Eigen::Index>(model.intrinsics().size());
  std::vector<double> triangle;
  file.read(kKey, triangle, static_cast<size_t>(n * (n + 1) / 2));
  Eigen::MatrixXd covariance(n, n);
  size_t next = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = i; k < n; ++k) covariance(i, k) = covariance(k, i) = triangle[next++];
  }
  try {
    return model.with_intrinsics_covariance(covariance);
  } catch (const std::invalid_argument& e) {
    file.fail(kKey, std::string("what can be one (") + e.what() + ")");
  }
}

CameraModel read_mrcal(Section file) {
  std::string lens;
  std::vector<double> intrinsics;
  file.read("lensmodel", lens);
  require(file, "intrinsics", "a list of numbers");
  file.read("intrinsics", intrinsics);
  const auto [width, height] = read_sizes(file, "imagersize");
  if (intrinsics.size() >= 2) check_focal(file, "intrinsics", intrinsics[0], intrinsics[1]);
  try {
    return with_covariance(CameraModel(lens, intrinsics, width, height), file);
  } catch (const std::invalid_argument& e) {
    file.fail("intrinsics", std::string("what fits the lens (") + e.what() + ")");
  }
}

// OpenCV's and ROS's matrices: {rows, cols, data: [...]}, in a ROS message (K, D) the list alone.
std::vector<double> read_matrix(Section& file, std::string_view key, size_t size) {
  require(file, key, "a matrix");
  std::vector<double> data;
  if (!file.is_mapping_with(key, "data")) {
    file.read(key, data, size);
    return data;
  }
  Section matrix = file.section(key);
  matrix.read("data", data, size);
  int rows = 1, cols = static_cast<int>(data.size());
  matrix.read("rows", rows);
  matrix.read("cols", cols);
  // No distortion is written as 0 x 0 or as 1 x 0.
  if (static_cast<double>(rows) * cols != static_cast<double>(data.size())) {
    matrix.fail("data", std::to_string(rows) + " x " + std::to_string(cols) + " numbers");
  }
  return data;
}

// The lens with that many coefficients in OpenCV's order; the 14th and 13th, a tilted sensor's, must be 0.
std::string opencv_lens_name(const Section& file, std::string_view key, std::vector<double>& coefficients,
                             std::initializer_list<size_t> counts) {
  if (coefficients.size() == 14 && coefficients[12] == 0 && coefficients[13] == 0) coefficients.resize(12);
  if (std::find(counts.begin(), counts.end(), coefficients.size()) == counts.end()) {
    std::string expected;
    for (const size_t count : counts) expected += (expected.empty() ? "" : " or ") + std::to_string(count);
    file.fail(key, expected + " coefficients, not " + std::to_string(coefficients.size()));
  }
  return coefficients.empty() ? "LENSMODEL_PINHOLE"
                              : "LENSMODEL_OPENCV" + std::to_string(coefficients.size());
}

CameraModel read_ros_or_opencv(Section file) {
  const int width = read_size(file, {"image_width", "width"});
  const int height = read_size(file, {"image_height", "height"});
  const std::string_view matrix_key = spelling(file, {"camera_matrix", "K", "k"});
  const auto k = read_matrix(file, matrix_key, 9);
  check_focal(file, matrix_key, k[0], k[4]);
  // Calibrators print the skew as rounding left it.
  if (std::abs(k[1]) > 1e-6 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1) {
    file.fail(matrix_key, "[fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  }
  const std::string_view key = spelling(file, {"distortion_coefficients", "D", "d"});
  auto coefficients = read_matrix(file, key, 0);
  std::string name;
  if (file.has("distortion_model")) {
    std::string model;
    file.read("distortion_model", model);
    if (model == "plumb_bob") {
      name = opencv_lens_name(file, key, coefficients, {0, 4, 5});
    } else if (model == "rational_polynomial") {
      name = opencv_lens_name(file, key, coefficients, {0, 8, 12});
    } else if ((model.empty() || model == "none") && coefficients.empty()) {
      name = "LENSMODEL_PINHOLE";
    } else {
      file.fail("distortion_model", std::string("plumb_bob or rational_polynomial") + kNoFisheye);
    }
  } else {
    bool fisheye = false;
    if (int flag = 0; file.has("fisheye_model")) {
      file.read("fisheye_model", flag);
      fisheye = flag != 0;
    }
    if (fisheye) file.fail("fisheye_model", std::string("0") + kNoFisheye);
    name = opencv_lens_name(file, key, coefficients, {0, 4, 5, 8, 12});
  }
  std::vector<double> intrinsics{k[0], k[4], k[2], k[5]};
  intrinsics.insert(intrinsics.end(), coefficients.begin(), coefficients.end());
  return CameraModel(name, intrinsics, width, height);
}

CameraModel read_asl(Section file) {
  std::string camera = "pinhole", model = "none";
  file.read("camera_model", camera);
  if (camera != "pinhole") file.fail("camera_model", "pinhole");
  file.read("distortion_model", model);
  std::vector<double> intrinsics, coefficients;
  file.read("intrinsics", intrinsics, 4);
  check_focal(file, "intrinsics", intrinsics[0], intrinsics[1]);
  const auto [width, height] = read_sizes(file, "resolution");
  file.read("distortion_coefficients", coefficients);
  if (model == "radial-tangential" || model == "radtan") {
    require(file, "distortion_coefficients", "[k1, k2, p1, p2]");
    opencv_lens_name(file, "distortion_coefficients", coefficients, {4});
  } else if (model != "none") {
    file.fail("distortion_model", std::string("radial-tangential or none") + kNoFisheye);
  } else if (std::any_of(coefficients.begin(), coefficients.end(), [](double c) { return c != 0; })) {
    file.fail("distortion_coefficients", "none or zeros with distortion_model none");
  } else {
    coefficients.clear();
  }
  intrinsics.insert(intrinsics.end(), coefficients.begin(), coefficients.end());
  return CameraModel(coefficients.empty() ? "LENSMODEL_PINHOLE" : "LENSMODEL_OPENCV4", intrinsics, width,
                     height);
}

}  // namespace

CameraModel read_camera_model(const fs::path& path) {
  Section file = Section::parse(as_yaml(read_text(path)), path);
  if (file.has("lensmodel")) return read_mrcal(file);
  if (file.has("camera_matrix") || file.has("K") || file.has("k")) return read_ros_or_opencv(file);
  if (file.has("intrinsics")) return read_asl(file);
  file.fail(
      "expected a camera model, found neither lensmodel (mrcal) nor camera_matrix (ROS, OpenCV) nor "
      "intrinsics (ASL)");
}

}  // namespace perch
