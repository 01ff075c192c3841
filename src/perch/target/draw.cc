#include "perch/target/draw.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace perch {
namespace {

constexpr double kMmFromM = 1000;
constexpr double kHair = 0.1;   // mm: the thinnest line that every printer prints
constexpr double kMarkGap = 1;  // mm from what a mark is for: a blade's width off is not seen on the target
constexpr double kText = 3;     // mm, height of the letters
constexpr double kTextStep = 4.5;

// Restores the state of the context, whichever way the scope is left.
class Saved {
 public:
  explicit Saved(cairo_t* cr) : cr_(cr) { cairo_save(cr_); }
  ~Saved() { cairo_restore(cr_); }
  Saved(const Saved&) = delete;
  Saved& operator=(const Saved&) = delete;

 private:
  cairo_t* cr_;
};

void set_grey(cairo_t* cr, double grey) { cairo_set_source_rgb(cr, grey, grey, grey); }

void add_quad(cairo_t* cr, const Quad& corners) {
  cairo_move_to(cr, corners[0].x(), corners[0].y());
  for (size_t k = 1; k < 4; ++k) cairo_line_to(cr, corners[k].x(), corners[k].y());
  cairo_close_path(cr);
}

void line(cairo_t* cr, double x0, double y0, double x1, double y1) {
  cairo_move_to(cr, x0, y0);
  cairo_line_to(cr, x1, y1);
  cairo_stroke(cr);
}

void write(cairo_t* cr, double x, double y, const std::string& text) {
  cairo_move_to(cr, x, y);
  cairo_show_text(cr, text.c_str());
}

void set_pen(cairo_t* cr) {
  set_grey(cr, 0);
  cairo_set_line_width(cr, kHair);
  cairo_select_font_face(cr, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(cr, kText);
}

std::string format_mm(double mm) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g mm", mm);
  return text;
}

std::string caption(const LandingTarget& target) {
  const Bounds bounds = printed_bounds(target);
  const Eigen::Vector2d extent = kMmFromM * (bounds.upper_right - bounds.lower_left);
  return target.name + "   " + format_mm(extent.x()) + " x " + format_mm(extent.y());
}

// Left of and below the window, both of the same scale as the target: whoever printed with "fit to page" sees
// it.
void draw_rulers(cairo_t* cr, const Size& page) {
  const double bottom = page.height - kPageMargin;
  const double left = kPageMargin + kRulerStrip + kMarkMargin;
  const double top = kPageMargin + kMarkMargin;
  for (int mm = 0; mm <= static_cast<int>(kRuler); ++mm) {
    const double tick = mm % 50 == 0 ? 4 : mm % 10 == 0 ? 3 : mm % 5 == 0 ? 2 : 1;
    line(cr, left + mm, bottom, left + mm, bottom - tick);
    line(cr, kPageMargin, top + mm, kPageMargin + tick, top + mm);
  }
  line(cr, left, bottom, left + kRuler, bottom);
  line(cr, kPageMargin, top, kPageMargin, top + kRuler);
  write(cr, left + 11, bottom - 4.5, "100 mm when printed at 100 % (no \"fit to page\")");
  const Saved saved(cr);
  cairo_move_to(cr, kPageMargin + 4.5 + kText * 0.7, top + kRuler - 11);
  cairo_rotate(cr, -M_PI / 2);
  cairo_show_text(cr, "100 mm when printed at 100 %");
}

// A grey hairline just outside the target's outer edge, which white ink on white paper would not show, and a
// pair of marks at each corner. In the drawing's frame, mm, y up.
void draw_cut_marks(cairo_t* cr, const Bounds& bounds) {
  const Eigen::Vector2d low = kMmFromM * bounds.lower_left, high = kMmFromM * bounds.upper_right;
  set_grey(cr, 0.6);
  cairo_rectangle(cr, low.x() - kHair / 2, low.y() - kHair / 2, high.x() - low.x() + kHair,
                  high.y() - low.y() + kHair);
  cairo_stroke(cr);
  set_grey(cr, 0);
  for (const double side : {-1.0, 1.0}) {
    const double x = side < 0 ? low.x() : high.x(), y = side < 0 ? low.y() : high.y();
    for (const double other : {low.x(), high.x()})
      line(cr, other, y + side * kMarkGap, other, y + side * kMarkMargin);
    for (const double other : {low.y(), high.y()})
      line(cr, x + side * kMarkGap, other, x + side * kMarkMargin, other);
  }
}

// Marks in the margin around a tile's window: at its corners, where it is cut, and where the next tile's edge
// comes to lie.
void draw_tile_marks(cairo_t* cr, const SheetPlan& plan, const Sheet& sheet) {
  const double left = sheet.window.x(), right = left + sheet.window_size.width;
  const double top = sheet.window.y(), bottom = top + sheet.window_size.height;
  const auto across = [&](double x) {
    line(cr, x, top - kMarkGap, x, top - kMarkMargin);
    line(cr, x, bottom + kMarkGap, x, bottom + kMarkMargin);
  };
  const auto along = [&](double y) {
    line(cr, left - kMarkGap, y, left - kMarkMargin, y);
    line(cr, right + kMarkGap, y, right + kMarkMargin, y);
  };
  across(left);
  across(right);
  along(top);
  along(bottom);
  if (sheet.column + 1 < plan.columns) across(right - kOverlap);
  if (sheet.row + 1 < plan.rows) along(bottom - kOverlap);
}

std::string label(const SheetPlan& plan, const Sheet& sheet) {
  return "row " + std::to_string(sheet.row + 1) + "/" + std::to_string(plan.rows) + " column " +
         std::to_string(sheet.column + 1) + "/" + std::to_string(plan.columns);
}

}  // namespace

