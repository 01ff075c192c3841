#include "perch/detection/edge_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <optional>

namespace perch {
namespace {

constexpr double kSmallestBlur = 0.45, kBlurRatio = 1.12;
constexpr int kBlurs = 18;  // up to 3.1 px
constexpr double kReaches[] = {1.6, 2.2, 3, 4, 5.2, 7};

double gauss(double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI); }
double gauss_integral(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Sums over lines, from which level, contrast and offset follow.
struct Sums {
  double n = 0, t = 0, g = 0, tt = 0, tg = 0, gg = 0;  // of the templates' products
  cv::v_int32x4 i, it, ig, ii;                         // of the pixels' with them
  double shift = 0;  // from the templates' places to the expected, sum over lines
  double part = 0;   // of the piece, sum over lines
  int lines = 0;

  Sums() : i(cv::v_setzero_s32()), it(i), ig(i), ii(i) {}

  void add(const uint8_t* pixels, const StepTemplates::Template& a, double off) {
    for (int half = 0; half < StepTemplates::kPixels; half += 8) {
      const cv::v_int16x8 grey = cv::v_reinterpret_as_s16(cv::v_load_expand(pixels + half));
      const cv::v_int16x8 inside = cv::v_load(a.inside + half);
      const cv::v_int16x8 seen = grey & inside;
      i += cv::v_dotprod(seen, cv::v_setall_s16(1));
      it += cv::v_dotprod(grey, cv::v_load(a.step + half));
      ig += cv::v_dotprod(grey, cv::v_load(a.slope + half));
      ii += cv::v_dotprod(seen, seen);
    }
    n += a.n, t += a.t, g += a.g, tt += a.tt, tg += a.tg, gg += a.gg;
    shift += off;
    ++lines;
  }
};

struct Fitted {
  double offset = 0, sigma = 0, contrast = 0;  // along the line, px; grey levels
  double level = 0;                            // half way up the step, grey levels
  double part = 0.5;                           // of the piece, where its lines are in the mean
};

std::optional<Fitted> solve(const Sums& s) {
  if (s.lines == 0) return std::nullopt;
  Eigen::Matrix3d A;
  A << s.n, s.t, s.g, s.t, s.tt, s.tg, s.g, s.tg, s.gg;
  const Eigen::Vector3d b(cv::v_reduce_sum(s.i), cv::v_reduce_sum(s.it) / double{StepTemplates::kOne},
                          cv::v_reduce_sum(s.ig) / double{StepTemplates::kOne});
  const Eigen::Matrix3d inverse = A.inverse();
  const Eigen::Vector3d x = inverse * b;  // level, contrast, -contrast * offset
  const double freedom = s.n - 3;
  if (!x.allFinite() || !(freedom > 0)) return std::nullopt;
  // Rounding to whole grey levels is a twelfth at least, however small the residuals of a few.
  const double residual = std::max(0.0, cv::v_reduce_sum(s.ii) - b.dot(x));
  const double variance = (residual + 4 * 1.0) / (freedom + 4) + 1.0 / 12;
  Fitted fitted;
  fitted.level = x(0);
  fitted.contrast = x(1);
  fitted.part = s.part / s.lines;
  fitted.offset = -x(2) / x(1) - s.shift / s.lines;
  fitted.sigma = std::sqrt(variance * inverse(2, 2)) / std::abs(x(1));
  return fitted;
}

// One piece's lines about where it is expected, moved by `shift` px along the lines.
std::optional<Fitted> fit_lines(const cv::Mat& grey, const CrossingLines& lines, double shift, int step,
                                const StepTemplates& templates) {
  Sums sums;
  const int count = lines.rows() ? grey.rows : grey.cols, width = lines.rows() ? grey.cols : grey.rows;
  uint8_t column[StepTemplates::kPixels];
  for (int at = std::max(lines.first(), 0); at <= std::min(lines.last(), count - 1); at += step) {
    const double crossing = lines.crossing(at) + shift;
    const int middle = static_cast<int>(std::floor(crossing + 0.5));
    const int begin = middle - StepTemplates::kPixels / 2;
    if (begin < 0 || begin + StepTemplates::kPixels > width) continue;
    sums.part += lines.part(at);
    double phase = crossing - middle;
    const double wanted = phase;
    const auto& a = templates.at(&phase);
    if (lines.rows()) {
      sums.add(grey.ptr<uint8_t>(at) + begin, a, wanted - phase);
    } else {
      const uint8_t* pixel = grey.ptr<uint8_t>(begin) + at;
      for (uint8_t& p : column) {
        p = *pixel;
        pixel += grey.step[0];
      }
      sums.add(column, a, wanted - phase);
    }
  }
  return solve(sums);
}

}  // namespace

StepTemplates::StepTemplates(double sigma, double reach) : templates_(kPhases + 1) {
  for (int k = 0; k <= kPhases; ++k) {
    Template& a = templates_[static_cast<size_t>(k)];
    a = {};
    const double phase = static_cast<double>(k) / kPhases - 0.5;
    for (int i = 0; i < kPixels; ++i) {
      const double x = i - kPixels / 2 - phase;
      if (std::abs(x) > reach) continue;
      const double step = gauss_integral(x / sigma) - 0.5, slope = gauss(x / sigma) / sigma;
      a.inside[i] = -1;
      a.step[i] = static_cast<int16_t>(std::lround(kOne * step));
      a.slope[i] = static_cast<int16_t>(std::lround(kOne * slope));
      a.n += 1;
      a.t += static_cast<float>(step);
      a.g += static_cast<float>(slope);
      a.tt += static_cast<float>(step * step);
      a.tg += static_cast<float>(step * slope);
      a.gg += static_cast<float>(slope * slope);
    }
  }
}

const StepTemplates::Template& StepTemplates::at(double* phase) const {
  const int k = std::clamp(static_cast<int>((*phase + 0.5) * kPhases + 0.5), 0, kPhases);
  *phase = static_cast<double>(k) / kPhases - 0.5;
  return templates_[static_cast<size_t>(k)];
}

StepTemplateTable::StepTemplateTable() {
  double sigma = kSmallestBlur;
  for (int i = 0; i < kBlurs; ++i, sigma *= kBlurRatio) {
    for (const double reach : kReaches) templates_.emplace_back(sigma, reach);
  }
}

const StepTemplates& StepTemplateTable::of(double sigma, double reach) const {
  const double steps = std::log(std::max(sigma, kSmallestBlur) / kSmallestBlur) / std::log(kBlurRatio);
  const int blur = std::clamp(static_cast<int>(std::lround(steps)), 0, kBlurs - 1);
  int r = 0;
  for (int k = 1; k < static_cast<int>(std::size(kReaches)); ++k) {
    if (reach >= kReaches[k]) r = k;
  }
  return templates_[static_cast<size_t>(blur) * std::size(kReaches) + static_cast<size_t>(r)];
}

void fit_edges(const cv::Mat& grey, std::span<const EdgePiece> pieces, const ImageFrame& frame,
               const StepTemplateTable& templates, const FitOptions& options, double contrast,
               std::vector<EdgeOffset>& offsets, std::vector<int>& pieces_measured) {
  offsets.clear();
  pieces_measured.clear();
  for (size_t i = 0; i < pieces.size(); ++i) {
    const EdgePiece& piece = pieces[i];
    const CrossingLines untrimmed(piece, 0);
    const double cosine = std::abs(untrimmed.along_normal());
    const double sine = std::sqrt(1 - cosine * cosine);
    // Up to where the next edge's blur begins.
    const double room = std::min(piece.white_room, piece.black_room) - 2 * options.blur;
    const double reach = std::min(room / cosine, 7.0);
    const double trim = 2 * options.blur + sine * std::clamp(reach, 1.6, 7.0) * 0.5;
    if (reach < kReaches[0]) continue;
    const CrossingLines lines(piece, trim);
    const int count = lines.last() - lines.first() + 1;
    if (count < 1) continue;
    // An edge has about 8 pieces when long.
    const int step = std::max(1, count * 4 / std::max(1, options.lines_per_edge));
    const StepTemplates& table = templates.of(options.blur / cosine, reach);
    double shift = 0;
    std::optional<Fitted> fitted;
    for (int round = 0; round < 3; ++round) {
      fitted = fit_lines(grey, lines, shift, step, table);
      if (!fitted || !(fitted->contrast * lines.along_normal() > contrast * cosine) ||
          std::abs(fitted->offset) > 2) {
        fitted.reset();
        break;
      }
      shift += fitted->offset;
      if (std::abs(fitted->offset) < 0.15) break;
    }
    if (!fitted || std::abs(fitted->offset) > 0.5 || std::abs(shift) > 2.5) continue;
    EdgeOffset offset;
    offset.jacobian = step_jacobian(piece.image_at(fitted->part), piece.gradient, frame);
    offset.offset = shift * lines.along_normal();
    offset.sigma = fitted->sigma * cosine;
    offset.white = -1;
    const double height = std::abs(fitted->contrast);
    offset.modulation = height / std::max(fitted->level + 0.5 * height, 1.0);
    offsets.push_back(offset);
    pieces_measured.push_back(static_cast<int>(i));
  }
}

}  // namespace perch
