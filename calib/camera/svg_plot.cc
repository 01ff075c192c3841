#include "calib/camera/svg_plot.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

// Blue, green, yellow, red.
std::string heat(double part) {
  constexpr double kStops[4][3] = {{49, 84, 160}, {60, 160, 120}, {240, 200, 70}, {200, 45, 45}};
  const double at = 3 * std::clamp(part, 0., 1.);
  const int i = std::min(2, static_cast<int>(at));
  std::string colour = "rgb(";
  for (int k = 0; k < 3; ++k) {
    const double value = kStops[i][k] + (at - i) * (kStops[i + 1][k] - kStops[i][k]);
    colour += std::to_string(static_cast<int>(value)) + (k < 2 ? "," : ")");
  }
  return colour;
}

std::string rectangle(double x, double y, double w, double h, const std::string& colour) {
  return "<rect x='" + fixed(x, 1) + "' y='" + fixed(y, 1) + "' width='" + fixed(w, 1) + "' height='" +
         fixed(h, 1) + "' fill='" + colour + "'/>";
}

std::string label(double x, double y, double size, const std::string& anchor, const std::string& text) {
  return "<text x='" + fixed(x, 1) + "' y='" + fixed(y, 1) + "' font-size='" + fixed(size, 1) +
         "' text-anchor='" + anchor + "' fill='var(--muted)'>" + escaped(text) + "</text>";
}

}  // namespace

std::string escaped(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    switch (c) {
      case '&':
        safe += "&amp;";
        break;
      case '<':
        safe += "&lt;";
        break;
      case '>':
        safe += "&gt;";
        break;
      case '"':
        safe += "&quot;";
        break;
      case '\'':
        safe += "&#39;";
        break;
      default:
        safe += c;
    }
  }
  return safe;
}

std::string fixed(double value, int digits) {
  if (!std::isfinite(value)) return std::isnan(value) ? "unknown" : "unbounded";
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", digits, value);
  return text;
}

std::string picture_svg(int width, int height, const std::string& inside) {
  const std::string w = std::to_string(width), h = std::to_string(height);
  return "<svg viewBox='-1 -1 " + std::to_string(width + 2) + " " + std::to_string(height + 2) +
         "' style='width:100%;max-width:420px'><rect width='" + w + "' height='" + h +
         "' fill='var(--grid)' stroke='var(--muted)' stroke-width='" + fixed(width / 640., 2) + "'/>" +
         inside + "</svg>";
}

std::string dot(const Eigen::Vector2d& at, double radius, const std::string& colour) {
  return "<circle cx='" + fixed(at.x(), 1) + "' cy='" + fixed(at.y(), 1) + "' r='" + fixed(radius, 1) +
         "' fill='" + colour + "'/>";
}

std::string line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const std::string& colour,
                 double width) {
  return "<path d='M" + fixed(from.x(), 1) + " " + fixed(from.y(), 1) + "L" + fixed(to.x(), 1) + " " +
         fixed(to.y(), 1) + "' stroke='" + colour + "' stroke-width='" + fixed(width, 1) + "'/>";
}

std::string map_svg(int width, int height, const SensorMap& map, double most, const std::string& unit) {
  std::string cells;
  const double w = static_cast<double>(width) / map.columns, h = static_cast<double>(height) / map.rows;
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.columns; ++column) {
      const double value = map.at(column, row);
      if (!std::isnan(value)) cells += rectangle(column * w, row * h, w + 1, h + 1, heat(value / most));
    }
  }
  std::string scale = "<svg viewBox='0 0 420 34' style='width:100%;max-width:420px'>";
  for (int i = 0; i < 40; ++i) scale += rectangle(60 + 7.5 * i, 4, 8, 10, heat(i / 39.));
  scale += label(60, 29, 13, "middle", "0") + label(210, 29, 13, "middle", fixed(most / 2, 2)) +
           label(360, 29, 13, "middle", fixed(most, 2) + " " + unit + " or more") + "</svg>";
  return picture_svg(width, height, cells) + scale;
}

std::string curves_svg(const std::vector<Curve>& curves, const std::string& x_label,
                       const std::string& y_label) {
  constexpr double kLeft = 52, kRight = 410, kTop = 8, kBottom = 200;
  Eigen::Vector2d low(1e300, 0), high(-1e300, 1e-12);
  for (const auto& curve : curves) {
    for (const auto& p : curve.points) low = low.cwiseMin(p), high = high.cwiseMax(p);
  }
  const auto place = [&](const Eigen::Vector2d& p) -> Eigen::Vector2d {
    return {kLeft + (p.x() - low.x()) / std::max(1e-12, high.x() - low.x()) * (kRight - kLeft),
            kBottom - (p.y() - low.y()) / (high.y() - low.y()) * (kBottom - kTop)};
  };
  std::string svg = "<svg viewBox='0 0 420 240' style='width:100%;max-width:420px'>";
  for (const auto& curve : curves) {
    std::string path;
    const double width = (kRight - kLeft) / std::max(1.0, static_cast<double>(curve.points.size()));
    for (const auto& p : curve.points) {
      const Eigen::Vector2d at = place(p);
      if (curve.bars) {
        const double zero = place({p.x(), 0}).y();
        svg += rectangle(at.x() - width / 2, std::min(at.y(), zero), width - 0.5, std::abs(zero - at.y()),
                         curve.colour);
      } else {
        path += (path.empty() ? "M" : "L") + fixed(at.x(), 1) + " " + fixed(at.y(), 1);
      }
    }
    if (!path.empty())
      svg += "<path d='" + path + "' fill='none' stroke='" + curve.colour + "' stroke-width='2'/>";
  }
  svg += "<path d='M52 8V200H410' fill='none' stroke='var(--muted)'/>";
  for (const double part : {0., 0.5, 1.}) {
    const Eigen::Vector2d value = low + part * (high - low);
    const int digits = high.x() - low.x() > 20 ? 0 : 2, y_digits = high.y() - low.y() > 20 ? 0 : 2;
    svg += label(kLeft + part * (kRight - kLeft), 216, 12, part == 1 ? "end" : "middle",
                 fixed(value.x(), digits));
    svg += label(kLeft - 6, kBottom - part * (kBottom - kTop) + 4, 12, "end", fixed(value.y(), y_digits));
  }
  return svg + label(230, 234, 12, "middle", x_label + "; upwards: " + y_label) + "</svg>";
}

}  // namespace perch