void draw_target(cairo_t* cr, const LandingTarget& target) {
  const Saved saved(cr);
  // Neighbours of one colour are filled as one shape: filled one by one, antialiasing lets a hairline of the
  // ground show where they meet.
  cairo_set_fill_rule(cr, CAIRO_FILL_RULE_WINDING);
  for (size_t i = 0; i < target.patches.size(); ++i) {
    add_quad(cr, target.patches[i].corners);
    if (i + 1 < target.patches.size() && target.patches[i + 1].white == target.patches[i].white) continue;
    set_grey(cr, target.patches[i].white ? 1 : 0);
    cairo_fill(cr);
  }
}

namespace {

// In the drawing's frame. The marks come last: a white edge antialiased over the hairline would hide it.
void draw_target_and_marks(cairo_t* cr, const LandingTarget& target) {
  {
    const Saved metres(cr);
    cairo_scale(cr, kMmFromM, kMmFromM);
    draw_target(cr, target);
  }
  draw_cut_marks(cr, printed_bounds(target));
}

}  // namespace

void draw_sheet(cairo_t* cr, const LandingTarget& target, const SheetPlan& plan, size_t number) {
  const Sheet& sheet = plan.sheets.at(number);
  const Saved saved(cr);
  set_pen(cr);
  {
    const Saved window(cr);
    cairo_rectangle(cr, sheet.window.x(), sheet.window.y(), sheet.window_size.width,
                    sheet.window_size.height);
    cairo_clip(cr);
    // The drawing's frame, mm, y up.
    cairo_translate(cr, sheet.window.x(), sheet.window.y());
    cairo_scale(cr, 1, -1);
    cairo_translate(cr, -sheet.drawing.x(), -sheet.drawing.y());
    draw_target_and_marks(cr, target);
  }
  set_pen(cr);
  draw_rulers(cr, plan.page);
  std::string text = caption(target);
  if (plan.tiled()) {
    draw_tile_marks(cr, plan, sheet);
    text = label(plan, sheet) + "   " + text;
  }
  write(cr, sheet.window.x() + 2, plan.page.height - kPageMargin - 2 * kTextStep, text);
}

void draw_overview(cairo_t* cr, const LandingTarget& target, const SheetPlan& plan) {
  const Saved saved(cr);
  set_pen(cr);
  draw_rulers(cr, plan.page);
  const Sheet& first = plan.sheets.front();
  const Sheet& last = plan.sheets.back();
  const Eigen::Vector2d corner(last.drawing.x() + last.window_size.width,
                               last.drawing.y() - last.window_size.height);
  const Eigen::Vector2d extent(corner.x() - first.drawing.x(), first.drawing.y() - corner.y());

  const std::string lines[] = {
      caption(target) + "   on " + std::to_string(plan.rows) + " rows of " + std::to_string(plan.columns) +
          " sheets",
      "1. Print at 100 % and measure both rulers: 100 mm each.",
      "2. Cut the left and the upper edge of each sheet along the marks at its corners,",
      "    but not where the target ends.",
      "3. Row by row, lay each sheet over its left neighbour, its edge on the neighbour's inner marks; glue.",
      "4. Lay each row over the one above in the same way. Each seam covers " + format_mm(kOverlap) + ".",
      "5. Cut along the grey line and the marks at the target's corners; measure the whole target.",
  };
  double y = first.window.y() + kText;
  for (const std::string& text : lines) {
    write(cr, first.window.x(), y, text);
    y += kTextStep;
  }

  const Size room{first.window_size.width, first.window.y() + first.window_size.height - y};
  const double scale = std::min(room.width / extent.x(), room.height / extent.y());
  cairo_translate(cr, first.window.x(), y);
  cairo_scale(cr, scale, -scale);
  cairo_translate(cr, -first.drawing.x(), -first.drawing.y());
  cairo_set_line_width(cr, kHair / scale);
  draw_target_and_marks(cr, target);
  for (const Sheet& sheet : plan.sheets) {
    cairo_set_source_rgb(cr, 0.1, 0.5, 0.9);
    cairo_rectangle(cr, sheet.drawing.x(), sheet.drawing.y() - sheet.window_size.height,
                    sheet.window_size.width, sheet.window_size.height);
    cairo_stroke(cr);
    const Saved upright(cr);
    cairo_translate(cr, sheet.drawing.x() + sheet.window_size.width / 2,
                    sheet.drawing.y() - sheet.window_size.height / 2);
    cairo_scale(cr, 1 / scale, -1 / scale);
    write(cr, -5, kText / 2, tile_name(sheet));
  }
}

}  // namespace perch
