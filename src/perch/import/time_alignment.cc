#include "perch/import/time_alignment.h"

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "perch/geometry/so3.h"

namespace perch {
namespace {

// Turns over less are mostly the poses' noise; over more, what is quick is lost.
constexpr double kWindow = 0.1;  // s
constexpr double kStep = 0.05;   // of the search, s; half of what is averaged over
// A gyro may be logged at 10 Hz; what happened in a longer gap nobody knows.
constexpr double kMostGyroGap = 0.25;  // s
constexpr double kLeastDuration = 3;   // s; of turns to compare
constexpr size_t kFewestWindows = 30;
constexpr size_t kHills = 12;       // of the search that are looked at more closely
constexpr double kHillWidth = 0.3;  // s; two that are nearer are one
// Poses have errors of their own beside what their covariance says: a shaking lens, a rolling shutter.
constexpr double kLeastSigma = 3e-4;  // rad
constexpr double kOutlier = 5;        // deviations; a pose of the wrong minimum
// The best offset must be e^6 = 400 times as likely as the next.
constexpr double kLeastLogOdds = 6;
constexpr double kMemory = 1;  // s, over which errors may be correlated
constexpr double kTracksWider = 2;

std::string text(const char* format, auto... values) {
  char buffer[256];
  std::snprintf(buffer, sizeof buffer, format, values...);
  return buffer;
}

// The gyro summed up, so that its mean over any time is a difference.
class TurnedAngle {
 public:
  TurnedAngle(std::span<const GyroSample> gyro, int64_t zero_ns) {
    for (size_t i = 0; i < gyro.size(); ++i) {
      times_.push_back(static_cast<double>(gyro[i].timestamp_ns - zero_ns) * 1e-9);
      const double dt = i > 0 ? times_[i] - times_[i - 1] : 0;
      rates_.push_back(gyro[i].angular_velocity_in_body);
      angles_.push_back(i > 0 ? Eigen::Vector3d(angles_.back() + dt / 2 * (rates_[i - 1] + rates_[i]))
                              : Eigen::Vector3d::Zero());
      gaps_.push_back((i > 0 ? gaps_.back() : 0) + (dt > kMostGyroGap));
    }
  }
  double begin() const { return times_.front(); }
  double end() const { return times_.back(); }

  // Empty beyond the ends and across a gap.
  std::optional<Eigen::Vector3d> mean_rate(double from, double to) const {
    if (from < begin() || to > end()) return std::nullopt;
    const size_t i = before(from), k = before(to);
    if (gaps_[std::min(k + 1, times_.size() - 1)] != gaps_[i]) return std::nullopt;
    return (angle(k, to) - angle(i, from)) / (to - from);
  }

