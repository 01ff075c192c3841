#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>

namespace perch {

// The paper's section 2.1.3: the four corners of a convex four-sided region from points that hold its outline
// (the ends of its rows do: every distance asked for is largest at an end of a row). The first two are
// farthest left and right of the vertical line through the centre, of equals the one farther from the centre;
// the third is farthest from the line through these two; the fourth farthest from the triangle of these
// three. Beyond the paper, each is then put where it is farthest from the line through its two neighbours.
//
// They come counterclockwise as the picture is seen (its y points down), starting anywhere. Empty when the
// points do not span a quadrilateral: fewer than four, in a line, or with a corner on the edge of the other
// three.
std::optional<std::array<Eigen::Vector2d, 4>> quad_corners(std::span<const Eigen::Vector2d> outline,
                                                           const Eigen::Vector2d& centre);

}  // namespace perch
