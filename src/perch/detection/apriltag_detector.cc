#include "perch/detection/apriltag_detector.h"

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

#include "perch/detection/stopwatch.h"
#include "perch/detection/tag_border.h"
#include "perch/target/tag_family.h"

namespace perch {
namespace {

using DetectorHandle = std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)>;
using DetectionsHandle = std::unique_ptr<zarray_t, void (*)(zarray_t*)>;

// libapriltag asserts below it.
constexpr int kMaxSide = 32767;

bool is_decimation(double factor) {
  // What image_u8_decimate can do; it truncates everything else.
  return factor == 1 || factor == 1.5 || factor == 2 || factor == 3 || factor == 4;
}

void check(const AprilTagOptions& options) {
  const auto refuse = [](const std::string& what) {
    throw std::invalid_argument("AprilTagOptions: " + what);
  };
  if (!is_decimation(options.quad_decimate)) refuse("quad_decimate must be 1, 1.5, 2, 3 or 4");
  if (!(options.quad_sigma >= 0 && options.quad_sigma <= 10)) refuse("quad_sigma must be within 0 and 10");
  if (options.threads < 1 || options.threads > 64) refuse("threads must be within 1 and 64");
  if (options.max_hamming < 0 || options.max_hamming > 2) refuse("max_hamming must be within 0 and 2");
  if (!(options.min_decision_margin >= 0)) refuse("min_decision_margin must not be negative");
}

// read_target checks all of this too, with file and line; boards also come from elsewhere.
TagFamily make_family(const AprilTagBoard& board) {
  const std::string border = board.family + ": a border of " + std::to_string(board.border) + " modules";
  if (board.border < 1) throw std::invalid_argument(border);
  TagFamily family = make_tag_family(board.family, board.border);
  if (!family) throw std::invalid_argument(board.family + ": no family of libapriltag");
  if (board.border > 1 && !has_black_border(*family)) {
    throw std::invalid_argument(border + ", which has data on both sides of it");
  }
  return family;
}

// The index of each id's tag on the board, -1 where the board has no such id.
std::vector<int> tags_by_id(const AprilTagBoard& board, const apriltag_family_t& family) {
  std::vector<int> tag_of_id(family.ncodes, -1);
  for (size_t i = 0; i < board.tags.size(); ++i) {
    const int id = board.tags[i].id;
    const std::string name = board.family + " " + std::to_string(id);
    if (id < 0 || id >= static_cast<int>(family.ncodes)) throw std::invalid_argument(name + ": no such tag");
    int& tag = tag_of_id[static_cast<size_t>(id)];
    if (tag >= 0) throw std::invalid_argument(name + ": twice on the board");
    tag = static_cast<int>(i);
  }
  return tag_of_id;
}

DetectorHandle make_detector(const AprilTagOptions& options, apriltag_family_t* family) {
  DetectorHandle detector(apriltag_detector_create(), apriltag_detector_destroy);
  detector->quad_decimate = static_cast<float>(options.quad_decimate);
  detector->quad_sigma = static_cast<float>(options.quad_sigma);
  detector->refine_edges = options.refine_edges;
  detector->nthreads = options.threads;
  apriltag_detector_add_family_bits(detector.get(), family, options.max_hamming);
  return detector;
}

// Refined, the corners of a photographed AprilGrid scatter by 0.3 px a coordinate about the grid
// (real_mocap); painted ones by 0.04 px: print, lens and the camera's sharpening cost more than noise.
// Without refinement come the steps of the picture that was searched, measured as a quarter of one.
double corner_sigma_px(const AprilTagOptions& options) {
  constexpr double kEdgePx = 0.3, kSearchSteps = 0.25;
  return options.refine_edges ? kEdgePx : std::hypot(kEdgePx, kSearchSteps * options.quad_decimate);
}

//   1 --- 0    A feature's corner k of a tag, y up as printed; libapriltag's p[] begins at the lower left and
//   |     |    goes round in the same sense.
//   2 --- 3
// libapriltag's (0.5, 0.5) is the centre of the first pixel, ours is (0, 0).
Eigen::Vector2d corner_pixel(const apriltag_detection_t& tag, int k) {
  const double* p = tag.p[(k + 2) % 4];
  return {p[0] - 0.5, p[1] - 0.5};
}

}  // namespace

struct AprilTagDetector::Library {
  Library(const AprilTagBoard& board, const AprilTagOptions& opts)
      : options((check(opts), opts)),
        family(make_family(board)),
        detector(make_detector(options, family.get())),
        tag_of_id(tags_by_id(board, *family)),
        sightings(board.tags.size()) {}

  DetectionsHandle run(const cv::Mat& grey);
  const cv::Mat& safe_picture(const cv::Mat& grey);
  bool trusted(const apriltag_detection_t& tag, const cv::Mat& grey) const;

  struct Sighting {
    int count = 0;
    std::array<Eigen::Vector2d, 4> corners;
  };

  AprilTagOptions options;
  TagFamily family;  // outlives the detector, which gives back its decoding table
  DetectorHandle detector;
  std::vector<int> tag_of_id;
  std::vector<Sighting> sightings;  // of each tag of the board, in this picture
  cv::Mat copy;
};

