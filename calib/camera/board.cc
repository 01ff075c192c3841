#include "calib/camera/board.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <sstream>
#include <stdexcept>

#include "perch/config/error.h"
#include "perch/config/section.h"

namespace perch {
namespace {

// More places a side than any board has; mrcal has two equations for each, seen or not.
constexpr int kMostPlaces = 300;

// The last digits that people write, as a part of the board's size.
constexpr double kRounding = 1e-5;

std::string size_text(int columns, int rows) { return std::to_string(columns) + "x" + std::to_string(rows); }

std::string metres(double length) {
  std::ostringstream text;
  text.precision(9);
  text << length << " m";
  return text.str();
}

// "9x6", each side 2 to 100.
std::optional<std::pair<int, int>> parse_size(const std::string& text) {
  int columns = 0, rows = 0, used = 0;
  if (std::sscanf(text.c_str(), "%4dx%4d%n", &columns, &rows, &used) != 2) return std::nullopt;
  if (static_cast<size_t>(used) != text.size() || std::min(columns, rows) < 2 ||
      std::max(columns, rows) > 100) {
    return std::nullopt;
  }
  return std::pair{columns, rows};
}

// The greatest common divisor of lengths that are known to a rounding.
double common_divisor(double a, double b, double rounding) {
  while (b > rounding) {
    const double rest = std::abs(std::remainder(a, b));
    a = b;
    b = rest;
  }
  return a;
}

LandingTarget read_kalibr(Section file) {
  int columns = 0, rows = 0;
  double size = 0, gap = 0;
  for (const char* key : {"tagCols", "tagRows", "tagSize", "tagSpacing"}) {
    if (!file.has(key)) file.fail(key, "a number of an AprilGrid");
  }
  file.read("tagCols", columns, Range{1, 50});
  file.read("tagRows", rows, Range{1, 50});
  file.read("tagSize", size, kPositive);
  file.read("tagSpacing", gap, kPositive);  // between tags, as a part of their size
  if (columns * rows > 587) file.fail("tagRows", "no more tags than tag36h11 has (587)");
  std::ostringstream yaml;
  yaml.precision(12);
  yaml << "name: aprilgrid\ntype: apriltag\nfamily: tag36h11\nborder: 2\ntags:\n";
  for (int id = 0; id < columns * rows; ++id) {
    const double step = size * (1 + gap);
    yaml << "  - {id: " << id << ", size: " << size << ", center: [" << id % columns * step + size / 2 << ", "
         << id / columns * step + size / 2 << "]}\n";
  }
  return read_target(Section::parse(yaml.str(), file.file()));
}

}  // namespace

BoardGrid grid_of_points(const std::vector<Eigen::Vector2d>& points, std::vector<GridPlace>& places) {
  if (points.size() < 4) throw std::invalid_argument("a board of fewer than four corners");
  Eigen::Vector2d low = points[0], high = points[0];
  for (const auto& p : points) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  const double extent = (high - low).maxCoeff(), rounding = kRounding * extent;
  double spacing = extent;
  for (const auto& p : points) {
    spacing = common_divisor(spacing, p.x() - low.x(), rounding);
    spacing = common_divisor(spacing, high.y() - p.y(), rounding);
  }
  const double steps = std::round(extent / spacing);
  const std::string expected =
      "a board with its corners on a grid of at most " + std::to_string(kMostPlaces) + " places a side";
  if (!(steps < kMostPlaces)) throw std::invalid_argument(expected);
  BoardGrid grid;
  grid.spacing = extent / steps;
  places.clear();
  for (const auto& p : points) {
    const Eigen::Vector2d at = Eigen::Vector2d(p.x() - low.x(), high.y() - p.y()) / grid.spacing;
    const GridPlace place{static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))};
    if ((at - Eigen::Vector2d(place.column, place.row)).norm() * grid.spacing > 2 * rounding) {
      throw std::invalid_argument(expected);
    }
    grid.columns = std::max(grid.columns, place.column + 1);
    grid.rows = std::max(grid.rows, place.row + 1);
    places.push_back(place);
  }
  return grid;
}

Board parse_board(const std::string& text, double spacing, double marker, const std::string& dictionary) {
  constexpr std::string_view kCharuco = "charuco:";
  const bool charuco = text.starts_with(kCharuco);
  const auto size = parse_size(charuco ? text.substr(kCharuco.size()) : text);
  if (!size) {
    throw std::invalid_argument(
        "expected inner corners such as 9x6, or charuco: and squares such as charuco:10x7, found \"" + text +
        '"');
  }
  const auto [columns, rows] = *size;
  if (!(spacing > 0))
    throw std::invalid_argument("expected the spacing of the corners, a length above 0 in m");
  if (!charuco) {
    return {Chessboard{columns, rows},
            {columns, rows, spacing},
            "chessboard " + size_text(columns, rows) + ", " + metres(spacing)};
  }
  if (!(marker > 0 && marker < spacing)) {
    throw std::invalid_argument(
        "expected a ChArUco board's marker size, above 0 and below the spacing of its squares");
  }
  return {CharucoBoard{columns, rows, marker / spacing, dictionary},
          {columns - 1, rows - 1, spacing},
          "ChArUco board " + size_text(columns, rows) + ", " + metres(spacing) + ", markers " +
              metres(marker) + ", " + dictionary};
}

Board board_of_target(const LandingTarget& target) {
  TargetBoard board{target, {}, {}};
  std::vector<Eigen::Vector2d> points;
  if (const auto* layout = std::get_if<SquaresLayout>(&target.layout)) {
    const TargetEdges all = target_edges(*layout, target.size);
    for (size_t i = 0; i < all.shapes.size(); ++i) {
      const TargetShape& shape = all.shapes[i];
      // The hole of a nested target and all after it are on the finer grid.
      if (shape.kind == ShapeKind::kHole || shape.inner) break;
      board.edges.shapes.push_back(shape);
      for (size_t k = 0; k < 4; ++k) board.edges.edges.push_back(all.edges[4 * i + k]);
    }
    // The outline comes last: its edges are measured no more than its corners.
    if (!board.edges.shapes.empty() && board.edges.shapes.back().kind == ShapeKind::kOutline) {
      board.edges.shapes.pop_back();
      board.edges.edges.resize(board.edges.edges.size() - 4);
    }
    for (const TargetShape& shape : board.edges.shapes) {
      const Eigen::Vector2d half(shape.side / 2, shape.side / 2);
      for (const auto& corner : square_corners(shape.centre - half, shape.side)) points.push_back(corner);
    }
  } else {
    for (const Feature& feature : target.features) points.push_back(feature.point);
  }
  const BoardGrid grid = grid_of_points(points, board.places);
  const std::string text = "target " + target.name + ", " + std::to_string(points.size()) + " corners, " +
                           size_text(grid.columns, grid.rows) + " places of " + metres(grid.spacing);
  return {std::move(board), grid, text};
}

Board read_board(const std::filesystem::path& file) {
  Section section = Section::load(file);
  try {
    if (!section.has("target_type")) return board_of_target(read_target(section));
    std::string type;
    section.read("target_type", type);
    if (type != "aprilgrid")
      section.fail("target_type", "aprilgrid (a chessboard is --board with --spacing)");
    return board_of_target(read_kalibr(section));
  } catch (const std::invalid_argument& e) {
    throw ConfigError(file.string() + ": " + e.what());
  }
}

}  // namespace perch
