#include "perch/analysis/overlay.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace perch {
namespace {

using Line = std::vector<Eigen::Vector2d>;

// Each colour is drawn on a wider black line: readable on white squares and on black.
const cv::Scalar kOutline(0, 159, 230);    // orange of the colour-blind safe palette of Okabe and Ito
const cv::Scalar kMeasured(233, 180, 86);  // its sky blue
const cv::Scalar kName(255, 255, 255);
const cv::Scalar kUnder(0, 0, 0);

// Bent lines of a fisheye over the whole picture stay within a tenth of a pixel of 32 chords an edge.
constexpr int kSamplesPerEdge = 32;
// Sub-pixel drawing of OpenCV: coordinates in 1/16 px.
constexpr int kShift = 4;

// The part of the picture that is shown, and how much larger. The map of pixel centres:
//   shown = (pixel - origin + 0.5) * scale - 0.5
struct View {
  cv::Rect crop;
  double scale = 1;

  cv::Point shown(const Eigen::Vector2d& pixel) const {
    const auto map = [this](double p, int origin) {
      return static_cast<int>(std::lround(((p - origin + 0.5) * scale - 0.5) * (1 << kShift)));
    };
    return {map(pixel.x(), crop.x), map(pixel.y(), crop.y)};
  }
};

// All of `lines` with a margin, in the picture; all of the picture where there are no lines.
cv::Rect crop_about(const std::vector<Line>& lines, const cv::Size& size, const OverlayOptions& options) {
  const cv::Rect picture({0, 0}, size);
  Eigen::AlignedBox2d box;
  for (const Line& line : lines) {
    for (const Eigen::Vector2d& pixel : line) box.extend(pixel);
  }
  const Eigen::AlignedBox2d all(Eigen::Vector2d(0, 0), Eigen::Vector2d(size.width, size.height));
  box = box.intersection(all);
  if (lines.empty() || box.isEmpty()) return picture;
  // A far target of 30 px is shown with its surroundings, at most four times as large as it was taken.
  const double least = options.width_px / 4.0;
  const Eigen::Vector2d half = (box.sizes() * (0.5 + options.margin)).cwiseMax(least / 2);
  const Eigen::Vector2d low = box.center() - half;
  const cv::Rect wanted(static_cast<int>(low.x()), static_cast<int>(low.y()), static_cast<int>(2 * half.x()),
                        static_cast<int>(2 * half.y()));
  return wanted & picture;
}

void draw_line(cv::Mat& shown, const View& view, const Line& line) {
  std::vector<cv::Point> all, points;
  for (const Eigen::Vector2d& pixel : line) all.push_back(view.shown(pixel));
  // Most edges are straight to a sixteenth of a pixel, and each piece of a line costs as much as a long one.
  const bool closed = all.size() > 1 && all.front() == all.back();
  if (closed) all.pop_back();
  cv::approxPolyDP(all, points, 1, closed);
  cv::polylines(shown, points, closed, kUnder, 4, cv::LINE_AA, kShift);
  cv::polylines(shown, points, closed, kOutline, 2, cv::LINE_AA, kShift);
}

void draw_measured(cv::Mat& shown, const View& view, const Correspondence& measured) {
  const cv::Point centre = view.shown(measured.pixel);
  cv::circle(shown, centre, 4 << kShift, kUnder, 2, cv::LINE_AA, kShift);
  cv::circle(shown, centre, 4 << kShift, kMeasured, 1, cv::LINE_AA, kShift);
}

// The names of features nearer to each other than a name is wide would be a smear: those are left out.
void draw_names(cv::Mat& shown, const View& view, const LandingTarget& target,
                const std::vector<Correspondence>& correspondences) {
  constexpr double kSize = 0.36;
  constexpr int kRoom = 20;  // px, a two-letter name at kSize
  std::vector<cv::Point> taken;
  for (const Correspondence& measured : correspondences) {
    if (measured.feature < 0 || static_cast<size_t>(measured.feature) >= target.features.size()) continue;
    const cv::Point fine = view.shown(measured.pixel);
    const cv::Point place((fine.x >> kShift) + 5, (fine.y >> kShift) - 5);
    const bool crowded = std::any_of(taken.begin(), taken.end(), [&](const cv::Point& other) {
      return std::abs(other.x - place.x) < kRoom && std::abs(other.y - place.y) < kRoom / 2;
    });
    if (crowded) continue;
    taken.push_back(place);
    const std::string& name = target.features[static_cast<size_t>(measured.feature)].name;
    cv::putText(shown, name, place, cv::FONT_HERSHEY_SIMPLEX, kSize, kUnder, 3, cv::LINE_AA);
    cv::putText(shown, name, place, cv::FONT_HERSHEY_SIMPLEX, kSize, kName, 1, cv::LINE_AA);
  }
}

}  // namespace

std::vector<Line> projected_outlines(const LandingTarget& target, const CameraModel& camera,
                                     const Rigid3& camera_from_target) {
  std::vector<Line> lines;
  for (const Patch& patch : target.patches) {
    Line line;
    const auto end_line = [&] {
      if (line.size() > 1) lines.push_back(line);
      line.clear();
    };
    for (size_t corner = 0; corner < 4; ++corner) {
      const Eigen::Vector2d from = patch.corners[corner], to = patch.corners[(corner + 1) % 4];
      // The last edge also takes its end, which closes the line.
      const int samples = corner == 3 ? kSamplesPerEdge + 1 : kSamplesPerEdge;
      for (int i = 0; i < samples; ++i) {
        const Eigen::Vector2d point = from + (to - from) * i / kSamplesPerEdge;
        const auto pixel =
            camera.pixel_from_camera(camera_from_target * Eigen::Vector3d(point.x(), point.y(), 0));
        // Far outside, distortion polynomials fold back into the picture: half a picture around it is
        // trusted.
        const bool near_picture = pixel && std::abs(pixel->x() / camera.width() - 0.5) < 1 &&
                                  std::abs(pixel->y() / camera.height() - 0.5) < 1;
        if (near_picture) {
          line.push_back(*pixel);
        } else {
          end_line();
        }
      }
    }
    end_line();
  }
  return lines;
}

cv::Mat draw_overlay(const cv::Mat& grey, const LandingTarget& target, const CameraModel* camera,
                     const Estimate& estimate, const OverlayOptions& options) {
  std::vector<Line> outlines;
  if (camera && estimate.status == EstimateStatus::kOk) {
    outlines = projected_outlines(target, *camera, estimate.camera_from_target.mean);
  }
  View view;
  view.crop = crop_about(outlines, grey.size(), options);
  const int width = std::min(options.width_px, grey.cols);
  view.scale = static_cast<double>(width) / view.crop.width;
  const cv::Size size(width, std::max(1, static_cast<int>(std::lround(view.crop.height * view.scale))));

  cv::Mat scaled, shown;
  cv::resize(grey(view.crop), scaled, size, 0, 0, view.scale < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
  cv::cvtColor(scaled, shown, cv::COLOR_GRAY2BGR);
  for (const Line& line : outlines) draw_line(shown, view, line);
  for (const Correspondence& measured : estimate.correspondences) draw_measured(shown, view, measured);
  draw_names(shown, view, target, estimate.correspondences);
  return shown;
}

std::vector<unsigned char> overlay_jpeg(const cv::Mat& grey, const LandingTarget& target,
                                        const CameraModel* camera, const Estimate& estimate,
                                        const OverlayOptions& options) {
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", draw_overlay(grey, target, camera, estimate, options), bytes,
               {cv::IMWRITE_JPEG_QUALITY, options.jpeg_quality});
  return bytes;
}

}  // namespace perch
