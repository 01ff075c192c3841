#include "perch/simulation/flight_folder.h"

#include <cinttypes>
#include <cstdarg>
#include <cstdio>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "perch/flight/sensor_file.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

constexpr char kMark[] = "# Written by perch-simulate";

std::string format(const char* pattern, ...) __attribute__((format(printf, 1, 2)));
std::string format(const char* pattern, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, pattern);
  vsnprintf(text, sizeof text, pattern, arguments);
  va_end(arguments);
  return text;
}

void write(const fs::path& file, const std::string& text) {
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  stream.close();
  if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
}

bool is_ours(const fs::path& folder) {
  std::ifstream stream(folder / "simulation.yaml");
  std::string line;
  return std::getline(stream, line) && line == kMark;
}

std::string point_and_quaternion(const Rigid3& pose) {
  const Eigen::Vector3d& p = pose.translation;
  const Eigen::Quaterniond q = positive_w(pose.rotation);
  return format("%.17g,%.17g,%.17g,%.17g,%.17g,%.17g,%.17g", p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z());
}

std::string velocity(const Eigen::Vector3d& v) { return format("%.17g,%.17g,%.17g", v.x(), v.y(), v.z()); }

std::string pose_yaml(const Rigid3& pose) {
  const Eigen::Vector3d& p = pose.translation;
  const Eigen::Quaterniond q = positive_w(pose.rotation);
  return "{position: [" + list_of_numbers({p.x(), p.y(), p.z()}) + "], rotation: {quaternion_wxyz: [" +
         list_of_numbers({q.w(), q.x(), q.y(), q.z()}) + "]}}";
}

// What perch-batch needs to score this flight: everything as it really was.
std::string perch_yaml(const Simulation& simulation) {
  // A deck that moves is nowhere in the world for long: navigation has nothing to compare with then.
  const std::string pad = simulation.deck
                              ? "  # no world_from_pad: the pad moves, see mav0/pad0\n"
                              : "  world_from_pad: " + pose_yaml(simulation.world_from_pad) + "\n";
  return "# For perch-batch --config perch.yaml: the frames as they were simulated.\ntarget: "
         "target.yaml\nframes:\n"
         "  base_from_camera: identity\n  body_from_base: " +
         pose_yaml(simulation.body_from_camera) + "\n  target_from_pad: identity\n" + pad +
         format("  time_offset: %.17g\n", simulation.nav.time_offset);
}

std::string frame_name(const SimulatedFlight& flight, int64_t frame) {
  return format("%" PRId64 ".png", flight.timestamp_ns(frame));
}

}  // namespace

FlightFolder::FlightFolder(const fs::path& folder, bool force)
    // Without a slash at its end, which would put ".part" into the folder.
    : folder_(fs::absolute(folder / "").parent_path()), part_(folder_.string() + ".part") {
  if (fs::exists(folder_) && !(fs::is_directory(folder_) && fs::is_empty(folder_))) {
    if (!is_ours(folder_))
      throw std::runtime_error(folder_.string() + ": holds something else; not overwritten");
    if (!force) throw std::runtime_error(folder_.string() + ": holds a flight already; --force replaces it");
  }
  if (fs::exists(part_) && !is_ours(part_)) {
    throw std::runtime_error(part_.string() + ": is in the way and not ours");
  }
  fs::remove_all(part_);
  fs::create_directories(part_ / "mav0" / "cam0" / "data");
  fs::create_directories(part_ / "mav0" / "nav0");
  fs::create_directories(part_ / "mav0" / "state_groundtruth_estimate0");
  write(part_ / "simulation.yaml", std::string(kMark) + "\n");
}

FlightFolder::~FlightFolder() {
  std::error_code ignored;
  if (!part_.empty()) fs::remove_all(part_, ignored);
}

void FlightFolder::write_frame(const SimulatedFlight& flight, int64_t frame) const {
  const fs::path file = part_ / "mav0" / "cam0" / "data" / frame_name(flight, frame);
  // Noise does not compress: the fastest level costs 3 % of space.
  if (!cv::imwrite(file.string(), flight.picture(frame), {cv::IMWRITE_PNG_COMPRESSION, 1})) {
    throw std::runtime_error(file.string() + ": cannot be written");
  }
}