 private:
  size_t before(double time) const {
    const auto it = std::upper_bound(times_.begin(), times_.end(), time);
    return static_cast<size_t>(it - times_.begin()) - 1;
  }
  // The rate is linear between two samples.
  Eigen::Vector3d angle(size_t i, double time) const {
    if (i + 1 == times_.size()) return angles_[i];
    const double s = time - times_[i], dt = times_[i + 1] - times_[i];
    return angles_[i] + s * rates_[i] + s * s / (2 * dt) * (rates_[i + 1] - rates_[i]);
  }
  std::vector<double> times_;
  std::vector<Eigen::Vector3d> rates_, angles_;
  std::vector<int> gaps_;
};

// The camera's mean angular velocity between two pictures.
struct Window {
  double begin = 0, end = 0;  // s
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  double sigma = 0;  // of the rate, rad/s
  bool by_target = false;
};

std::vector<Window> windows_of(std::span<const CameraTurn> turns, int64_t zero_ns) {
  std::vector<Window> windows;
  const auto seconds = [&](int64_t ns) { return static_cast<double>(ns - zero_ns) * 1e-9; };
  for (size_t i = 0; i < turns.size(); ++i) {
    Eigen::Quaterniond begin_from_end = Eigen::Quaterniond::Identity();
    bool by_target = true;
    for (size_t k = i; k < turns.size(); ++k) {
      if (k > i && turns[k].begin_ns != turns[k - 1].end_ns) break;
      begin_from_end = begin_from_end * so3_exp(turns[k].turn);
      by_target = by_target && turns[k].by_target;
      Window window{seconds(turns[i].begin_ns), seconds(turns[k].end_ns), {}, 0, by_target};
      const double dt = window.end - window.begin;
      if (dt < kWindow) continue;
      // Two pictures far apart, of which much may have happened in between, are no mean worth comparing.
      if (dt > 5 * kWindow) break;
      window.rate = so3_log(begin_from_end) / dt;
      const double variance = (std::pow(turns[i].sigma, 2) + std::pow(turns[k].sigma, 2)) / 2;
      window.sigma = std::sqrt(variance + kLeastSigma * kLeastSigma) / dt;
      windows.push_back(window);
      break;
    }
  }
  return windows;
}

struct Fit {
  double offset = 0;
  Eigen::Matrix3d camera_from_body = Eigen::Matrix3d::Identity();
  double residual = 0, total = 0;          // weighted sums of squares
  std::vector<Eigen::Vector3d> residuals;  // of each window; NaN where the gyro has none
  double explained() const { return total > 0 ? 1 - residual / total : 0; }
};

class Alignment {
 public:
  Alignment(std::vector<Window> windows, TurnedAngle body)
      : windows_(std::move(windows)), body_(std::move(body)) {
    for (const Window& window : windows_) weights_.push_back(1 / (window.sigma * window.sigma));
  }

  // R and b for an offset, by Kabsch about the means. Empty where too little of the flight is covered.
  std::optional<Fit> fit(double offset) const {
    Fit fit{offset, {}, 0, 0, {}};
    fit.residuals.assign(windows_.size(), Eigen::Vector3d::Constant(std::nan("")));
    std::vector<Eigen::Vector3d> body(windows_.size());
    Eigen::Vector3d camera_mean = Eigen::Vector3d::Zero(), body_mean = Eigen::Vector3d::Zero();
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < windows_.size(); ++i) {
      const auto rate = body_.mean_rate(windows_[i].begin - offset, windows_[i].end - offset);
      if (!rate) continue;
      body[i] = *rate;
      fit.residuals[i].setZero();
      camera_mean += weights_[i] * windows_[i].rate;
      body_mean += weights_[i] * *rate;
      sum += weights_[i];
      ++count;
    }
    if (count < kFewestWindows || !(sum > 0)) return std::nullopt;
    camera_mean /= sum;
    body_mean /= sum;
    Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
    for (size_t i = 0; i < windows_.size(); ++i) {
      if (!fit.residuals[i].allFinite()) continue;
      moments += weights_[i] * (windows_[i].rate - camera_mean) * (body[i] - body_mean).transpose();
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moments, Eigen::ComputeFullU | Eigen::ComputeFullV);
    const double sign = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    fit.camera_from_body =
        svd.matrixU() * Eigen::Vector3d(1, 1, sign).asDiagonal() * svd.matrixV().transpose();
    for (size_t i = 0; i < windows_.size(); ++i) {
      if (!fit.residuals[i].allFinite()) continue;
      const Eigen::Vector3d camera = windows_[i].rate - camera_mean;
      fit.residuals[i] = camera - fit.camera_from_body * (body[i] - body_mean);
      fit.residual += weights_[i] * fit.residuals[i].squaredNorm();
      fit.total += weights_[i] * camera.squaredNorm();
    }
    return fit;
  }

  // The best offset on a hill, to a hundredth of a ms.
  std::optional<Fit> climb(double offset) const {
    std::optional<Fit> best;
    for (double d = offset - kHillWidth / 2; d <= offset + kHillWidth / 2; d += 0.01) {
      auto here = fit(d);
      if (here && (!best || here->explained() > best->explained())) best = std::move(here);
    }
    for (double step = 0.01; best && step > 1e-5; step /= 2) {
      for (const double d : {best->offset - step, best->offset + step}) {
        auto here = fit(d);
        if (here && here->explained() > best->explained()) best = std::move(here);
      }
    }
    return best;
  }

