#include "perch/camera/zoom_table.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "perch/config/atomic_file.h"
#include "perch/config/section.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

// Focal lengths come first in every lens model of mrcal.
bool is_focal(size_t parameter) { return parameter < 2; }

double to_curve(size_t parameter, double value) { return is_focal(parameter) ? std::log(value) : value; }
double from_curve(size_t parameter, double value) { return is_focal(parameter) ? std::exp(value) : value; }

// The slope at the end from the nearest two intervals, no steeper than keeps the curve monotone.
double end_slope(double h0, double h1, double rise0, double rise1) {
  const double slope = ((2 * h0 + h1) * rise0 - h0 * rise1) / (h0 + h1);
  if (slope * rise0 <= 0) return 0;
  return rise0 * rise1 <= 0 && std::abs(slope) > 3 * std::abs(rise0) ? 3 * rise0 : slope;
}

// Inside, the weighted harmonic mean of the slopes on both sides (Fritsch and Butland 1984); 0 at a turn.
std::vector<double> monotone_slopes(const std::vector<double>& x, const std::vector<double>& y) {
  const size_t n = x.size();
  std::vector<double> h, rise;
  for (size_t i = 0; i + 1 < n; ++i) {
    h.push_back(x[i + 1] - x[i]);
    rise.push_back((y[i + 1] - y[i]) / h.back());
  }
  if (n == 2) return {rise[0], rise[0]};
  std::vector<double> slopes(n, 0.0);
  for (size_t i = 1; i + 1 < n; ++i) {
    if (rise[i - 1] * rise[i] <= 0) continue;
    const double w0 = 2 * h[i] + h[i - 1], w1 = h[i] + 2 * h[i - 1];
    slopes[i] = (w0 + w1) / (w0 / rise[i - 1] + w1 / rise[i]);
  }
  slopes[0] = end_slope(h[0], h[1], rise[0], rise[1]);
  slopes[n - 1] = end_slope(h[n - 2], h[n - 3], rise[n - 2], rise[n - 3]);
  return slopes;
}

double most_apart_px(const CameraModel& a, const CameraModel& b) {
  constexpr int kPlaces = 9;
  double most = 0;
  for (int row = 0; row < kPlaces; ++row) {
    for (int column = 0; column < kPlaces; ++column) {
      const Eigen::Vector2d pixel(column * (a.width() - 1.0) / (kPlaces - 1),
                                  row * (a.height() - 1.0) / (kPlaces - 1));
      const auto ray = a.ray_from_pixel(pixel);
      const auto seen = ray ? b.pixel_from_camera(*ray) : std::nullopt;
      if (!seen) return NAN;
      most = std::max(most, (*seen - pixel).norm());
    }
  }
  return most;
}

}  // namespace

ZoomTable::ZoomTable(std::vector<ZoomEntry> entries) : entries_(std::move(entries)) {
  if (entries_.size() < 2) throw std::invalid_argument("a zoom table needs models of two zooms at least");
  for (const ZoomEntry& entry : entries_) {
    if (!std::isfinite(entry.zoom)) throw std::invalid_argument("a zoom that is no number");
    const CameraModel& first = entries_[0].model;
    if (entry.model.lens() != first.lens()) {
      throw std::invalid_argument("models of one lens model, not " + first.lens() + " and " +
                                  entry.model.lens());
    }
    if (entry.model.width() != first.width() || entry.model.height() != first.height()) {
      throw std::invalid_argument("models of pictures of one size");
    }
  }
  std::sort(entries_.begin(), entries_.end(), [](const auto& a, const auto& b) { return a.zoom < b.zoom; });
  std::vector<double> zooms;
  for (const ZoomEntry& entry : entries_) {
    if (!zooms.empty() && entry.zoom == zooms.back()) throw std::invalid_argument("each zoom once");
    zooms.push_back(entry.zoom);
  }
  for (size_t k = 0; k < entries_[0].model.intrinsics().size(); ++k) {
    std::vector<double> values;
    for (const ZoomEntry& entry : entries_) values.push_back(to_curve(k, entry.model.intrinsics()[k]));
    slopes_.push_back(monotone_slopes(zooms, values));
    values_.push_back(std::move(values));
  }
}

