#include "perch/target/draw.h"

#include <gtest/gtest.h>

#include <functional>
#include <optional>
#include <set>
#include <utility>

#include "target/raster.h"

namespace perch {
namespace {

const std::filesystem::path kTargets = std::filesystem::path(PERCH_SOURCE_DIR) / "configs" / "targets";

// A page as a grey picture.
class PageRaster {
 public:
  PageRaster(const Size& page, double per_mm, const std::function<void(cairo_t*)>& draw)
      : per_mm_(per_mm),
        surface_(cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(page.width * per_mm),
                                            static_cast<int>(page.height * per_mm))) {
    cairo_t* cr = cairo_create(surface_);
    cairo_set_source_rgb(cr, 1, 1, 1);
    cairo_paint(cr);
    cairo_scale(cr, per_mm, per_mm);
    draw(cr);
    EXPECT_EQ(cairo_status(cr), CAIRO_STATUS_SUCCESS);
    cairo_destroy(cr);
    cairo_surface_flush(surface_);
  }
  ~PageRaster() { cairo_surface_destroy(surface_); }
  PageRaster(const PageRaster&) = delete;
  PageRaster& operator=(const PageRaster&) = delete;

  int width() const { return cairo_image_surface_get_width(surface_); }
  int height() const { return cairo_image_surface_get_height(surface_); }
  int pixel(int x, int y) const {
    return cairo_image_surface_get_data(surface_)[y * cairo_image_surface_get_stride(surface_) + 4 * x];
  }
  int at_mm(double x, double y) const {
    return pixel(static_cast<int>(x * per_mm_), static_cast<int>(y * per_mm_));
  }