// The picture itself or, where libapriltag 3.3 must not have that, a copy:
// - it blurs in place when it does not decimate;
// - its table of clusters has 0.4 / 2048 entries per pixel and thread, and it writes into the first one even
//   when that makes none; its threshold needs a tile of 4 x 4 pixels. Repeating the last row and column until
//   there is room adds no edges.
const cv::Mat& AprilTagDetector::Library::safe_picture(const cv::Mat& grey) {
  const bool blurs_in_place = options.quad_sigma > 0 && options.quad_decimate == 1;
  const double min_pixels = 5120.0 * (options.threads + 1) * options.quad_decimate * options.quad_decimate;
  const bool has_room =
      static_cast<double>(grey.rows) * grey.cols >= min_pixels && std::min(grey.rows, grey.cols) >= 32;
  if (has_room && !blurs_in_place) return grey;
  const int side = has_room ? 0 : static_cast<int>(std::ceil(std::sqrt(min_pixels))) + 1;
  cv::copyMakeBorder(grey, copy, 0, std::max(0, side - grey.rows), 0, std::max(0, side - grey.cols),
                     cv::BORDER_REPLICATE);
  return copy;
}

DetectionsHandle AprilTagDetector::Library::run(const cv::Mat& grey) {
  const cv::Mat& picture = safe_picture(grey);
  image_u8_t image{picture.cols, picture.rows, static_cast<int32_t>(picture.step[0]), picture.data};
  return {apriltag_detector_detect(detector.get(), &image), apriltag_detections_destroy};
}

bool AprilTagDetector::Library::trusted(const apriltag_detection_t& tag, const cv::Mat& grey) const {
  if (tag.decision_margin < options.min_decision_margin)
    return false;  // max_hamming is in the decoding table
  // In real_mocap every tag with all corners within 1 px of the grid has 0.9 or more; of the 18 with a corner
  // more than 2 px off, 15 have less.
  constexpr double kMinBorderAgreement = 0.9;
  Eigen::Matrix3d H = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(tag.H->data);
  H.topRows<2>() -= 0.5 * H.row(2).replicate<2, 1>();  // see corner_pixel
  // An edge without any gradient along it leaves libapriltag with 0 / 0, which is nowhere in the picture.
  return border_agreement(grey, H, family->width_at_border, has_black_border(*family)) >= kMinBorderAgreement;
}

AprilTagDetector::AprilTagDetector(const AprilTagBoard& board, const AprilTagOptions& options)
    : library_(std::make_unique<Library>(board, options)) {}

AprilTagDetector::~AprilTagDetector() = default;

const Detection& AprilTagDetector::detect(const cv::Mat& grey, const std::optional<Prediction>&) {
  Library& library = *library_;
  detection_.correspondences.clear();
  detection_.stages.clear();
  Stopwatch stopwatch(detection_.stages);
  for (auto& sighting : library.sightings) sighting.count = 0;

  if (!grey.empty() && grey.type() == CV_8UC1 && std::max(grey.rows, grey.cols) <= kMaxSide) {
    const DetectionsHandle found = library.run(grey);
    for (int i = 0; i < zarray_size(found.get()); ++i) {
      apriltag_detection_t* tag = nullptr;
      zarray_get(found.get(), i, &tag);
      const int index = library.tag_of_id[static_cast<size_t>(tag->id)];
      if (index < 0 || !library.trusted(*tag, grey)) continue;
      Library::Sighting& sighting = library.sightings[static_cast<size_t>(index)];
      ++sighting.count;
      for (int k = 0; k < 4; ++k) sighting.corners[static_cast<size_t>(k)] = corner_pixel(*tag, k);
    }
  }

  const double sigma_px = corner_sigma_px(library.options);
  for (size_t i = 0; i < library.sightings.size(); ++i) {
    const Library::Sighting& sighting = library.sightings[i];
    if (sighting.count != 1) continue;
    for (size_t k = 0; k < 4; ++k) {
      detection_.correspondences.push_back({static_cast<int>(4 * i + k), sighting.corners[k], sigma_px});
    }
  }
  detection_.status =
      detection_.correspondences.empty() ? DetectionStatus::kNoTarget : DetectionStatus::kFound;
  stopwatch.lap("apriltag");
  return detection_;
}

AprilTagOptions read_apriltag_options(Section apriltag) {
  AprilTagOptions options;
  apriltag.read("quad_decimate", options.quad_decimate, Range{1, 4});
  if (!is_decimation(options.quad_decimate)) apriltag.fail("quad_decimate", "1, 1.5, 2, 3 or 4");
  apriltag.read("quad_sigma", options.quad_sigma, Range{0, 10});
  apriltag.read("refine_edges", options.refine_edges);
  apriltag.read("threads", options.threads, Range{1, 64});
  apriltag.read("max_hamming", options.max_hamming, Range{0, 2});
  apriltag.read("min_decision_margin", options.min_decision_margin, Range{0, 255});
  apriltag.done();
  return options;
}

}  // namespace perch
