#include "perch/detection/segmentation.h"

namespace perch {

void segment(const cv::Mat& grey, uint8_t level, int row_step, int min_px, Segmentation& s) {
  threshold_to_runs(grey, level, row_step, s.image);
  label_components(s.image, s.components);
  foreground_runs(s.image, s.foreground);
  label_components(s.foreground, s.regions);

  const size_t labels = s.components.list.size();
  s.holds.assign(labels, 0);
  s.region_of.assign(labels, Components::kFrame);
  s.counts.assign(s.regions.list.size(), {});
  for (int label = 1; label < static_cast<int>(labels); ++label) {
    if (s.is_noise(label, min_px)) continue;
    const Component& c = s.at(label);
    ++s.holds[static_cast<size_t>(s.around(label))];
    const int region = label_at(s.foreground, s.image.runs[static_cast<size_t>(c.first_run)].begin, c.top);
    s.region_of[static_cast<size_t>(label)] = region;
    Segmentation::Counts& counts = s.counts[static_cast<size_t>(region)];
    ++(c.white ? counts.white : counts.black);
  }
}

void held_by(const Segmentation& s, int holder, int min_px, std::vector<int>& labels) {
  labels.clear();
  // Labels count in the order of the components' first pixels, so what lies in another has a higher one.
  for (int label = holder + 1; label < static_cast<int>(s.components.list.size()); ++label) {
    if (s.at(label).top > s.at(holder).bottom) break;
    if (!s.is_noise(label, min_px) && s.around(label) == holder) labels.push_back(label);
  }
}

}  // namespace perch