  // Weights as the residuals of a good offset are: how noisy each kind of turn really is, and which windows
  // are no part of it.
  void weigh(const Fit& fit) {
    for (const bool by_target : {true, false}) {
      std::vector<double> squares;
      for (size_t i = 0; i < windows_.size(); ++i) {
        if (windows_[i].by_target == by_target && fit.residuals[i].allFinite())
          squares.push_back(fit.residuals[i].squaredNorm() / std::pow(windows_[i].sigma, 2));
      }
      if (squares.empty()) continue;
      const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
      std::nth_element(squares.begin(), middle, squares.end());
      const double scale = std::max(*middle / 2.366, 1e-12);  // the median of chi-square with 3 degrees
      for (size_t i = 0; i < windows_.size(); ++i) {
        if (windows_[i].by_target != by_target) continue;
        const double variance = scale * std::pow(windows_[i].sigma, 2);
        const bool outlier = fit.residuals[i].squaredNorm() > kOutlier * kOutlier * variance;
        weights_[i] = outlier ? 0 : 1 / variance;
      }
    }
  }

  // Where the magnitudes agree best, the best first.
  std::vector<double> hills() const;

  // With u_i = J_i' r_i of each window, J its derivative by the offset, R and b fitted again:
  // var = (sum of u's covariances over all pairs of windows within kMemory) / (sum J' J)^2.
  double sigma(const Fit& fit) const {
    constexpr double kDelta = 0.002;  // s
    const auto before = this->fit(fit.offset - kDelta), after = this->fit(fit.offset + kDelta);
    if (!before || !after) throw AlignmentError("the log begins or ends where the video does");
    std::vector<double> u, times;
    double information = 0;
    for (size_t i = 0; i < windows_.size(); ++i) {
      const Eigen::Vector3d slope = (after->residuals[i] - before->residuals[i]) / (2 * kDelta);
      if (!slope.allFinite() || !fit.residuals[i].allFinite()) continue;
      information += weights_[i] * slope.squaredNorm();
      const double wider = windows_[i].by_target ? 1 : kTracksWider;
      u.push_back(wider * weights_[i] * slope.dot(fit.residuals[i]));
      times.push_back(windows_[i].begin);
    }
    double variance = 0;
    for (size_t i = 0; i < u.size(); ++i) {
      variance += u[i] * u[i];
      for (size_t k = i + 1; k < u.size() && times[k] - times[i] < kMemory; ++k)
        variance += 2 * (1 - (times[k] - times[i]) / kMemory) * u[i] * u[k];
    }
    // The mean of u over what is correlated has been fitted away.
    const double lost = 1 - std::min(0.5, 2 * kMemory / duration());
    return std::sqrt(variance / lost) / information;
  }

  // Of how many turns independent of each other a fit explains anything: its windows by those in which
  // what it explains has lost half of its correlation with itself. Not what it does not: noise forgets itself
  // at once, and a slow drift that happens to fit would seem to be a hundred turns. Less the three that a
  // rotation can always be fitted to.
  double independent_turns(const Fit& fit) const {
    std::vector<Eigen::Vector3d> explained;
    for (size_t i = 0; i < windows_.size(); ++i) {
      if (!fit.residuals[i].allFinite()) continue;
      explained.push_back(windows_[i].rate - fit.residuals[i]);
    }
    const Eigen::Vector3d mean =
        std::accumulate(explained.begin(), explained.end(), Eigen::Vector3d(0, 0, 0)) /
        static_cast<double>(explained.size());
    const auto correlation = [&](size_t lag) {
      double sum = 0;
      for (size_t i = 0; i + lag < explained.size(); ++i)
        sum += (explained[i] - mean).dot(explained[i + lag] - mean);
      return sum;
    };
    const double all = correlation(0);
    size_t lag = 1;
    while (lag + 1 < explained.size() && correlation(lag) > all / 2) ++lag;
    return std::max(0.0, static_cast<double>(explained.size()) / static_cast<double>(lag) - 3);
  }

