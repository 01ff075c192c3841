#include "calib/mount/read_mount.h"

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <memory>
#include <utility>

#include "perch/camera/image_source.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/head_angles.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

// Axes whose sigma is 0 are not known.
Eigen::Vector3d read_sigmas(Section& section, std::string_view key, double scale) {
  std::vector<double> sigma(3, 0.0);
  section.read(key, sigma, 3, kNotNegative);
  Eigen::Vector3d result;
  for (int i = 0; i < 3; ++i) {
    const double s = sigma[static_cast<size_t>(i)];
    result[i] = s > 0 ? scale * s : INFINITY;
  }
  return result;
}

std::optional<PosePrior> read_pose_prior(Section& priors, const char* key) {
  if (!priors.has(key)) return std::nullopt;
  Section section = priors.section(key);
  PosePrior prior;
  prior.position_sigma = read_sigmas(section, "position_sigma", 1);
  prior.rotation_sigma = read_sigmas(section, "rotation_sigma_deg", kRadFromDeg);
  section.read("mean", prior.mean);
  section.done();
  if (!prior.is_given()) section.fail("expected position_sigma or rotation_sigma_deg with a number above 0");
  return prior;
}

void read_sigma(Section& section, std::string_view key, double scale, double* value) {
  if (!section.has(key)) return;
  section.read(key, *value, kNotNegative);
  *value *= scale;
}

CameraModel camera_of(const RunConfig& config, const Flight& flight) {
  if (config.zoom_table) {
    throw std::runtime_error(
        "camera.zoom_table: expected camera.model for a mount calibration, that of the one zoom it was flown "
        "at");
  }
  if (!config.camera_model.empty()) return read_camera_model(config.camera_model);
  if (flight.camera) return *flight.camera;
  throw std::runtime_error(flight.folder.string() +
                           ": no camera model: expected camera.model in the configuration, "
                           "or mav0/cam0/camera.cameramodel or sensor.yaml in the flight");
}

// Each picture helps the detector with the next, so that pictures are taken in order; but a flight of minutes
// in pieces of this many, side by side. Ten seconds: the search of a whole picture at each beginning is
// nothing, and the pieces are the same on every machine, so that the result is.
constexpr size_t kStretch = 300;

struct Stretch {
  std::vector<Frame> frames;
  std::vector<std::optional<Sighting>> sightings;
};

std::optional<Sighting> sighting_of(const Estimate& estimate, const LandingTarget& target) {
  const bool ok = estimate.status == EstimateStatus::kOk;
  if (!ok && estimate.status != EstimateStatus::kAmbiguous) return std::nullopt;
  Sighting sight;
  sight.timestamp_ns = estimate.timestamp_ns;
  if (ok) sight.camera_from_target = estimate.camera_from_target;
  for (const Correspondence& c : estimate.correspondences) {
    const Eigen::Vector2d& p = target.features[static_cast<size_t>(c.feature)].point;
    sight.observations.push_back({Eigen::Vector3d(p.x(), p.y(), 0), c.pixel, c.sigma_px});
  }
  if (sight.observations.size() < 4) return std::nullopt;
  return sight;
}

}  // namespace

