#pragma once

#include <Eigen/Core>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "perch/config/section.h"

namespace perch {

// The landing target: what is printed on the pad, and which of its points are measured. All lengths in m, in
// the `target` frame: origin at the centre of the outer border, x right, y up on the printed face, z out of
// the face towards the camera. Everything lies in the plane z = 0.

using Quad =
    std::array<Eigen::Vector2d, 4>;  // upper right, upper left, lower left, lower right: counterclockwise

// A quadrilateral of one colour. Painted in their order, later over earlier, patches draw the whole target.
// Neighbours of one colour that follow one another abut, so who antialiases paints them as one shape.
struct Patch {
  Quad corners;
  bool white = false;
};

// A corner that the detectors measure.
//   1 --- 0     the order in each square as the camera sees the face; features of one square are adjacent,
//   |     |     squares in alphabetical order (sharp: A0..A3 are features 0..3, F3 is feature 23).
//   2 --- 3     A tag's corners have the same order; its feature 4 i + k is corner k of tags[i], the tag
//   standing
//               upright as libapriltag prints it (yaw turns the names with it). A nested target's inner
//               squares follow the outer ones, in the same order.
// libapriltag's apriltag_detection_t.p starts at the lower left and goes the same way round: feature 4 i + k
// is p[(k + 2) % 4].
struct Feature {
  Eigen::Vector2d point;
  std::string name;  // "A0", "F3"; "a2" of a nested inner square; "tag7.2"
};

// The schema of configs/targets/sharp.yaml in m.
struct Square {
  std::string label;
  Eigen::Vector2d lower_left = Eigen::Vector2d::Zero();
  double side = 0;
};
struct Nested {
  std::string in;                                    // the label of the square the inner target lies in
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();  // of that square, the hole and the inner target alike
  double hole = 0;                                   // side of the black hole, m
  double size = 0;                                   // outer side of the inner target's white border, m
};
struct SquaresLayout {
  int modules = 20;
  double border = 0;               // width of the white border, m
  bool outer_edge_printed = true;  // false: `outer_edge: cut`, the outer edge must not be measured with
  std::vector<Square> squares;     // in alphabetical order
  std::optional<Nested> nested;
};

struct Tag {
  int id = 0;
  double size = 0;  // side of the square whose corners libapriltag reports: the black border's outer edge; of
                    // the families with a white border (tagStandard, tagCircle, tagCustom) that one's, m
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  double yaw = 0;  // rad, counterclockwise on the face
};
struct AprilTagBoard {
  std::string family;     // tag36h11, tag25h9, tag16h5, tagStandard41h12, ... as libapriltag names them
  int border = 1;         // width of the black border in modules: 2 on Kalibr's AprilGrids
  std::vector<Tag> tags;  // in the file's order
};

struct LandingTarget {
  std::string name;
  double size = 0;  // outer side of the white border; of a board: the longer side of what is printed, with
                    // the white margin around its tags, m
  std::variant<SquaresLayout, AprilTagBoard> layout;
  std::vector<Feature> features;
  std::vector<Patch> patches;  // on a ground of any colour
};

// Reads and checks a target file: squares that overlap, touch or leave the border, a hole that does not fit,
// ids the family has not, are ConfigErrors with file, line and cause. Features and patches are filled in.
// Without `name` the target is called as its file.
LandingTarget read_target(const std::filesystem::path& file);
LandingTarget read_target(Section section);

// The smallest axis-parallel box around all patches: what the printer has to reach.
struct Bounds {
  Eigen::Vector2d lower_left = Eigen::Vector2d::Zero();
  Eigen::Vector2d upper_right = Eigen::Vector2d::Zero();
};
Bounds printed_bounds(const LandingTarget& target);

// The corners of an axis-parallel square, in Quad's order.
inline Quad square_corners(const Eigen::Vector2d& lower_left, double side) {
  return {lower_left + Eigen::Vector2d(side, side), lower_left + Eigen::Vector2d(0, side), lower_left,
          lower_left + Eigen::Vector2d(side, 0)};
}

}  // namespace perch
