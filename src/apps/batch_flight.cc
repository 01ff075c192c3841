#include "batch_flight.h"

#include <tbb/parallel_pipeline.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>

#include "flight_aids.h"
#include "perch/analysis/error_table.h"
#include "perch/analysis/frame_look.h"
#include "perch/analysis/output_files.h"
#include "perch/analysis/overlay.h"
#include "perch/analysis/pad_json.h"
#include "perch/estimator/estimator.h"
#include "perch/flight/estimates_file.h"
#include "perch/flight/flight.h"
#include "perch/flight/head_angles.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

// Pictures that are decoded ahead of the estimator, a thread: enough that it never waits, and bounded memory.
constexpr size_t kFramesAhead = 4;

CameraModel camera_of(const RunConfig& config, const Flight& flight) {
  if (!config.camera_model.empty()) return read_camera_model(config.camera_model);
  if (config.zoom_table) return config.zoom_table->entries().front().model;
  if (flight.camera) return *flight.camera;
  throw std::runtime_error(flight.folder.string() +
                           ": no camera model: expected camera.model in the configuration, " +
                           "or mav0/cam0/camera.cameramodel or sensor.yaml in the flight" +
                           (flight.problems.empty() ? "" : "; " + flight.problems.front()));
}

// Of a zoom camera, the model at a frame's zoom.
std::optional<CameraModel> zoomed_model(const RunConfig& config, const Flight& flight, int64_t timestamp_ns) {
  if (!config.zoom_table) return std::nullopt;
  const double latency = config.frames.pan_tilt ? config.frames.pan_tilt->latency : 0;
  const auto head = gimbal_at(flight.gimbal, timestamp_ns + std::llround(1e9 * latency));
  if (!head || !head->zoom) return std::nullopt;
  return config.zoom_table->at(*head->zoom);
}

// body_from_base of the flight's own mount, where the configuration says none.
FrameChain chain_of(const RunConfig& config, const Flight& flight) {
  FrameChain chain = config.frames;
  if (!chain.body_from_base && flight.body_from_camera) {
    chain.body_from_base = *flight.body_from_camera * inverse(base_from_camera(chain, HeadAngles{}));
  }
  return chain;
}

// The tables that grow by a row a frame, so that a long flight's need not be kept.
class FrameTables {
 public:
  explicit FrameTables(const fs::path& folder)
      : estimates_(folder / "estimates.csv"),
        states_(folder / "states.csv"),
        poses_(folder / "pad_from_body.tum") {
    estimates_.text = estimates_header();
    states_.text = states_header();
  }
  void add(const Estimate& estimate) {
    append_estimate(estimate, estimates_.text);
    if (estimate.state) append_state(*estimate.state, states_.text);
    if (estimate.pad_from_body) append_tum(estimate.timestamp_ns, estimate.pad_from_body->mean, poses_.text);
    for (Table* table : {&estimates_, &states_, &poses_}) {
      if (table->text.size() > kChunk) table->flush();
    }
  }
  void close() {
    for (Table* table : {&estimates_, &states_, &poses_}) table->close();
  }

 private:
  static constexpr size_t kChunk = 1 << 16;  // bytes
  struct Table {
    explicit Table(fs::path path) : file(std::move(path)), stream(file, std::ios::binary) {}
    void flush() {
      stream << text;
      text.clear();
    }
    void close() {
      flush();
      stream.close();
      if (!stream) throw std::runtime_error(file.string() + ": cannot be written");
    }
    fs::path file;
    std::ofstream stream;
    std::string text;
  };
  Table estimates_, states_, poses_;
};

void forget_times(Estimate& estimate) {
  estimate.detect_us = estimate.pose_us = estimate.total_us = 0;
  estimate.stages.clear();
}

