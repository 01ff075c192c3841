#include "perch/detection/components.h"

#include <algorithm>

namespace perch {
namespace {

int root_of(std::vector<Component>& list, int label) {
  while (list[static_cast<size_t>(label)].parent != label) {
    // Halves the path: the next search is shorter.
    int& parent = list[static_cast<size_t>(label)].parent;
    parent = list[static_cast<size_t>(parent)].parent;
    label = parent;
  }
  return label;
}

// The lower label becomes the root, so that every parent is lower than its child.
int unite(std::vector<Component>& list, int a, int b) {
  a = root_of(list, a);
  b = root_of(list, b);
  if (a == b) return a;
  const auto [low, high] = std::minmax(a, b);
  list[static_cast<size_t>(high)].parent = low;
  return low;
}

void grow(Component& c, const Component& by) {
  c.area += by.area;
  c.left = std::min(c.left, by.left);
  c.right = std::max(c.right, by.right);
  c.top = std::min(c.top, by.top);
  c.bottom = std::max(c.bottom, by.bottom);
}

constexpr int kNone = -1;

// Joins `label` (kNone: not yet labelled) with what it touches.
int join(std::vector<Component>& list, int label, int touched) {
  return label == kNone ? root_of(list, touched) : unite(list, label, touched);
}

}  // namespace

void label_components(RunImage& image, Components& components) {
  auto& list = components.list;
  list.clear();
  list.push_back({0, 0, image.width, static_cast<int>(image.rows.size()), -1, -1, -1, false});
  const int last_row = static_cast<int>(image.rows.size()) - 1;
  for (int y = 0; y <= last_row; ++y) {
    const auto& row = image.rows[static_cast<size_t>(y)];
    const auto& above_row = image.rows[static_cast<size_t>(std::max(y - 1, 0))];
    const Run* above = image.runs.data() + above_row.first;
    int k_above = 0;
    for (int k = 0; k < row.count; ++k) {
      Run& run = image.runs[static_cast<size_t>(row.first + k)];
      const bool white = image.is_white(row, k);
      int label = kNone;
      if (y > 0) {
        // The rows are wholly covered, so the run above that holds our first column is where the last run
        // left off.
        while (true) {
          if (image.is_white(above_row, k_above) == white) label = join(list, label, above[k_above].label);
          if (above[k_above].end >= run.end) break;
          ++k_above;
        }
        if (above[k_above].end == run.end) ++k_above;
      }
      const bool at_frame = y == 0 || y == last_row || run.begin == 0 || run.end == image.width;
      if (!white && at_frame) label = join(list, label, Components::kFrame);
      const Component piece{0, run.end - run.begin, run.begin, y, run.end - 1, y, row.first + k, white};
      if (label == kNone) {
        label = static_cast<int>(list.size());
        list.push_back(piece);
        list.back().parent = label;
      } else {
        grow(list[static_cast<size_t>(label)], piece);
      }
      run.label = label;
    }
  }
  // A parent is lower than its child and therefore already a root when the child's turn comes.
  for (size_t i = 0; i < list.size(); ++i) {
    Component& c = list[i];
    c.parent = list[static_cast<size_t>(c.parent)].parent;
    if (c.parent != static_cast<int>(i)) grow(list[static_cast<size_t>(c.parent)], c);
  }
  for (Run& run : image.runs) run.label = list[static_cast<size_t>(run.label)].parent;
}

void foreground_runs(const RunImage& image, RunImage& foreground) {
  foreground.width = image.width;
  foreground.rows.clear();
  foreground.runs.clear();
  for (const auto& row : image.rows) {
    const int first = static_cast<int>(foreground.runs.size());
    bool white = false;
    for (int k = 0; k < row.count; ++k) {
      const Run& run = image.runs[static_cast<size_t>(row.first + k)];
      const bool is_foreground = run.label != Components::kFrame;
      if (k > 0 && is_foreground == white) {
        foreground.runs.back().end = run.end;
      } else {
        foreground.runs.push_back({run.begin, run.end, 0});
      }
      white = is_foreground;
    }
    const bool first_white = image.runs[static_cast<size_t>(row.first)].label != Components::kFrame;
    foreground.rows.push_back({first, static_cast<int>(foreground.runs.size()) - first, first_white});
  }
}

}  // namespace perch
