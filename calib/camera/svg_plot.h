#pragma once

#include <string>
#include <vector>

#include "calib/camera/lens_covariance.h"

namespace perch {

// Drawings of the report: SVG text by hand, in CSS colours of the report's page.

// A text in which no character means anything to HTML.
std::string escaped(const std::string& text);
std::string fixed(double value, int digits);

// The picture's frame with what is drawn in it, in its own pixels; 420 CSS px wide at most.
std::string picture_svg(int width, int height, const std::string& inside);
std::string dot(const Eigen::Vector2d& at, double radius, const std::string& colour);
std::string line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const std::string& colour,
                 double width);

// A map in colours from blue (0) to red (`most` and above), grey where there is nothing, and its scale below.
std::string map_svg(int width, int height, const SensorMap& map, double most, const std::string& unit);

struct Curve {
  std::vector<Eigen::Vector2d> points;
  std::string colour;
  bool bars = false;  // from 0 up, as wide as the points are apart
};
// In axes that hold all of it.
std::string curves_svg(const std::vector<Curve>& curves, const std::string& x_label,
                       const std::string& y_label);

}  // namespace perch
