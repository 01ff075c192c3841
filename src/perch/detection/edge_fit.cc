#include "perch/detection/edge_fit.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/core/hal/intrin.hpp>
#include <optional>

namespace perch {
namespace {

// As many deviations of the blur from a step its levels are looked for: it ends after three.
constexpr double kLevel = 4.2;

// Of the pixels' products with the templates: how many each line has.
constexpr int kNarrow = 8;
static_assert(StepTemplates::kPixels == 2 * kNarrow);

// Sums over lines, from which level, contrast and offset follow.
struct Sums {
  cv::v_float32x4 templates[StepTemplates::kSums / 4];  // of the templates' products
  cv::v_int32x4 i, it, ig, iw, ii;                      // of the pixels' with them
  double shift = 0;  // from the templates' places to the expected, sum over lines
  double part = 0;   // of the piece, sum over lines
  int lines = 0;

  Sums() : i(cv::v_setzero_s32()), it(i), ig(i), iw(i), ii(i) {
    for (auto& four : templates) four = cv::v_setzero_f32();
  }

  // Eight pixels of a line from the template's pixel `from` on.
  void add(const cv::v_int16x8& grey, const StepTemplates::Template& a, int from) {
    const cv::v_int16x8 seen = grey & cv::v_load(a.inside + from);
    i += cv::v_dotprod(seen, cv::v_setall_s16(1));
    it += cv::v_dotprod(grey, cv::v_load(a.step + from));
    ig += cv::v_dotprod(grey, cv::v_load(a.slope + from));
    iw += cv::v_dotprod(grey, cv::v_load(a.narrower + from));
    ii += cv::v_dotprod(seen, seen);
  }
  void add(const StepTemplates::Template& a, double off) {
    for (int k = 0; k < StepTemplates::kSums / 4; ++k) templates[k] += cv::v_load(a.sums + 4 * k);
    shift += off;
    ++lines;
  }
};

cv::v_int16x8 eight_pixels(const uint8_t* p) { return cv::v_reinterpret_as_s16(cv::v_load_expand(p)); }

// Of every `step`-th byte. Put together in a register: bytes that are written one by one are not there yet
// when eight are read at once.
cv::v_int16x8 eight_pixels(const uint8_t* p, std::ptrdiff_t step) {
  const auto four = [step](const uint8_t* q) {
    return static_cast<uint32_t>(q[0] | q[step] << 8 | q[2 * step] << 16) | static_cast<uint32_t>(q[3 * step])
                                                                                << 24;
  };
  const uint64_t eight = four(p) | static_cast<uint64_t>(four(p + 4 * step)) << 32;
  return eight_pixels(reinterpret_cast<const uint8_t*>(&eight));
}

}  // namespace

// One piece about where it is expected, moved by `shift`: the least squares A x = b of the level half way up,
// the contrast, and -contrast * offset, all along a line.
struct EdgeFit::Piece {
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero(), inverse = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero(), own = Eigen::Vector3d::Zero();  // x by this piece alone
  double variance = 1;  // of a pixel's grey about the step
  // Of what a narrower blur adds: how much of it there is by this piece alone, its sums.
  double narrower = 0, ww = 0;
  Eigen::Vector3d by_w = Eigen::Vector3d::Zero();
  double xt = 0;       // as in StepTemplates, summed
  double off = 0;      // from the templates' places to the expected, mean over lines, px
  double part = 0.5;   // of the piece, where its lines are in the mean
  double shift = 0;    // px along the lines
  double blur_px = 1;  // of the templates, along the lines
  double reach = 1;    // of the templates
  double gain = 1;     // of a small offset, what the templates' slope makes of it
  double along_normal = 1;
  bool rows = true;
  int index = 0;

