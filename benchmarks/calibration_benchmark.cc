// perch_calibration_benchmark: perch-calibrate-camera as a whole, and its solve beside
// mrcal-calibrate-cameras (package mrcal; left out where it is not installed) on the same corners. See
// benchmarks/README.md.
//
//   perch_calibration_benchmark FOLDER                      100 rendered pictures of 1280x720, kept in FOLDER
//   perch_calibration_benchmark FOLDER BOARD SPACING LENS…  the pictures that are there, by each lens model

#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <opencv2/imgcodecs.hpp>

#include "calib/camera/calibration.h"
#include "calib/camera/coverage.h"
#include "calib/camera/find_boards.h"
#include "perch/geometry/so3.h"
#include "perch/simulation/picture.h"
#include "support/printed_boards.h"
#include "support/rng.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

constexpr char kBoard[] = "10x7";
constexpr double kSpacing = 0.03;  // m
constexpr int kPictures = 100;

// 75 degrees across, with the barrel of a usual lens.
CameraModel rendered_camera() {
  return CameraModel("LENSMODEL_OPENCV8",
                     {830, 831, 644, 357, -0.25, 0.08, 6e-4, -4e-4, -0.01, 0.02, 0.005, -0.002}, 1280, 720);
}

struct Seconds {
  double wall = 0, processor = 0;  // of the programs run, their threads together
};

template <typename Work>
Seconds seconds_of(const Work& work, int who) {
  const auto processor = [&] {
    rusage usage{};
    getrusage(who, &usage);
    return static_cast<double>(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * static_cast<double>(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
  };
  const double before = processor();
  const auto start = std::chrono::steady_clock::now();
  work();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          processor() - before};
}

void run(const std::string& command) {
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}

// Boards all over the picture, near and far, tilted up to 45 degrees; every seventh is cut by the picture's
// edge, as happens to whoever fills the corners.
void render_pictures(const fs::path& folder) {
  const BoardGrid grid = parse_board(kBoard, kSpacing).grid;
  const CameraModel camera = rendered_camera();
  const Renderer renderer(camera, printed_chessboard(grid));
  const auto places = static_cast<size_t>(grid.columns * grid.rows);
  TestRng rng;
  for (int k = 0; k < kPictures;) {
    const auto ray = camera.ray_from_pixel(
        {rng.uniform(0.03, 0.97) * camera.width(), rng.uniform(0.03, 0.97) * camera.height()});
    if (!ray) continue;
    const double tilt = rng.uniform(0, M_PI / 4), towards = rng.uniform(-M_PI, M_PI);
    Rigid3 pose;
    pose.rotation = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), *ray) *
                    so3_exp(tilt * Eigen::Vector3d(std::cos(towards), std::sin(towards), 0)) *
                    so3_exp({0, 0, rng.uniform(-0.3, 0.3)}) * Eigen::Quaterniond(0, 1, 0, 0);
    pose.translation = rng.uniform(0.35, 0.9) * *ray;
    size_t seen = 0;
    for (int row = 0; row < grid.rows; ++row) {
      for (int column = 0; column < grid.columns; ++column) {
        const Eigen::Vector2d p = point_of(grid, column, row);
        const auto pixel = camera.pixel_from_camera(pose * Eigen::Vector3d(p.x(), p.y(), 0));
        seen += pixel && (pixel->array() >= 4).all() && pixel->x() < camera.width() - 4 &&
                pixel->y() < camera.height() - 4;
      }
    }
    if (k % 7 == 6 ? seen == places || seen < places / 2 : seen < places) continue;
    char name[32];
    std::snprintf(name, sizeof name, "board%03d.png", k);
    const fs::path file = folder / name;
    if (!cv::imwrite(file.string(), Sensor().picture(renderer.radiance(pose), static_cast<uint64_t>(k++))))
      throw std::runtime_error(file.string() + ": cannot be written");
  }
}

// What mrcal-calibrate-cameras reads: its "level" is 0 for a corner and - for none.
void write_corners(const BoardViews& views, const fs::path& file) {
  std::ofstream stream(file);
  stream.precision(12);
  stream << "# filename x y level\n";
  for (const BoardView& view : views.views) {
    std::vector<std::string> lines(static_cast<size_t>(views.grid.columns * views.grid.rows), "- - -");
    for (const BoardCorner& corner : view.corners) {
      std::ostringstream line;
      line.precision(12);
      line << corner.pixel.x() << ' ' << corner.pixel.y() << " 0";
      lines[static_cast<size_t>(corner.row * views.grid.columns + corner.column)] = line.str();
    }
    for (const std::string& line : lines) stream << view.picture << ' ' << line << '\n';
  }
}

