#include "batch_flight.h"

#include <tbb/parallel_pipeline.h>

#include <algorithm>
#include <memory>

#include "flight_aids.h"
#include "perch/analysis/output_files.h"
#include "perch/analysis/overlay.h"
#include "perch/analysis/pad_json.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/flight.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

// Pictures that are decoded ahead of the estimator: enough that it never waits, and bounded memory.
constexpr size_t kFramesAhead = 16;

CameraModel camera_of(const RunConfig& config, const Flight& flight) {
  if (!config.camera_model.empty()) return read_camera_model(config.camera_model);
  if (flight.camera) return *flight.camera;
  throw std::runtime_error(flight.folder.string() +
                           ": no camera model: expected camera.model in the configuration, " +
                           "or mav0/cam0/camera.cameramodel or sensor.yaml in the flight" +
                           (flight.problems.empty() ? "" : "; " + flight.problems.front()));
}

// body_from_base of the flight's own mount, where the configuration says none.
FrameChain chain_of(const RunConfig& config, const Flight& flight) {
  FrameChain chain = config.frames;
  if (!chain.body_from_base && flight.body_from_camera) {
    chain.body_from_base = *flight.body_from_camera * inverse(base_from_camera(chain, HeadAngles{}));
  }
  return chain;
}

// Decodes in parallel and estimates in order: a frame's result may depend on those before it.
void estimate_frames(const BatchFlight& job, ImageSource& source, Estimator& estimator,
                     FlightResult& result) {
  using FramePtr = std::shared_ptr<Frame>;
  FlightAids aids(result.flight, result.chain, job.config);
  tbb::parallel_pipeline(
      kFramesAhead,
      tbb::make_filter<void, FramePtr>(tbb::filter_mode::serial_in_order,
                                       [&](tbb::flow_control& flow) -> FramePtr {
                                         auto frame = std::make_shared<Frame>();
                                         if (!job.stop && source.advance(*frame)) return frame;
                                         flow.stop();
                                         return nullptr;
                                       }) &
          tbb::make_filter<FramePtr, FramePtr>(tbb::filter_mode::parallel,
                                               [&](FramePtr frame) {
                                                 source.read(*frame);
                                                 return frame;
                                               }) &
          tbb::make_filter<FramePtr, void>(tbb::filter_mode::serial_in_order, [&](const FramePtr& frame) {
            result.estimates.push_back(estimator.process(*frame, aids.at(frame->timestamp_ns)));
            result.frame_names.push_back(frame->name);
            job.frame_done();
          }));
  if (job.stop) throw Interrupted();
  result.problems = aids.problems();
}

void write_outputs(const fs::path& folder, const FlightResult& result, const FlightScore& score) {
  fs::create_directories(folder);
  write_estimates(folder / "estimates.csv", result.estimates);
  write_states(folder / "states.csv", result.estimates);
  write_pad_from_body(folder / "pad_from_body.tum", result.estimates);
  // Last: who finds a summary finds the rest.
  write_flight_files(folder, score);
}

// Reads the pictures that the report shows once more: keeping all until they are chosen would take the memory
// of a whole flight.
std::vector<ReportPicture> draw_pictures(const BatchFlight& job, const FlightResult& result,
                                         const FlightScore& score, const CameraModel& camera) {
  std::vector<ReportPicture> pictures;
  for (const ShownFrame& shown : frames_to_show(score)) pictures.push_back({shown, {}});
  const auto source = open_image_source("flight:" + job.folder.string(), job.config.channel);
  Frame frame;
  for (size_t i = 0; i < result.estimates.size() && source->advance(frame); ++i) {
    for (auto& picture : pictures) {
      if (picture.shown.frame != i) continue;
      source->read(frame);
      if (!frame.grey.empty()) {
        picture.jpeg = overlay_jpeg(frame.grey, job.config.target, &camera, result.estimates[i]);
      }
    }
  }
  std::erase_if(pictures, [](const ReportPicture& picture) { return picture.jpeg.empty(); });
  return pictures;
}

}  // namespace

ReportFlight run_flight(const BatchFlight& job) {
  FlightResult result;
  result.flight = read_flight(job.folder);
  result.chain = chain_of(job.config, result.flight);
  result.target = job.config.target.name;
  const CameraModel camera = camera_of(job.config, result.flight);
  RunConfig config = job.config;
  config.frames = result.chain;
  Estimator estimator(config, camera);
  const auto source = open_image_source("flight:" + job.folder.string(), job.config.channel);
  estimate_frames(job, *source, estimator, result);
  result.problems.insert(result.problems.end(), source->problems().begin(), source->problems().end());

  ReportFlight report{
      score_flight(result), {}, pad_json(job.config.target, inverse(result.chain.target_from_pad))};
  write_outputs(job.output, result, report.score);
  report.pictures = draw_pictures(job, result, report.score, camera);
  return report;
}

}  // namespace perch
