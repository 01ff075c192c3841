#include "perch/target/tag_shape.h"

#include <algorithm>

namespace perch {
namespace {

Quad centred_square(double side) { return square_corners(Eigen::Vector2d::Constant(-side / 2), side); }

// The data cells in modules from the upper left corner of the edge square, y down, as libapriltag counts.
struct DataCell {
  int column = 0, row = 0;
  bool white = false;
};

std::vector<DataCell> data_cells(const apriltag_family_t& family, int id) {
  std::vector<DataCell> cells;
  const uint64_t code = family.codes[id];
  for (uint32_t i = 0; i < family.nbits; ++i) {
    // The first bit location is the code's highest bit. Cells outside a white border are left or above of it.
    cells.push_back({static_cast<int>(family.bit_x[i]), static_cast<int>(family.bit_y[i]),
                     ((code >> (family.nbits - i - 1)) & 1) == 1});
  }
  return cells;
}

// One patch for each run of a colour in a row.
void add_runs(std::vector<DataCell> cells, bool white, double edge, std::vector<Patch>& patches) {
  std::erase_if(cells, [&](const DataCell& cell) { return cell.white != white; });
  std::sort(cells.begin(), cells.end(), [](const DataCell& a, const DataCell& b) {
    return a.row != b.row ? a.row < b.row : a.column < b.column;
  });
  for (size_t begin = 0, end; begin < cells.size(); begin = end) {
    end = begin + 1;
    while (end < cells.size() && cells[end].row == cells[begin].row &&
           cells[end].column == cells[end - 1].column + 1) {
      ++end;
    }
    const double left = cells[begin].column - edge / 2, right = cells[end - 1].column + 1 - edge / 2;
    const double top = edge / 2 - cells[begin].row, bottom = top - 1;
    patches.push_back({{{{right, top}, {left, top}, {left, bottom}, {right, bottom}}}, white});
  }
}

}  // namespace

TagShape tag_shape(const apriltag_family_t& family, int id, int border) {
  TagShape shape;
  shape.edge = family.width_at_border;
  const std::vector<DataCell> cells = data_cells(family, id);
  if (has_black_border(family)) {
    shape.footprint = shape.edge;
    shape.quiet_zone = 1;
    shape.patches.push_back({centred_square(shape.edge), false});
    add_runs(cells, true, shape.edge, shape.patches);
    return shape;
  }
  shape.footprint = family.total_width;
  // How far the nearest datum inside the white ring is from the centre, along the axis it is farther on.
  double nearest = shape.edge / 2 - border;
  for (const DataCell& cell : cells) {
    const double x = std::abs(cell.column + 0.5 - shape.edge / 2) - 0.5;
    const double y = std::abs(cell.row + 0.5 - shape.edge / 2) - 0.5;
    nearest = std::min(nearest, std::max(x, y));
  }
  shape.free_centre = std::max(0.0, 2 * nearest);

  // A black ring around a white one, a module each, and data inside and outside of them. No colour
  // is painted over the other next to its own: antialiasing would leave a line where they meet.
  std::vector<DataCell> inner, outer;
  for (const DataCell& cell : cells) {
    const bool inside = std::min(cell.column, cell.row) >= 0 && std::max(cell.column, cell.row) < shape.edge;
    (inside ? inner : outer).push_back(cell);
  }
  shape.patches.push_back({centred_square(shape.edge + 2), false});
  add_runs(outer, false, shape.edge, shape.patches);
  shape.patches.push_back({centred_square(shape.edge), true});
  add_runs(outer, true, shape.edge, shape.patches);
  if (shape.free_centre > 0) shape.patches.push_back({centred_square(shape.free_centre), false});
  add_runs(inner, false, shape.edge, shape.patches);
  return shape;
}

}  // namespace perch
