#include "perch/target/sheet.h"

#include <algorithm>
#include <cmath>

namespace perch {
namespace {

constexpr double kMmFromM = 1000;
// What a page has beside its window.
constexpr Size kFurniture{2 * kPageMargin + kRulerStrip + 2 * kMarkMargin,
                          2 * kPageMargin + kFoot + 2 * kMarkMargin};
const Eigen::Vector2d kWindow(kPageMargin + kRulerStrip + kMarkMargin, kPageMargin + kMarkMargin);

int tiles(double length, double window) {
  if (length <= window) return 1;
  // Less than a micrometre is rounding, not worth a sheet.
  return 1 + static_cast<int>(std::ceil((length - window - 1e-3) / (window - kOverlap)));
}

SheetPlan plan_on(Size page, Size drawing, const Eigen::Vector2d& centre) {
  SheetPlan plan;
  plan.page = page;
  const Size window{page.width - kFurniture.width, page.height - kFurniture.height};
  plan.columns = tiles(drawing.width, window.width);
  plan.rows = tiles(drawing.height, window.height);
  const Eigen::Vector2d step(window.width - kOverlap, window.height - kOverlap);
  const Eigen::Vector2d all(window.width + (plan.columns - 1) * step.x(),
                            window.height + (plan.rows - 1) * step.y());
  const Eigen::Vector2d upper_left = centre + Eigen::Vector2d(-all.x() / 2, all.y() / 2);
  for (int row = 0; row < plan.rows; ++row) {
    for (int column = 0; column < plan.columns; ++column) {
      const Eigen::Vector2d corner = upper_left + Eigen::Vector2d(column * step.x(), -row * step.y());
      plan.sheets.push_back({row, column, kWindow, window, corner});
    }
  }
  return plan;
}

}  // namespace

std::string tile_name(const Sheet& sheet) {
  std::string name("r");
  name += std::to_string(sheet.row + 1);
  return name + "c" + std::to_string(sheet.column + 1);
}

Size page_size(Paper paper) {
  switch (paper) {
    case Paper::kNone:
      return {};
    case Paper::kA4:
      return {210, 297};
    case Paper::kA3:
      return {297, 420};
    case Paper::kLetter:
      return {215.9, 279.4};
  }
  return {};
}

SheetPlan plan_sheets(const Bounds& target, Paper paper) {
  const Eigen::Vector2d extent = kMmFromM * (target.upper_right - target.lower_left);
  const Eigen::Vector2d centre = kMmFromM / 2 * (target.upper_right + target.lower_left);
  const Size drawing{extent.x() + 2 * kMarkMargin, extent.y() + 2 * kMarkMargin};
  if (paper == Paper::kNone) {
    const Size page{std::max(drawing.width, kRuler) + kFurniture.width,
                    std::max(drawing.height, kRuler) + kFurniture.height};
    return plan_on(page, drawing, centre);
  }
  const Size upright = page_size(paper);
  SheetPlan plan = plan_on(upright, drawing, centre);
  SheetPlan across = plan_on({upright.height, upright.width}, drawing, centre);
  return across.sheets.size() < plan.sheets.size() ? across : plan;
}

}  // namespace perch