MountOptions read_mount_options(Section section) {
  MountOptions options;
  Section priors = section.section("prior");
  options.priors.body_from_base = read_pose_prior(priors, "body_from_base");
  options.priors.world_from_pad = read_pose_prior(priors, "world_from_pad");
  if (priors.has("time_offset")) {
    Section offset = priors.section("time_offset");
    double value = 0, sigma = 0.005;
    offset.read("value", value);
    offset.read("sigma", sigma, kPositive);
    offset.done();
    options.priors.time_offset = value;
    options.priors.time_offset_sigma = sigma;
  }
  priors.done();
  Section navigation = section.section("navigation");
  read_sigma(navigation, "position_sigma", 1, &options.noise.position);
  read_sigma(navigation, "rotation_sigma_deg", kRadFromDeg, &options.noise.rotation);
  read_sigma(navigation, "position_drift", 1, &options.noise.position_drift);
  read_sigma(navigation, "rotation_drift_deg", kRadFromDeg, &options.noise.rotation_drift);
  read_sigma(navigation, "drift_time", 1, &options.noise.drift_time);
  navigation.done();
  section.read("offset_reach", options.offset_reach, Range{0, 10});
  Section limits = section.section("limits");
  double rotation_deg = kDegFromRad * options.largest_rotation_sigma;
  limits.read("rotation_deg", rotation_deg, kPositive);
  options.largest_rotation_sigma = kRadFromDeg * rotation_deg;
  limits.read("lever_arm", options.largest_position_sigma, kPositive);
  limits.read("time_offset", options.largest_offset_sigma, kPositive);
  limits.read("pad", options.largest_pad_sigma, kPositive);
  limits.done();
  section.done();
  return options;
}

ReadFlight read_mount_flight(const RunConfig& config, const std::filesystem::path& folder,
                             const std::function<bool(size_t)>& go_on) {
  const Flight flight = read_flight(folder);
  ReadFlight result;
  result.body_from_camera = flight.body_from_camera;
  const CameraModel camera = camera_of(config, flight);
  result.flight = {flight.name, camera, {}, flight.nav, flight.gimbal};
  // Positions alone tell nothing of how the camera sits.
  std::erase_if(result.flight.nav.samples, [](const NavSample& s) { return !s.knows_attitude(); });
  const auto source = open_image_source("flight:" + folder.string(), config.channel);
  std::atomic<bool> stop = false;
  using StretchPtr = std::shared_ptr<Stretch>;
  tbb::parallel_pipeline(
      // A video's pictures are decoded in the first filter: 2 GB of them at a time.
      std::clamp<size_t>((size_t{2} << 30) / (kStretch * static_cast<size_t>(camera.width()) *
                                              static_cast<size_t>(camera.height())),
                         1, 2 * static_cast<size_t>(tbb::this_task_arena::max_concurrency())),
      tbb::make_filter<void, StretchPtr>(tbb::filter_mode::serial_in_order,
                                         [&](tbb::flow_control& flow) -> StretchPtr {
                                           auto stretch = std::make_shared<Stretch>();
                                           Frame frame;
                                           while (!stop && stretch->frames.size() < kStretch &&
                                                  source->advance(frame))
                                             stretch->frames.push_back(std::exchange(frame, {}));
                                           if (!stretch->frames.empty()) return stretch;
                                           flow.stop();
                                           return nullptr;
                                         }) &
          tbb::make_filter<StretchPtr, StretchPtr>(
              tbb::filter_mode::parallel,
              [&](StretchPtr stretch) {
                Estimator estimator(config, camera);
                for (Frame& frame : stretch->frames) {
                  if (stop) break;
                  source->read(frame);
                  Estimator::Aid aid;
                  aid.angles = head_angles_at(flight.gimbal, frame.timestamp_ns);
                  stretch->sightings.push_back(sighting_of(estimator.process(frame, aid), config.target));
                  frame.grey.release();
                }
                return stretch;
              }) &
          tbb::make_filter<StretchPtr, void>(tbb::filter_mode::serial_in_order,
                                             [&](const StretchPtr& stretch) {
                                               for (auto& sight : stretch->sightings) {
                                                 if (sight) {
                                                   sight->frame = result.pictures;
                                                   result.flight.sightings.push_back(std::move(*sight));
                                                 }
                                                 if (!go_on(++result.pictures)) stop = true;
                                               }
                                             }));
  std::sort(result.flight.sightings.begin(), result.flight.sightings.end(),
            [](const Sighting& a, const Sighting& b) { return a.timestamp_ns < b.timestamp_ns; });
  result.problems = flight.problems;
  result.problems.insert(result.problems.end(), source->problems().begin(), source->problems().end());
  return result;
}

}  // namespace perch