std::string root_mean_square(const CameraModel& one, const CameraModel& other, const BoardViews& views) {
  constexpr int kColumns = 24, kRows = 18;
  const auto covered = covered_places(views, kColumns, kRows);
  const ModelDifference difference =
      model_difference(one, other, kColumns, kRows, std::vector<double>(covered.begin(), covered.end()));
  double squares = 0, most = 0, count = 0;
  for (size_t i = 0; i < covered.size(); ++i) {
    if (!covered[i] || !std::isfinite(difference.length.values[i])) continue;
    squares += difference.length.values[i] * difference.length.values[i];
    most = std::max(most, difference.length.values[i]);
    ++count;
  }
  char text[60];
  std::snprintf(text, sizeof text, "%.2g px rms, %.2g px at most", std::sqrt(squares / count), most);
  return text;
}

void compare(BoardViews views, const fs::path& folder, const fs::path& glob, const std::string& lens) {
  // All corners count alike, as they do for it.
  for (BoardView& view : views.views) {
    for (BoardCorner& corner : view.corners) corner.sigma = 1;
  }
  CalibrationOptions options;
  options.lens_models = {lens};
  Candidate once;
  const Seconds one = seconds_of([&] { once = calibrate_once(views, lens, options); }, RUSAGE_SELF);
  const Seconds all = seconds_of([&] { calibrate_camera(views, options); }, RUSAGE_SELF);
  std::printf(
      "%s: one solve %.2f s, with halves, seeds and regularisation %.2f s; %.4f px, %d outliers, fx %.2f\n",
      lens.c_str(), one.wall, all.wall, once.fit.rms_px, once.fit.outliers, once.fit.intrinsics[0]);
  if (std::system("command -v mrcal-calibrate-cameras >/dev/null") != 0) return;
  const fs::path work = folder / "mrcal";
  fs::create_directories(work);
  write_corners(views, work / "corners.vnl");
  std::ostringstream command;
  command << "mrcal-calibrate-cameras --corners-cache " << work / "corners.vnl"
          << " --lensmodel " << lens << " --focal " << views.width << " --object-spacing "
          << views.grid.spacing << " --object-width-n " << views.grid.columns << " --object-height-n "
          << views.grid.rows << " --imagersize " << views.width << ' ' << views.height << " --outdir " << work
          << " '" << glob.string() << "' >" << work / "log"
          << " 2>&1";
  const Seconds mrcals = seconds_of([&] { run(command.str()); }, RUSAGE_CHILDREN);
  const CameraModel model = read_camera_model(work / "camera-0.cameramodel");
  std::printf("  mrcal-calibrate-cameras %.2f s; fx %.2f; apart %s\n", mrcals.wall, model.intrinsics()[0],
              root_mean_square(once.fit.model(), model, views).c_str());
  std::ifstream log(work / "log");
  for (std::string line; std::getline(log, line);) {
    if (line.starts_with("RMS") || line.starts_with("Noutliers")) std::printf("  %s\n", line.c_str());
  }
}

int benchmark(int argc, char** argv) {
  if (argc != 2 && argc < 5) {
    std::cerr << "perch_calibration_benchmark FOLDER [BOARD SPACING LENS...]\n";
    return 2;
  }
  const fs::path folder = fs::absolute(argv[1]);
  const bool rendered = argc == 2;
  const std::string board = rendered ? kBoard : argv[2];
  const double spacing = rendered ? kSpacing : std::stod(argv[3]);
  fs::create_directories(folder);
  if (rendered && !fs::exists(folder / "board099.png")) render_pictures(folder);
  std::string first, extension;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() == ".png" || entry.path().extension() == ".jpg")
      first = entry.path().stem().string(), extension = entry.path().extension().string();
  }
  const fs::path glob = folder / (first.substr(0, first.find_first_of("0123456789")) + "*" + extension);
  if (rendered) {
    const std::string program = std::string(PERCH_CALIBRATE_CAMERA) + " --board " + board + " --spacing " +
                                std::to_string(spacing) + " --nocache --lens LENSMODEL_OPENCV8 '" +
                                glob.string() + "' 2>" + (folder / "log").string();
    const Seconds detection = seconds_of([&] { run(program); }, RUSAGE_CHILDREN);
    const Seconds whole = seconds_of(
        [&] {
          run(program + " --output " + (folder / "cam.cameramodel").string() + " --report " +
              (folder / "cam.html").string());
        },
        RUSAGE_CHILDREN);
    std::printf("detection %.1f s (%.1f s of processors); with the solve and its report %.1f s (%.1f s)\n",
                detection.wall, detection.processor, whole.wall, whole.processor);
  }
  const BoardViews views = find_boards(parse_board(board, spacing), list_pictures({glob.string()}), {}).views;
  std::printf("%zu pictures with the board\n", views.views.size());
  if (rendered) {
    const CameraModel found = read_camera_model(folder / "cam.cameramodel");
    std::printf("off the truth %s\n", root_mean_square(rendered_camera(), found, views).c_str());
  }
  if (rendered) compare(views, folder, glob, "LENSMODEL_OPENCV8");
  for (int i = 4; i < argc; ++i) compare(views, folder, glob, argv[i]);
  return 0;
}

}  // namespace
}  // namespace perch

int main(int argc, char** argv) {
  try {
    return perch::benchmark(argc, argv);
  } catch (const std::exception& e) {
    std::cerr << "perch_calibration_benchmark: " << e.what() << '\n';
    return 1;
  }
}
