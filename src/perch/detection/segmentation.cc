#include "perch/detection/segmentation.h"

namespace perch {
namespace {

int region_of(const Segmentation& s, int label) {
  const Component& c = s.at(label);
  return label_at(s.foreground, s.image.runs[static_cast<size_t>(c.first_run)].begin, c.top);
}

void make_second_pass(Segmentation& s) {
  foreground_runs(s.image, s.foreground);
  label_components(s.foreground, s.regions);
  s.counts.assign(s.regions.list.size(), {});
  for (int label = 1; label < static_cast<int>(s.components.list.size()); ++label) {
    if (s.is_noise(label)) continue;
    Segmentation::Counts& counts = s.counts[static_cast<size_t>(region_of(s, label))];
    ++(s.at(label).white ? counts.white : counts.black);
  }
  s.second_pass = true;
}

}  // namespace

void segment(const cv::Mat& grey, uint8_t level, int row_step, int min_px, Segmentation& s) {
  threshold_to_runs(grey, level, row_step, s.image);
  segment_runs(min_px, s);
}

void segment_runs(int min_px, Segmentation& s) {
  s.min_px = min_px;
  s.second_pass = false;
  label_components(s.image, s.components);
  s.holds.assign(s.components.list.size(), 0);
  for (int label = 1; label < static_cast<int>(s.components.list.size()); ++label) {
    if (!s.is_noise(label)) ++s.holds[static_cast<size_t>(s.around(label))];
  }
}

Segmentation::Counts counts_in_region_of(int label, Segmentation& s) {
  if (!s.second_pass) make_second_pass(s);
  return s.counts[static_cast<size_t>(region_of(s, label))];
}

void held_by(const Segmentation& s, int holder, std::vector<int>& labels) {
  labels.clear();
  // Labels count in the order of the components' first pixels, so what lies in another has a higher one.
  for (int label = holder + 1; label < static_cast<int>(s.components.list.size()); ++label) {
    if (s.at(label).top > s.at(holder).bottom) break;
    if (!s.is_noise(label) && s.around(label) == holder) labels.push_back(label);
  }
}

}  // namespace perch