  double sign() const { return along_normal > 0 ? 1 : -1; }  // 1: white lies behind black on a line
  double offset_of(const Eigen::Vector3d& x) const { return -x(2) / (x(1) * gain) - off; }
};

namespace {

// By the piece alone. A blur that is not the templates' is odd about the step, as the contrast is, and shifts
// nothing.
bool solve(const Sums& s, EdgeFit::Piece& piece) {
  using T = StepTemplates;
  float sum[T::kSums];
  for (int k = 0; k < T::kSums / 4; ++k) cv::v_store(sum + 4 * k, s.templates[k]);
  if (s.lines == 0 || !(sum[T::kN] > 4)) return false;
  constexpr double kOne = T::kOne;
  piece.A << sum[T::kN], sum[T::kT], sum[T::kG], sum[T::kT], sum[T::kTT], sum[T::kTG], sum[T::kG],
      sum[T::kTG], sum[T::kGG];
  piece.b << cv::v_reduce_sum(s.i), cv::v_reduce_sum(s.it) / kOne, cv::v_reduce_sum(s.ig) / kOne;
  piece.xt = sum[T::kXT];
  piece.by_w = Eigen::Vector3d(sum[T::kW], sum[T::kTW], sum[T::kGW]);
  piece.ww = sum[T::kWW];
  piece.off = s.shift / s.lines;
  piece.part = s.part / s.lines;
  piece.inverse = piece.A.inverse();
  const Eigen::Vector3d by_narrower = piece.inverse * piece.by_w;
  const double iw = cv::v_reduce_sum(s.iw) / kOne;
  const double left = iw - by_narrower.dot(piece.b), own = piece.ww - piece.by_w.dot(by_narrower);
  piece.narrower = own > 1e-3 * piece.ww ? left / own : 0;
  piece.own = piece.inverse * piece.b - by_narrower * piece.narrower;
  if (!piece.own.allFinite()) return false;
  // That of rounding to whole grey levels at least, however small the residuals of a few.
  const double explained = piece.b.dot(piece.own) + iw * piece.narrower;
  const double residual = std::max(0.0, cv::v_reduce_sum(s.ii) - explained);
  piece.variance = std::max((residual + 4 * 1.0) / piece.A(0, 0), 1.0 / 12);
  return true;
}

// One piece's lines about where it is expected, moved by its shift.
bool fit_lines(const cv::Mat& grey, const CrossingLines& lines, int step, const StepTemplates& templates,
               bool narrow, EdgeFit::Piece& piece) {
  Sums sums;
  const int count = lines.rows() ? grey.rows : grey.cols, width = lines.rows() ? grey.cols : grey.rows;
  const int from = narrow ? kNarrow / 2 : 0, pixels = narrow ? kNarrow : 2 * kNarrow;
  for (int at = std::max(lines.first(), 0); at <= std::min(lines.last(), count - 1); at += step) {
    const double crossing = lines.crossing(at) + piece.shift;
    const int middle = cvRound(crossing);
    const int begin = middle - pixels / 2;
    if (begin < 0 || begin + pixels > width) continue;
    sums.part += lines.part(at);
    double phase = crossing - middle;
    const double wanted = phase;
    const auto& a = templates.at(&phase);
    if (lines.rows()) {
      const uint8_t* line = grey.ptr<uint8_t>(at) + begin;
      sums.add(eight_pixels(line), a, from);
      if (!narrow) sums.add(eight_pixels(line + kNarrow), a, kNarrow);
    } else {
      const uint8_t* line = grey.ptr<uint8_t>(begin) + at;
      const auto pitch = static_cast<std::ptrdiff_t>(grey.step[0]);
      sums.add(eight_pixels(line, pitch), a, from);
      if (!narrow) sums.add(eight_pixels(line + kNarrow * pitch, pitch), a, kNarrow);
    }
    sums.add(a, wanted - phase);
  }
  return solve(sums, piece);
}

// The level `half` a contrast above the middle of the step, as far as the piece's own does not speak against
// it. One that is off lies in glare, dirt or the soft edge of a shadow, and has its own; that changes within
// a few pixels.
LevelSurface::Level believed(const EdgeFit::Piece& piece, const LevelSurface& surface,
                             const Eigen::Vector2d& pixel, double half) {
  constexpr double kDeviations = 4, kSoftEdge = 5;  // px
  const Eigen::Vector3d u(1, half, 0);
  const double own = u.dot(piece.own);
  const LevelSurface::Level level = surface.at(pixel, own);
  const double variance = level.variance + piece.variance * u.dot(piece.inverse * u);
  const double off = std::abs(own - level.value);
  if (off * off <= kDeviations * kDeviations * variance) return level;
  LevelSurface::Level unknown;
  unknown.gradient_sigma = off / kSoftEdge;
  return unknown;
}

// Of the slope of a step of one blur, by least squares, as that of the templates', the level being free: as
// two Gaussians overlap within the reach. Blurs that differ by more than the bounds are for the next look,
// with other templates.
double gain_of(double blur, double template_blur, double reach) {
  constexpr double kLeast = 0.85, kMost = 1.15;
  const double level = 0.5 / reach;
  const auto overlap = [&](double b) {
    return 1 / std::sqrt(2 * M_PI * (b * b + template_blur * template_blur)) - level;
  };
  const double alike = overlap(template_blur);
  return alike > 0 ? std::clamp(overlap(blur) / alike, kLeast, kMost) : 1;
}

// Up to where the next edge's blur begins, and not farther than the step's own reaches.
double reach_of(const EdgePiece& piece, double blur_px) {
  const double cosine = piece.normal.cwiseAbs().maxCoeff();
  const double room = std::min(piece.white_room, piece.black_room) - 2 * blur_px;
  return std::min(std::min(room, kLevel * blur_px) / cosine, kLargestReach);
}

struct Step {
  double offset = 0, sigma = 0;  // along the line, px
  double contrast = 0;
};

// With what is known of the levels and the blur. Where white changes along the line more than black, the step
// alone would seem to lie elsewhere.
Step solve(const EdgeFit::Piece& piece, const LevelSurface::Level& white, const LevelSurface::Level& black) {
  const int axis = piece.rows ? 0 : 1;
  const double of_white = white.gradient[axis], of_black = black.gradient[axis];
  const double more = piece.sign() * (of_white - of_black), mean = 0.5 * (of_white + of_black);
  Eigen::Vector3d right = piece.b;
  right -= Eigen::Vector3d(more * piece.xt, mean * piece.xt, more * piece.by_w(1));
  right /= piece.variance;
  Eigen::Matrix3d information = piece.A / piece.variance;
  const auto hold = [&](const LevelSurface::Level& level, double half) {
    const Eigen::Vector3d u(1, half, 0);
    information += u * u.transpose() / level.variance;
    right += u * (level.value / level.variance);
  };
  hold(white, 0.5 * piece.sign());
  hold(black, -0.5 * piece.sign());
  const Eigen::Matrix3d covariance = information.inverse();
  const Eigen::Vector3d x = covariance * right;
  // A gradient that is not known goes into the offset as those do that are.
  const Eigen::Vector3d by_gradient(piece.xt, 0, piece.by_w(1));
  const double of_gradient = covariance.row(2).dot(by_gradient) / piece.variance *
                             std::hypot(white.gradient_sigma, black.gradient_sigma);
  const double sigma = std::sqrt(covariance(2, 2) + of_gradient * of_gradient);
  return {piece.offset_of(x), sigma / std::abs(x(1) * piece.gain), std::abs(x(1))};
}

}  // namespace

EdgeFit::EdgeFit() = default;
EdgeFit::~EdgeFit() = default;

bool EdgeFit::has_room(const EdgePiece& piece, double blur_px) {
  return reach_of(piece, blur_px) >= kLeastReach;
}

bool EdgeFit::fit(const cv::Mat& grey, const EdgePiece& piece, const EdgeFitOptions& options,
                  Piece& fitted) const {
  const double cosine = piece.normal.cwiseAbs().maxCoeff(), sine = piece.normal.cwiseAbs().minCoeff();
  const double reach = reach_of(piece, options.blur);
  if (reach < kLeastReach) return false;
  const CrossingLines lines(piece, 2.5 * options.blur + sine * reach * 0.5);
  const int count = lines.last() - lines.first() + 1;
  if (count < 1) return false;
  // An edge has about 8 pieces when long.
  const int step = std::max(1, count * 4 / std::max(1, options.lines_per_edge));
  fitted.blur_px = options.blur / cosine;
  const StepTemplates& table = templates_.of(reach, &fitted.blur_px);
  fitted.reach = table.reach();
  fitted.gain = 1;
  fitted.shift = 0;
  fitted.along_normal = lines.along_normal();
  fitted.rows = lines.rows();
  double offset = 0;
  for (int round = 0; round < 3; ++round) {
    fitted.shift += offset;
    if (!fit_lines(grey, lines, step, table, table.reach() <= kNarrow / 2 - 0.5, fitted)) return false;
    if (!(fitted.own(1) * lines.along_normal() > options.contrast * cosine)) return false;
    offset = fitted.offset_of(fitted.own);
    if (!(std::abs(offset) < 2)) return false;
    if (std::abs(offset) < 0.15) break;
  }
  return std::abs(offset) < 0.5 && std::abs(fitted.shift) < 2.5;
}

void EdgeFit::find_levels(std::span<const EdgePiece> pieces, std::span<const uint8_t> on_ground) {
  for (Piece& p : fitted_) {
    const Eigen::Vector2d& normal = pieces[static_cast<size_t>(p.index)].normal;
    const double blur = std::sqrt(normal.dot(blur_ * normal)) / std::abs(p.along_normal);
    p.gain = gain_of(blur, p.blur_px, p.reach);
    p.narrower = p.own(1) * (1 - blur / p.blur_px);
    p.b -= p.narrower * p.by_w;
    p.own = p.inverse * p.b;
  }
  const auto gather = [&](double half, bool ground_too) {
    samples_.clear();
    for (const Piece& p : fitted_) {
      if (!ground_too && on_ground[static_cast<size_t>(p.index)]) continue;
      const Eigen::Vector3d u(1, half * p.sign(), 0);
      const double variance = p.variance * u.dot(p.inverse * u);
      samples_.push_back({pieces[static_cast<size_t>(p.index)].middle, u.dot(p.own), variance});
    }
  };
  gather(0.5, true);
  white_.fit(samples_);
  gather(-0.5, false);
  black_.fit(samples_);
}

// A step that is narrower by a part d than the templates has contrast * d of what a narrower blur adds.
void EdgeFit::find_blur(std::span<const EdgePiece> pieces, double expected_px) {
  // Three numbers: as many pieces tell them to a hundredth.
  constexpr size_t kEnough = 40;
  widths_.clear();
  const size_t every = std::max<size_t>(1, fitted_.size() / kEnough);
  for (size_t i = 0; i < fitted_.size(); i += every) {
    const Piece& p = fitted_[i];
    const double own = p.ww - p.by_w.dot(p.inverse * p.by_w);
    if (!(own > 0.02 * p.ww)) continue;
    const double cosine = std::abs(p.along_normal), part = std::clamp(p.narrower / p.own(1), -1.0, 0.6);
    const double width = cosine * p.blur_px * (1 - part);
    const double deviation =
        2 * width * cosine * p.blur_px * std::sqrt(p.variance / own) / std::abs(p.own(1));
    widths_.push_back({pieces[static_cast<size_t>(p.index)].normal, width * width, deviation * deviation});
  }
  blur_ = fit_blur(widths_, expected_px);
}

// What a textured ground adds to the residuals is not noise of single pixels.
void EdgeFit::widen_on_ground(std::span<const uint8_t> on_ground) {
  const double together = std::max(texture_together(0.5 * blur_.trace()), 1.0);
  variances_.clear();
  for (const Piece& p : fitted_) {
    if (!on_ground[static_cast<size_t>(p.index)]) variances_.push_back(p.variance);
  }
  if (variances_.empty()) return;
  const auto middle = variances_.begin() + static_cast<std::ptrdiff_t>(variances_.size() / 2);
  std::ranges::nth_element(variances_, middle);
  for (Piece& p : fitted_) {
    if (on_ground[static_cast<size_t>(p.index)])
      p.variance += (together - 1) * std::max(0.0, p.variance - *middle);
  }
}

void EdgeFit::measure(const cv::Mat& grey, std::span<const EdgePiece> pieces,
                      std::span<const uint8_t> on_ground, const ImageFrame& frame,
                      const EdgeFitOptions& options, std::vector<EdgeOffset>& offsets,
                      std::vector<int>& pieces_measured) {
  offsets.clear();
  pieces_measured.clear();
  fitted_.clear();
  auto may_fail = (1 - options.least_measured) * static_cast<double>(std::ranges::count(on_ground, 0));
  Piece fitted;
  for (size_t i = 0; i < pieces.size(); ++i) {
    fitted.index = static_cast<int>(i);
    if (fit(grey, pieces[i], options, fitted)) {
      fitted_.push_back(fitted);
    } else if (!on_ground[i] && --may_fail < 0) {
      return;
    }
  }
  find_blur(pieces, options.blur);
  find_levels(pieces, on_ground);
  widen_on_ground(on_ground);
  for (const Piece& p : fitted_) {
    const EdgePiece& piece = pieces[static_cast<size_t>(p.index)];
    const LevelSurface::Level white = believed(p, white_, piece.middle, 0.5 * p.sign());
    // Of the ground nothing is known.
    LevelSurface::Level black;
    if (!on_ground[static_cast<size_t>(p.index)]) black = believed(p, black_, piece.middle, -0.5 * p.sign());
    const Step step = solve(p, white, black);
    if (!(std::abs(step.offset) < 0.5) || !std::isfinite(step.sigma)) continue;
    EdgeOffset offset;
    offset.jacobian = step_jacobian(piece.image_at(p.part), piece.gradient, frame);
    offset.offset = (p.shift + step.offset) * p.along_normal;
    offset.sigma = step.sigma * std::abs(p.along_normal);
    offset.white = -1;
    offset.modulation = step.contrast / std::max(p.own(0) + 0.5 * step.contrast, 1.0);
    offsets.push_back(offset);
    pieces_measured.push_back(p.index);
  }
}

}  // namespace perch