// Decodes in parallel and estimates in order: a frame's result depends on those before it, by the filter and
// by what its picture deforms, to the last bit; so nothing but the order gives what one pass gives. Decoding
// a picture takes some twenty times as long as estimating it.
void estimate_frames(const BatchFlight& job, ImageSource& source, const CameraModel& camera,
                     Estimator& estimator, FrameTables& tables, FlightResult& result) {
  struct Picture {
    Frame frame;
    GreyHistogram grey;
  };
  using PicturePtr = std::shared_ptr<Picture>;
  FlightAids aids(result.flight, result.chain, job.config);
  const auto frames = static_cast<double>(std::max<int64_t>(1, source.size()));
  const TargetViewer viewer(job.config.target);
  const auto estimate_frame = [&](const PicturePtr& picture) {
    const Frame& frame = picture->frame;
    Estimate estimate = estimator.process(frame, aids.at(frame.timestamp_ns));
    if (!job.times) forget_times(estimate);
    tables.add(estimate);
    result.greys.push_back(picture->grey);
    result.looks.emplace_back();
    if (estimate.status == EstimateStatus::kOk) {
      const auto zoomed = zoomed_model(job.config, result.flight, frame.timestamp_ns);
      result.looks.back() =
          viewer.look(frame.grey, zoomed ? *zoomed : camera, estimate.camera_from_target.mean);
    }
    estimate.residuals = {};  // most of an estimate, and nobody asks for them any more
    result.estimates.push_back(std::move(estimate));
    result.frame_names.push_back(frame.name);
    job.done(1.0 / frames);
  };
  const auto threads = static_cast<size_t>(tbb::this_task_arena::max_concurrency());
  // A thread that waits takes frames of this flight only: one that began another flight meanwhile would keep
  // this one waiting, and more and more flights' pictures in memory.
  tbb::this_task_arena::isolate([&] {
    tbb::parallel_pipeline(
        kFramesAhead * threads,
        tbb::make_filter<void, PicturePtr>(tbb::filter_mode::serial_in_order,
                                           [&](tbb::flow_control& flow) -> PicturePtr {
                                             auto picture = std::make_shared<Picture>();
                                             if (!job.stop && source.advance(picture->frame)) return picture;
                                             flow.stop();
                                             return nullptr;
                                           }) &
            tbb::make_filter<PicturePtr, PicturePtr>(tbb::filter_mode::parallel,
                                                     [&](PicturePtr picture) {
                                                       source.read(picture->frame);
                                                       picture->grey = grey_histogram(picture->frame.grey);
                                                       return picture;
                                                     }) &
            tbb::make_filter<PicturePtr, void>(tbb::filter_mode::serial_in_order, estimate_frame));
  });
  if (job.stop) throw Interrupted();
  result.problems = aids.problems();
}

// Reads the pictures that the report shows once more: keeping all until they are chosen would take the memory
// of a whole flight.
std::vector<ReportPicture> draw_pictures(const BatchFlight& job, const FlightResult& result,
                                         const FlightScore& score, const CameraModel& camera) {
  std::vector<ReportPicture> pictures;
  for (const ShownFrame& shown : frames_to_show(score)) pictures.push_back({shown, {}});
  const auto source = open_image_source("flight:" + job.folder.string(), job.config.channel);
  size_t end = 0;  // after the last of them: going on would decode the rest of a video for nothing
  for (const auto& picture : pictures) end = std::max(end, picture.shown.frame + 1);
  Frame frame;
  for (size_t i = 0; i < end && source->advance(frame); ++i) {
    for (auto& picture : pictures) {
      if (picture.shown.frame != i) continue;
      source->read(frame);
      if (!frame.grey.empty()) {
        const auto zoomed = zoomed_model(job.config, result.flight, frame.timestamp_ns);
        picture.jpeg =
            overlay_jpeg(frame.grey, job.config.target, zoomed ? &*zoomed : &camera, result.estimates[i]);
      }
    }
  }
  std::erase_if(pictures, [](const ReportPicture& picture) { return picture.jpeg.empty(); });
  return pictures;
}

}  // namespace

std::string run_flight(const BatchFlight& job) {
  FlightResult result;
  result.flight = read_flight(job.folder);
  result.chain = chain_of(job.config, result.flight);
  result.target = job.config.target.name;
  const CameraModel camera = camera_of(job.config, result.flight);
  result.camera =
      std::to_string(camera.width()) + 'x' + std::to_string(camera.height()) + ' ' + camera.lens();
  RunConfig config = job.config;
  config.frames = result.chain;
  Estimator estimator(config, camera);
  const auto source = open_image_source("flight:" + job.folder.string(), job.config.channel);
  FrameTables tables(job.output);
  estimate_frames(job, *source, camera, estimator, tables, result);
  tables.close();
  result.problems.insert(result.problems.end(), source->problems().begin(), source->problems().end());

  ReportFlight report{
      score_flight(result), {}, pad_json(job.config.target, inverse(result.chain.target_from_pad))};
  report.pictures = draw_pictures(job, result, report.score, camera);
  write_flight_files(job.output, report, job.resolved);
  return error_table(report.score);
}

}  // namespace perch
