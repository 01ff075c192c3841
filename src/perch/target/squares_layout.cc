#include <algorithm>
#include <cctype>
#include <sstream>

#include "perch/target/layouts.h"

namespace perch {
namespace {

// Shapes nearer than this touch, in modules: a decimal fraction of a module may be off by rounding alone.
constexpr double kTouch = 1e-9;

// One square as the file gives it, in modules from the outer border's lower left corner.
struct Cell {
  std::string label;
  double column = 0, row = 0, side = 0;
};

std::string text(double number) {
  std::ostringstream stream;
  stream << number;
  return stream.str();
}

std::string extent(const Cell& cell) {
  return "columns " + text(cell.column) + " to " + text(cell.column + cell.side) + ", rows " +
         text(cell.row) + " to " + text(cell.row + cell.side);
}

bool apart(const Cell& a, const Cell& b) {
  const auto gap = [](double low_a, double side_a, double low_b, double side_b) {
    return std::max(low_b - (low_a + side_a), low_a - (low_b + side_b));
  };
  return std::max(gap(a.column, a.side, b.column, b.side), gap(a.row, a.side, b.row, b.side)) > kTouch;
}

std::string lower_case(std::string label) {
  for (char& c : label) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return label;
}

double read_border(Section& section, int modules) {
  double border = 0;
  require(section, "border", "the width of the white border in modules");
  section.read("border", border, kPositive);
  if (2 * border >= modules - kTouch) {
    section.fail("border",
                 "less than half of the " + std::to_string(modules) + " modules, to leave an interior");
  }
  return border;
}

// In alphabetical order, inside the border, clear of each other.
std::vector<Cell> read_cells(Section& section, int modules, double border) {
  require(section, "squares", "label: [column, row, side] of at least one square");
  Section squares = section.section("squares");
  std::vector<std::string> labels = squares.keys();
  if (labels.empty()) section.fail("squares", "label: [column, row, side] of at least one square", "none");
  std::sort(labels.begin(), labels.end());

  std::vector<Cell> cells;
  const double low = border, high = modules - border;
  for (const std::string& label : labels) {
    std::vector<double> numbers;
    squares.read(label, numbers, 3);
    const Cell cell{label, numbers[0], numbers[1], numbers[2]};
    if (!(cell.side > 0)) squares.fail(label, "a side above 0 modules", text(cell.side));
    if (std::min(cell.column, cell.row) <= low + kTouch ||
        std::max(cell.column, cell.row) + cell.side >= high - kTouch) {
      squares.fail(
          label,
          "a square between " + text(low) + " and " + text(high) + ", clear of the border's inner edge",
          extent(cell));
    }
    for (const Cell& other : cells) {
      if (!apart(cell, other)) {
        squares.fail(label, "a square clear of " + other.label + " (" + extent(other) + ")", extent(cell));
      }
    }
    cells.push_back(cell);
  }
  squares.done();
  return cells;
}

struct NestedCell {
  std::string in;
  double column = 0, row = 0;  // of the common centre
  double hole = 0, inner = 0;
};

NestedCell read_nested(Section& nested, const std::vector<Cell>& cells) {
  NestedCell result;
  nested.read("in", result.in);
  const auto outer =
      std::find_if(cells.begin(), cells.end(), [&](const Cell& c) { return c.label == result.in; });
  if (outer == cells.end()) nested.fail("in", "the label of one of the squares");
  result.column = outer->column + outer->side / 2;
  result.row = outer->row + outer->side / 2;

  require(nested, "hole", "the side of the black hole in modules");
  nested.read("hole", result.hole, kPositive);
  if (result.hole >= outer->side - kTouch) {
    nested.fail("hole", "less than the side of square " + result.in + ", " + text(outer->side) + " modules");
  }
  require(nested, "inner", "the outer side of the inner target in modules");
  nested.read("inner", result.inner, kPositive);
  if (result.inner >= result.hole - kTouch) {
    nested.fail("inner", "less than the hole, " + text(result.hole) + " modules");
  }
  nested.done();
  return result;
}

// The inner target's features are named in lower case, which must not be a name of the outer ones.
void check_names(const Section& section, const std::vector<Cell>& cells) {
  for (const Cell& cell : cells) {
    for (const Cell& other : cells) {
      if (lower_case(cell.label) != other.label) continue;
      section.fail("squares", "labels in capital letters, as the inner target takes the small ones",
                   other.label);
    }
  }
}

void add_square(const Square& square, LandingTarget& target) {
  const Quad corners = square_corners(square.lower_left, square.side);
  for (size_t k = 0; k < 4; ++k) {
    target.features.push_back({corners[k], square.label + std::to_string(k)});
  }
  target.patches.push_back({corners, true});
}

// A white border with its black interior and white squares, `scale` times the outer target, about `centre`.
void add_target(const SquaresLayout& layout, double size, double scale, const Eigen::Vector2d& centre,
                LandingTarget& target) {
  const auto centred = [&](double side) {
    return square_corners(centre - Eigen::Vector2d::Constant(side / 2), side);
  };
  target.patches.push_back({centred(scale * size), true});
  target.patches.push_back({centred(scale * (size - 2 * layout.border)), false});
  for (const Square& square : layout.squares) {
    const std::string label = scale < 1 ? lower_case(square.label) : square.label;
    add_square({label, centre + scale * square.lower_left, scale * square.side}, target);
  }
}

}  // namespace

void read_squares(Section& section, LandingTarget& target) {
  require(section, "size", "the outer side of the white border in m");
  section.read("size", target.size, kPrintable);
  SquaresLayout layout;
  require(section, "modules", "the side of the drawing grid in modules");
  section.read("modules", layout.modules, Range{3, 10000});
  section.read_choice("outer_edge", layout.outer_edge_printed, {{"printed", true}, {"cut", false}});
  const double border = read_border(section, layout.modules);
  const std::vector<Cell> cells = read_cells(section, layout.modules, border);

  const double module = target.size / layout.modules;  // m
  const auto from_modules = [&](double column, double row) -> Eigen::Vector2d {
    return module * Eigen::Vector2d(column - layout.modules / 2.0, row - layout.modules / 2.0);
  };
  layout.border = border * module;
  for (const Cell& cell : cells) {
    layout.squares.push_back({cell.label, from_modules(cell.column, cell.row), cell.side * module});
  }
  add_target(layout, target.size, 1, Eigen::Vector2d::Zero(), target);

  if (Section inner = section.section("nested"); !inner.keys().empty()) {
    const NestedCell nested = read_nested(inner, cells);
    check_names(section, cells);
    const Eigen::Vector2d centre = from_modules(nested.column, nested.row);
    layout.nested = Nested{nested.in, centre, nested.hole * module, nested.inner * module};
    const Eigen::Vector2d half = Eigen::Vector2d::Constant(layout.nested->hole / 2);
    target.patches.push_back({square_corners(centre - half, layout.nested->hole), false});
    add_target(layout, target.size, nested.inner / layout.modules, centre, target);
  }
  target.layout = layout;
}

}  // namespace perch