// How the vehicle and, on a deck, the pad really moved.
void FlightFolder::write_motions(const SimulatedFlight& flight) const {
  const std::string columns =
      "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z,v_x [m/s],v_y [m/s],v_z [m/s]";
  std::string body = columns + "\n", pad = columns + ",w_x [rad/s],w_y [rad/s],w_z [rad/s]\n";
  for (int64_t i = 0; i < flight.frames(); ++i) {
    const std::string time = format("%" PRId64 ",", flight.timestamp_ns(i));
    body += time + point_and_quaternion(flight.pad_from_body(i)) + "," +
            velocity(flight.body_velocity_in_pad(i)) + "\n";
    const PadTruth truth = flight.pad(i);
    pad += time + point_and_quaternion(truth.world_from_pad) + "," + velocity(truth.pad_velocity_in_world) +
           "," + velocity(truth.angular_velocity_in_pad) + "\n";
  }
  write(part_ / "mav0" / "truth_pad_from_body.csv", body);
  if (!flight.simulation().deck) return;
  fs::create_directories(part_ / "mav0" / "pad0");
  write(part_ / "mav0" / "pad0" / "data.csv", pad);
}

void FlightFolder::write_tables(const SimulatedFlight& flight,
                                const std::string& resolved_configuration) const {
  const Simulation& simulation = flight.simulation();
  const fs::path mav = part_ / "mav0";
  std::string frames = "#timestamp [ns],filename\n";
  std::string poses = "#timestamp [ns],t_x [m],t_y [m],t_z [m],q_w [],q_x [],q_y [],q_z []\n";
  std::string states =
      "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z [], "
      "v_RS_R_x [m s^-1], v_RS_R_y [m s^-1], v_RS_R_z [m s^-1], b_w_RS_S_x [rad s^-1], b_w_RS_S_y [rad "
      "s^-1], "
      "b_w_RS_S_z [rad s^-1], b_a_RS_S_x [m s^-2], b_a_RS_S_y [m s^-2], b_a_RS_S_z [m s^-2]\n";
  for (int64_t i = 0; i < flight.frames(); ++i) {
    const std::string time = format("%" PRId64 ",", flight.timestamp_ns(i));
    const VehicleTruth truth = flight.vehicle(i);
    frames += time + frame_name(flight, i) + "\n";
    poses += time + point_and_quaternion(flight.camera_from_target(i)) + "\n";
    states += time + point_and_quaternion(truth.world_from_body) + "," +
              velocity(truth.body_velocity_in_world) + ",0,0,0,0,0,0\n";
  }
  std::string nav = "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z,v_x [m/s],v_y [m/s],v_z [m/s]\n";
  for (const auto& report : flight.navigation()) {
    nav += format("%" PRId64 ",", report.timestamp_ns) + point_and_quaternion(report.world_from_body) + "," +
           velocity(report.body_velocity_in_world) + "\n";
  }
  write(mav / "cam0" / "data.csv", frames);
  write(mav / "cam0" / "truth_target_pose.csv", poses);
  write(mav / "state_groundtruth_estimate0" / "data.csv", states);
  write(mav / "nav0" / "data.csv", nav);
  write_motions(flight);
  write(mav / "cam0" / "sensor.yaml",
        sensor_yaml({simulation.camera, simulation.body_from_camera, simulation.rate_hz,
                     "# Simulated camera. Integer pixel coordinates are pixel centres.\n"}));
  if (!sensor_yaml_has_lens(simulation.camera)) {
    write(mav / "cam0" / "camera.cameramodel", camera_model_text(simulation.camera));
  }
  fs::copy_file(simulation.target_file, part_ / "target.yaml", fs::copy_options::overwrite_existing);
  write(part_ / "perch.yaml", perch_yaml(simulation));
  write(part_ / "simulation.yaml", std::string(kMark) + "\n" + resolved_configuration);
}

void FlightFolder::finish() {
  fs::remove_all(folder_);  // an empty folder, or a flight of ours that --force gave up
  fs::rename(part_, folder_);
  part_.clear();
}

}  // namespace perch
