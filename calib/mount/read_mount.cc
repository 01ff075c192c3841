#include "calib/mount/read_mount.h"

#include <tbb/parallel_pipeline.h>

#include <memory>

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

std::optional<Sighting> sighting_of(const Estimate& estimate, const LandingTarget& target, size_t frame) {
  const bool ok = estimate.status == EstimateStatus::kOk;
  if (!ok && estimate.status != EstimateStatus::kAmbiguous) return std::nullopt;
  Sighting sight;
  sight.timestamp_ns = estimate.timestamp_ns;
  sight.frame = frame;
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
  Estimator estimator(config, camera);
  const auto source = open_image_source("flight:" + folder.string(), config.channel);
  using FramePtr = std::shared_ptr<Frame>;
  bool stop = false;
  tbb::parallel_pipeline(
      16, tbb::make_filter<void, FramePtr>(tbb::filter_mode::serial_in_order,
                                           [&](tbb::flow_control& flow) -> FramePtr {
                                             auto frame = std::make_shared<Frame>();
                                             if (!stop && source->advance(*frame)) return frame;
                                             flow.stop();
                                             return nullptr;
                                           }) &
              tbb::make_filter<FramePtr, FramePtr>(tbb::filter_mode::parallel,
                                                   [&](FramePtr frame) {
                                                     source->read(*frame);
                                                     return frame;
                                                   }) &
              tbb::make_filter<FramePtr, void>(tbb::filter_mode::serial_in_order, [&](const FramePtr& frame) {
                Estimator::Aid aid;
                aid.angles = head_angles_at(flight.gimbal, frame->timestamp_ns);
                const Estimate estimate = estimator.process(*frame, aid);
                if (auto sight = sighting_of(estimate, config.target, result.pictures))
                  result.flight.sightings.push_back(std::move(*sight));
                stop = !go_on(++result.pictures);
              }));
  std::sort(result.flight.sightings.begin(), result.flight.sightings.end(),
            [](const Sighting& a, const Sighting& b) { return a.timestamp_ns < b.timestamp_ns; });
  result.problems = flight.problems;
  result.problems.insert(result.problems.end(), source->problems().begin(), source->problems().end());
  return result;
}

}  // namespace perch