 private:
  double per_mm_;
  cairo_surface_t* surface_;
};

TEST(Draw, AModuleIsSizeOverModulesToAFractionOfAPixel) {
  // 100 dpi is no whole number of pixels a module: an edge's place shows in the grey of its pixel.
  const double per_metre = 100 / 0.0254;
  const Raster raster = raster_of(read_target(kTargets / "sharp.yaml"), per_metre, 0, 1);
  const auto black_length = [&](double x0, double x1, double y) {
    const int row = static_cast<int>(raster.pixel({0, y}).y());
    double sum = 0;
    for (int x = static_cast<int>(raster.pixel({x0, 0}).x()); x < static_cast<int>(raster.pixel({x1, 0}).x());
         ++x) {
      sum += 1 - raster.grey[static_cast<size_t>(row * raster.width + x)] / 255.0;
    }
    return sum / per_metre;
  };
  // cairo's 256 levels of coverage along a row: two edges, rounded to 1/256 pixel of 0.25 mm each, and to a
  // grey level of 255: 0.004 mm.
  EXPECT_NEAR(black_length(-0.5, 0.5, -0.3), 0.7, 4e-6);   // the interior: 14 modules
  EXPECT_NEAR(black_length(-0.2, 0.0, -0.2), 0.1, 4e-6);   // between D and E: 2 modules
  EXPECT_NEAR(black_length(-0.5, -0.2, -0.2), 0.1, 4e-6);  // between border and D: 2 modules
}

TEST(Draw, NeighbouringModulesOfATagShowNoSeam) {
  // Both are 10 modules of 0.1 m; the second has data on both sides of a white border.
  for (const char* tag : {"family: tag36h11\ntags: [{id: 0, size: 0.8}]",
                          "family: tagCustom48h12\ntags: [{id: 0, size: 0.6}]"}) {
    const LandingTarget target = read_target(Section::parse(std::string("type: apriltag\n") + tag, "t.yaml"));
    // 29.6 px a module: hardly one begins with a pixel, so seams show. Two whole pixels: no grey at all.
    const Raster raster = raster_of(target, 296, 0, 1);
    const Raster exact = raster_of(target, 20, 0, 1);
    for (const uint8_t grey : exact.grey) EXPECT_TRUE(grey == 0 || grey == 255) << int{grey};
    for (int row = 1; row < 20; ++row) {
      for (int column = 1; column < 20; ++column) {
        const auto at = [&](int r, int c) { return exact.grey[static_cast<size_t>(r * exact.width + c)]; };
        // A point between four pixels of one colour is inside that colour.
        const int colour = at(row, column);
        if (at(row - 1, column) != colour || at(row, column - 1) != colour ||
            at(row - 1, column - 1) != colour)
          continue;
        EXPECT_EQ(raster.at(Eigen::Vector2d(-0.5 + column * 0.05, 0.5 - row * 0.05)), colour)
            << tag << " at " << row << ' ' << column;
      }
    }
  }
}

TEST(Draw, TilesTogetherShowEveryEdgeInItsPlace) {
  const LandingTarget target = read_target(kTargets / "sharp.yaml");
  const SheetPlan plan = plan_sheets(printed_bounds(target), Paper::kA4);
  constexpr double kSide = 0.5;  // mm from an edge: two pixels, so that none is grey
  std::set<std::pair<size_t, double>> seen;
  for (size_t n = 0; n < plan.sheets.size(); ++n) {
    const Sheet& sheet = plan.sheets[n];
    const PageRaster page(plan.page, 4, [&](cairo_t* cr) { draw_sheet(cr, target, plan, n); });
    // The colour at a point of the drawing, mm; nothing where this sheet does not show it.
    const auto grey_at = [&](const Eigen::Vector2d& p) -> std::optional<int> {
      const double x = p.x() - sheet.drawing.x(), y = sheet.drawing.y() - p.y();
      if (std::min(x, y) < kSide || x > sheet.window_size.width - kSide ||
          y > sheet.window_size.height - kSide) {
        return std::nullopt;
      }
      return page.at_mm(sheet.window.x() + x, sheet.window.y() + y);
    };
    for (size_t i = 0; i < target.features.size(); ++i) {
      const size_t next = i % 4 == 3 ? i - 3 : i + 1;
      const Eigen::Vector2d a = 1000 * target.features[i].point, b = 1000 * target.features[next].point;
      const Eigen::Vector2d along = (b - a).normalized(), outward(along.y(), -along.x());
      for (const double t : {0.1, 0.3, 0.5, 0.7, 0.9}) {
        const auto inside = grey_at(a + t * (b - a) - kSide * outward);
        const auto outside = grey_at(a + t * (b - a) + kSide * outward);
        if (!inside || !outside) continue;
        EXPECT_EQ(*inside, 255) << tile_name(sheet) << ' ' << target.features[i].name << ' ' << t;
        EXPECT_EQ(*outside, 0) << tile_name(sheet) << ' ' << target.features[i].name << ' ' << t;
        seen.insert({i, t});
      }
    }
  }
  EXPECT_EQ(seen.size(), 24u * 5u);
}

TEST(Draw, NoInkReachesThePageMargin) {
  for (const char* file : {"sharp.yaml", "aprilgrid_6x6.yaml"}) {
    const LandingTarget target = read_target(kTargets / file);
    for (const Paper paper : {Paper::kA4, Paper::kLetter}) {
      const SheetPlan plan = plan_sheets(printed_bounds(target), paper);
      const auto expect_white_margin = [&](const PageRaster& page) {
        // A line on the edge reaches half its width out.
        const int margin = static_cast<int>((kPageMargin - 0.5) * 2);
        int inked = 0;
        for (int y = 0; y < page.height(); ++y) {
          for (int x = 0; x < page.width(); ++x) {
            const bool in_margin = std::min({x, y, page.width() - 1 - x, page.height() - 1 - y}) < margin;
            inked += in_margin && page.pixel(x, y) != 255 ? 1 : 0;
          }
        }
        EXPECT_EQ(inked, 0) << file;
      };
      expect_white_margin(PageRaster(plan.page, 2, [&](cairo_t* cr) { draw_overview(cr, target, plan); }));
      for (size_t i = 0; i < plan.sheets.size(); ++i) {
        expect_white_margin(PageRaster(plan.page, 2, [&](cairo_t* cr) { draw_sheet(cr, target, plan, i); }));
      }
    }
  }
}

TEST(Draw, WhiteOnWhiteShowsWhereToCut) {
  const LandingTarget target =
      read_target(Section::parse("size: 0.1\nmodules: 9\nborder: 1\nsquares: {A: [4, 4, 1]}\n", "t.yaml"));
  const SheetPlan plan = plan_sheets(printed_bounds(target), Paper::kNone);
  const double per_mm = 10;
  const Sheet& sheet = plan.sheets[0];
  const PageRaster page(plan.page, per_mm, [&](cairo_t* cr) { draw_sheet(cr, target, plan, 0); });
  const double left = sheet.window.x() + kMarkMargin, top = sheet.window.y() + kMarkMargin;
  // The hairline is one pixel, just outside the target; within is the border's white.
  EXPECT_LT(page.at_mm(left - 0.05, top + 30), 200);
  EXPECT_EQ(page.at_mm(left + 0.15, top + 30), 255);
  EXPECT_EQ(page.at_mm(left - 0.25, top + 30), 255);
  EXPECT_LT(page.at_mm(left + 30, top - 0.05), 200);
  // A mark in line with the edge, a millimetre away from the corner.
  EXPECT_LT(page.at_mm(left - 3, top), 200);
  EXPECT_LT(page.at_mm(left, top - 3), 200);
}

TEST(Draw, RulersAreAHundredMillimetresInBothDirections) {
  const LandingTarget target = read_target(kTargets / "sharp.yaml");
  const SheetPlan plan = plan_sheets(printed_bounds(target), Paper::kA4);
  const PageRaster page(plan.page, 10, [&](cairo_t* cr) { draw_sheet(cr, target, plan, 0); });
  const auto dark_run = [&](int x, int y, int dx, int dy) {  // from the first dark pixel to the last, mm
    int first = -1, last = -1;
    for (int n = 0; x < page.width() && y < page.height(); ++n, x += dx, y += dy) {
      if (page.pixel(x, y) > 200) continue;
      if (first < 0) first = n;
      last = n;
    }
    return (last - first + 1) / 10.0;
  };
  // The end ticks add half a line of 0.1 mm each, and grey pixels up to two more of 0.1 mm.
  const int bottom = static_cast<int>((plan.page.height - kPageMargin - 0.7) * 10);
  EXPECT_NEAR(dark_run(0, bottom, 1, 0), 100.1, 0.2);
  EXPECT_NEAR(dark_run(static_cast<int>((kPageMargin + 0.7) * 10), 0, 0, 1), 100.1, 0.2);
}

}  // namespace
}  // namespace perch