std::optional<CameraModel> ZoomTable::at(double zoom) const {
  const double low = entries_.front().zoom, high = entries_.back().zoom, slack = 0.01 * (high - low);
  if (!(zoom >= low - slack && zoom <= high + slack)) return std::nullopt;
  const double z = std::clamp(zoom, low, high);
  size_t i = 0;
  while (i + 2 < entries_.size() && z > entries_[i + 1].zoom) ++i;
  const double h = entries_[i + 1].zoom - entries_[i].zoom, t = (z - entries_[i].zoom) / h;
  // Hermite's cubic of the values and slopes at both ends.
  const double a = (1 + 2 * t) * (1 - t) * (1 - t), b = t * (1 - t) * (1 - t) * h;
  const double c = t * t * (3 - 2 * t), d = t * t * (t - 1) * h;
  std::vector<double> intrinsics;
  for (size_t k = 0; k < values_.size(); ++k) {
    const double value =
        a * values_[k][i] + b * slopes_[k][i] + c * values_[k][i + 1] + d * slopes_[k][i + 1];
    intrinsics.push_back(from_curve(k, value));
  }
  const CameraModel& any = entries_[0].model;
  return CameraModel(any.lens(), intrinsics, any.width(), any.height());
}

std::vector<double> ZoomTable::held_out_px() const {
  std::vector<double> errors;
  for (size_t i = 1; i + 1 < entries_.size(); ++i) {
    std::vector<ZoomEntry> others = entries_;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    const auto between = ZoomTable(others).at(entries_[i].zoom);
    errors.push_back(between ? most_apart_px(entries_[i].model, *between) : NAN);
  }
  return errors;
}

ZoomTable read_zoom_table(const fs::path& file) {
  Section root = Section::load(file);
  std::vector<ZoomEntry> entries;
  if (!root.has("models")) root.fail("models", "a list of {zoom, model}");
  for (Section& entry : root.list("models")) {
    double zoom = 0;
    fs::path model;
    for (const char* key : {"zoom", "model"}) {
      if (!entry.has(key)) entry.fail(key, "a zoom and the file of its camera model");
    }
    entry.read("zoom", zoom);
    entry.read("model", model);
    entry.done();
    entries.push_back({zoom, read_camera_model(model)});
  }
  root.done();
  try {
    return ZoomTable(std::move(entries));
  } catch (const std::invalid_argument& e) {
    root.fail("models", e.what());
  }
}

size_t add_to_zoom_table(const fs::path& file, double zoom, const fs::path& model) {
  std::vector<std::pair<double, fs::path>> entries{{zoom, model}};
  std::error_code ignored;
  if (fs::exists(file, ignored)) {
    Section root = Section::load(file);
    for (Section& entry : root.list("models")) {
      double other = 0;
      fs::path path;
      entry.read("zoom", other);
      entry.read("model", path);
      entry.done();
      if (other != zoom) entries.emplace_back(other, path);
    }
    root.done();
  }
  std::sort(entries.begin(), entries.end());
  std::ostringstream yaml;
  yaml.precision(12);
  yaml << "# A zoom camera's models; between them perch interpolates (docs/FORMATS.md).\nmodels:\n";
  const fs::path folder = fs::absolute(file).parent_path();
  for (const auto& [at, path] : entries) {
    const fs::path relative =
        fs::absolute(path).lexically_normal().lexically_proximate(folder.lexically_normal());
    yaml << "  - {zoom: " << at << ", model: \"" << relative.generic_string() << "\"}\n";
  }
  write_whole_file(file, yaml.str());
  return entries.size();
}

}  // namespace perch
