#include "import_folder.h"

#include <stdexcept>

#include "perch/camera/camera_model.h"
#include "perch/config/atomic_file.h"
#include "perch/flight/sensor_file.h"
#include "perch/flight/write_nav.h"
#include "perch/import/video_pictures.h"
#include "program.h"

namespace perch {

namespace fs = std::filesystem;

ImportFolder::ImportFolder(const fs::path& flight)
    // Without a slash at its end, which would put ".part" into the folder.
    : flight_(fs::absolute(flight / "").lexically_normal().parent_path()), part_(flight_.string() + ".part") {
  if (fs::exists(flight_)) throw UsageError("--output " + flight.string() + ": is there already");
  if (fs::exists(part_)) {
    const fs::path part = part_;
    part_.clear();
    throw UsageError(part.string() + ": is in the way, from an import that was killed or is still running");
  }
  fs::create_directories(cam0());
}

ImportFolder::~ImportFolder() {
  std::error_code ignored;
  if (!part_.empty()) fs::remove_all(part_, ignored);
}

void ImportFolder::link_video(const fs::path& video, const std::vector<int64_t>& times_ns, bool copy) const {
  link_file(video, cam0() / "data.mkv", copy);
  std::string csv = "#timestamp [ns],filename\n";
  for (const int64_t time : times_ns) csv += std::to_string(time) + ",data.mkv\n";
  write_whole_file(cam0() / "data.csv", csv);
}

void ImportFolder::link_pictures(const fs::path& flight, bool copy) const {
  const fs::path from = flight / "mav0" / "cam0";
  for (const char* table : {"data.csv", "sensor.yaml", "camera.cameramodel"}) {
    if (fs::exists(from / table)) fs::copy_file(from / table, cam0() / table);
  }
  if (!fs::is_directory(from / "data")) {
    link_file(from / "data.mkv", cam0() / "data.mkv", copy);
    return;
  }
  fs::create_directory(cam0() / "data");
  for (const auto& entry : fs::directory_iterator(from / "data")) {
    link_file(entry.path(), cam0() / "data" / entry.path().filename(), copy);
  }
}

void ImportFolder::write_camera(const fs::path& model) const {
  const fs::path file = cam0() / "camera.cameramodel";
  // mrcal's own as it is: it may hold more than the lens.
  if (model.extension() == ".cameramodel") {
    fs::copy_file(model, file, fs::copy_options::overwrite_existing);
  } else {
    write_whole_file(file, camera_model_text(read_camera_model(model)));
  }
}

void ImportFolder::write_nav(const NavTrack& nav, int64_t add_ns) const {
  fs::create_directories(part_ / "mav0" / "nav0");
  std::string csv = nav_header();
  for (NavSample sample : nav.samples) {
    sample.timestamp_ns += add_ns;
    append_nav(sample, csv);
  }
  write_whole_file(part_ / "mav0" / "nav0" / "data.csv", csv);
}

void ImportFolder::finish() {
  fs::rename(part_, flight_);
  part_.clear();
}

}  // namespace perch