  double duration() const {
    double sum = 0;
    for (size_t i = 1; i < windows_.size(); ++i)
      sum += std::min(windows_[i].begin - windows_[i - 1].begin, 5 * kWindow);
    return sum;
  }
  double by_target() const {
    const auto count =
        std::count_if(windows_.begin(), windows_.end(), [](const Window& w) { return w.by_target; });
    return static_cast<double>(count) / static_cast<double>(windows_.size());
  }

 private:
  std::vector<Window> windows_;
  TurnedAngle body_;
  std::vector<double> weights_;
};

// Values at even steps; NaN where there is none.
struct Series {
  double begin = 0;
  std::vector<float> values;
};

// The correlation of what both have, when the second is moved on by `lag` steps; NaN where that is less than
// `least` values.
double correlation(const Series& a, const Series& b, std::ptrdiff_t lag, size_t least) {
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  const auto size_a = static_cast<std::ptrdiff_t>(a.values.size());
  const auto size_b = static_cast<std::ptrdiff_t>(b.values.size());
  for (std::ptrdiff_t i = std::max<std::ptrdiff_t>(0, lag); i < std::min(size_a, size_b + lag); ++i) {
    const float x = a.values[static_cast<size_t>(i)], y = b.values[static_cast<size_t>(i - lag)];
    if (std::isnan(x) || std::isnan(y)) continue;
    n += 1, sa += x, sb += y, saa += x * x, sbb += y * y, sab += x * y;
  }
  if (n < static_cast<double>(least)) return std::nan("");
  const double va = saa - sa * sa / n, vb = sbb - sb * sb / n;
  return va > 0 && vb > 0 ? (sab - sa * sb / n) / std::sqrt(va * vb) : 0;
}

std::vector<double> Alignment::hills() const {
  constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
  constexpr double kLongest = 3 * 86'400;  // s
  if (body_.end() - body_.begin() > kLongest || windows_.back().begin - windows_.front().begin > kLongest)
    throw AlignmentError("times span more than three days: a clock was set amid the recording");
  const double width = windows_.front().end - windows_.front().begin;
  Series camera{windows_.front().begin, {}}, body{body_.begin(), {}};
  // Each window's magnitude where its middle is; the last one counts where there are several.
  camera.values.assign(static_cast<size_t>((windows_.back().begin - camera.begin) / kStep) + 1, kNone);
  for (const Window& window : windows_) {
    camera.values[static_cast<size_t>((window.begin - camera.begin) / kStep)] =
        static_cast<float>(window.rate.norm());
  }
  for (double t = body.begin; t + width <= body_.end(); t += kStep) {
    const auto rate = body_.mean_rate(t, t + width);
    body.values.push_back(rate ? static_cast<float>(rate->norm()) : kNone);
  }
  const auto count = [](const Series& s) {
    return static_cast<size_t>(
        std::count_if(s.values.begin(), s.values.end(), [](float v) { return v == v; }));
  };
  const size_t least = std::max<size_t>(std::min(count(camera), count(body)) / 2,
                                        static_cast<size_t>(kLeastDuration / kStep / 2));
  std::vector<std::pair<double, double>> found;  // correlation, offset
  std::vector<double> all;
  const auto first = -static_cast<std::ptrdiff_t>(body.values.size());
  const auto last = static_cast<std::ptrdiff_t>(camera.values.size());
  for (std::ptrdiff_t lag = first; lag <= last; ++lag) all.push_back(correlation(camera, body, lag, least));
  for (size_t i = 0; i < all.size(); ++i) {
    if (std::isnan(all[i])) continue;
    const auto is_lower = [&](size_t k) { return std::isnan(all[k]) || all[k] <= all[i]; };
    if ((i > 0 && !is_lower(i - 1)) || (i + 1 < all.size() && !is_lower(i + 1))) continue;
    found.emplace_back(all[i], camera.begin - body.begin +
                                   kStep * static_cast<double>(first + static_cast<std::ptrdiff_t>(i)));
  }
  std::sort(found.rbegin(), found.rend());
  std::vector<double> offsets;
  for (const auto& [value, offset] : found) {
    if (offsets.size() < kHills) offsets.push_back(offset);
  }
  return offsets;
}

}  // namespace

