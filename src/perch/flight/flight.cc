#include "perch/flight/flight.h"

#include <Eigen/LU>
#include <algorithm>
#include <stdexcept>

#include "perch/config/section.h"
#include "perch/flight/read_nav.h"
#include "perch/geometry/so3.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

bool is_there(const fs::path& file) {
  std::error_code ignored;
  return fs::exists(file, ignored);
}

// Runs a step whose failure costs the flight no more than what the step reads.
template <typename Step>
void attempt(std::vector<std::string>& problems, Step step) {
  try {
    step();
  } catch (const std::exception& e) {
    // A sensor.yaml that is no YAML fails as camera and as mount.
    if (std::find(problems.begin(), problems.end(), e.what()) == problems.end())
      problems.emplace_back(e.what());
  }
}

// T_BS: 4 x 4, by rows, of digits that people rounded.
std::optional<Rigid3> read_body_from_camera(const fs::path& sensor) {
  Section file = Section::load(sensor);
  if (!file.has("T_BS")) return std::nullopt;
  std::vector<double> data;
  if (file.is_mapping_with("T_BS", "data")) {
    file.section("T_BS").read("data", data, 16);
  } else {
    file.read("T_BS", data, 16);
  }
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> matrix(data.data());
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double off = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off <= 1e-3))
    file.fail("T_BS", "a rotation, orthonormal to 0.001 (off by " + std::to_string(off) + ")");
  if (!(rotation.determinant() > 0)) file.fail("T_BS", "a rotation, not a mirror (determinant -1)");
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1)) file.fail("T_BS", "0 0 0 1 as the last row");
  return Rigid3{Eigen::Quaterniond(nearest_rotation(rotation)), matrix.topRightCorner<3, 1>()};
}

void read_camera(const fs::path& cam0, Flight& flight) {
  const fs::path model = cam0 / "camera.cameramodel", sensor = cam0 / "sensor.yaml";
  if (is_there(model)) attempt(flight.problems, [&] { flight.camera = read_camera_model(model); });
  if (!is_there(sensor)) {
    if (!is_there(model))
      flight.problems.push_back(cam0.string() + ": neither camera.cameramodel nor sensor.yaml");
    return;
  }
  if (!flight.camera) attempt(flight.problems, [&] { flight.camera = read_camera_model(sensor); });
  attempt(flight.problems, [&] { flight.body_from_camera = read_body_from_camera(sensor); });
}

}  // namespace

Flight read_flight(const fs::path& folder) {
  const fs::path mav0 = folder / "mav0";
  if (!is_there(mav0 / "cam0" / "data.csv")) {
    throw std::runtime_error(folder.string() + ": no flight: expected mav0/cam0/data.csv in it");
  }
  Flight flight;
  flight.folder = folder;
  // "flights/a/" and "." have names, too.
  const fs::path whole = fs::absolute(folder).lexically_normal();
  flight.name = (whole.has_filename() ? whole : whole.parent_path()).filename().string();
  read_camera(mav0 / "cam0", flight);

  const fs::path nav0 = mav0 / "nav0" / "data.csv", truth = mav0 / "state_groundtruth_estimate0" / "data.csv";
  // A live run appends its rows as it goes.
  const LastLine last_line = is_there(folder / "run") ? LastLine::kMustEnd : LastLine::kMayLackEnd;
  const bool has_nav = is_there(nav0), has_truth = is_there(truth);
  if (has_nav) attempt(flight.problems, [&] { flight.nav = read_nav(nav0, flight.problems, last_line); });
  if (has_truth) {
    attempt(flight.problems,
            [&] { (has_nav ? flight.truth : flight.nav) = read_nav(truth, flight.problems); });
  }
  flight.nav_is_truth = has_truth && !has_nav;
  const fs::path gimbal = mav0 / "gimbal0" / "data.csv";
  if (is_there(gimbal))
    attempt(flight.problems, [&] { flight.gimbal = read_gimbal(gimbal, flight.problems, last_line); });
  return flight;
}

}  // namespace perch
