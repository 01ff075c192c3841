#include "perch/detection/components.h"

#include <algorithm>
#include <span>

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

// A row of runs whose labels are known.
struct RowAbove {
  std::span<const Run> runs;
  bool first_white = false;
};

// Labels the runs of row `y` by what they touch of the same colour in the row above.
//
// Colours alternate, so only every second run above is asked; and as runs cover their row, the first one
// above that our next run, of the other colour, can touch is a neighbour of the first one that lies too far
// right for this one. Nothing is searched for and no colour compared.
void label_row(const RowAbove& above, RunImage& image, int y, std::vector<Component>& list) {
  const RunImage::Row& row = image.rows[static_cast<size_t>(y)];
  const Run* const over = above.runs.data();
  const int count = static_cast<int>(above.runs.size());
  int i = row.first_white == above.first_white ? 0 : 1;
  for (int k = 0; k < row.count; ++k) {
    Run& run = image.runs[static_cast<size_t>(row.first + k)];
    if (i < count && over[i].begin < run.end) {
      run.label = over[i].label;
      for (i += 2; i < count && over[i].begin < run.end; i += 2) {
        if (over[i].label != run.label) run.label = unite(list, run.label, over[i].label);
      }
      Component& c = list[static_cast<size_t>(run.label)];
      c.area += run.end - run.begin;
      c.left = std::min(c.left, run.begin);
      c.right = std::max(c.right, run.end - 1);
      c.top = std::min(c.top, y);  // only the frame's is not yet set
      c.bottom = y;
    } else {
      run.label = static_cast<int>(list.size());
      list.push_back({run.label, run.end - run.begin, run.begin, y, run.end - 1, y, row.first + k,
                      image.is_white(row, k)});
    }
    i += i <= count && over[i - 1].end <= run.end ? 1 : -1;
  }
}

// What is black at the picture's edge is one with the frame.
void join_frame(const RunImage& image, const RunImage::Row& row, bool last_row,
                std::vector<Component>& list) {
  const int step = last_row ? 1 : std::max(row.count - 1, 1);  // else only its first and last run
  for (int k = 0; k < row.count; k += step) {
    const Run& run = image.runs[static_cast<size_t>(row.first + k)];
    if (!image.is_white(row, k)) unite(list, Components::kFrame, run.label);
  }
}

}  // namespace

void label_components(RunImage& image, Components& components) {
  auto& list = components.list;
  list.clear();
  const int rows = static_cast<int>(image.rows.size());
  list.push_back({Components::kFrame, 0, image.width, rows, -1, -1, -1, false});
  const Run frame{0, image.width, Components::kFrame};
  RowAbove above{{&frame, 1}, false};
  for (int y = 0; y < rows; ++y) {
    const RunImage::Row& row = image.rows[static_cast<size_t>(y)];
    label_row(above, image, y, list);
    join_frame(image, row, y + 1 == rows, list);
    above = {{image.runs.data() + row.first, static_cast<size_t>(row.count)}, row.first_white};
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