TimeAlignment align_times(std::span<const CameraTurn> turns, std::span<const GyroSample> gyro) {
  if (gyro.size() < 2) throw AlignmentError("the log tells of no turning");
  if (turns.empty()) throw AlignmentError("no two pictures in a row show how the camera turned");
  const int64_t camera_zero = turns.front().begin_ns, body_zero = gyro.front().timestamp_ns;
  std::vector<Window> windows = windows_of(turns, camera_zero);
  if (windows.size() < kFewestWindows) {
    throw AlignmentError("only " + std::to_string(windows.size()) + " times do pictures " +
                         text("%.1f s apart show how the camera turned", kWindow) +
                         ", of 30 that are needed");
  }
  Alignment alignment(std::move(windows), TurnedAngle(gyro, body_zero));
  if (alignment.duration() < kLeastDuration) {
    throw AlignmentError(text("only %.1f s of pictures show how the camera turned, of %.0f s that are needed",
                              alignment.duration(), kLeastDuration));
  }
  std::vector<Fit> fits;
  for (const double hill : alignment.hills()) {
    if (auto fit = alignment.climb(hill)) fits.push_back(std::move(*fit));
  }
  if (fits.empty()) throw AlignmentError("the log is too short: it and the pictures have no 3 s in common");
  const auto better = [](const Fit& a, const Fit& b) { return a.explained() > b.explained(); };
  std::sort(fits.begin(), fits.end(), better);
  // As the best one says, what is how noisy; then all again by the same measure.
  for (int pass = 0; pass < 2; ++pass) {
    alignment.weigh(fits.front());
    for (Fit& fit : fits) {
      if (auto again = alignment.climb(fit.offset)) fit = std::move(*again);
    }
    std::sort(fits.begin(), fits.end(), better);
  }
  const Fit& best = fits.front();
  TimeAlignment result;
  result.explained = best.explained();
  for (const Fit& fit : fits) {
    if (std::abs(fit.offset - best.offset) > kHillWidth)
      result.rival_explained = std::max(result.rival_explained, fit.explained());
  }
  result.duration = alignment.duration();
  const double independent = alignment.independent_turns(best);
  const double log_odds = independent / 2 * std::log((1 - result.rival_explained) / (1 - result.explained));
  if (!(log_odds > kLeastLogOdds)) {
    throw AlignmentError(
        text("the pictures and the log do not decide on an offset: the best explains %.0f %% of the "
             "camera's turning, another one %.0f %%, over %.0f s with %.0f independent turns",
             100 * result.explained, 100 * result.rival_explained, result.duration, independent));
  }
  result.sigma = alignment.sigma(best);
  result.offset_ns = camera_zero - body_zero + std::llround(best.offset * 1e9);
  result.camera_from_body = Eigen::Quaterniond(best.camera_from_body);
  result.by_target = alignment.by_target();
  return result;
}

std::vector<GyroSample> angular_velocities(const NavTrack& nav) {
  std::vector<GyroSample> rates;
  for (size_t i = 1; i < nav.samples.size(); ++i) {
    const NavSample &a = nav.samples[i - 1], &b = nav.samples[i];
    const int64_t dt = b.timestamp_ns - a.timestamp_ns;
    const Eigen::Vector3d turn = so3_log(a.world_from_body.rotation.conjugate() * b.world_from_body.rotation);
    rates.push_back({a.timestamp_ns + dt / 2, turn / (static_cast<double>(dt) * 1e-9)});
  }
  return rates;
}

}  // namespace perch
