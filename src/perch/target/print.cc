#include "perch/target/print.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>

#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>

#include "perch/config/atomic_file.h"
#include "perch/target/draw.h"
#include "perch/target/png_resolution.h"

namespace perch {
namespace {

namespace fs = std::filesystem;

constexpr double kMmPerInch = 25.4;
constexpr double kPointsPerMm = 72 / kMmPerInch;

// One page of the output: its size in mm, its place among the files, and what is drawn on it in mm.
struct Page {
  std::string name;  // "r1c1"; empty when it is the only one
  Size size;
  std::function<void(cairo_t*)> draw;
};

std::vector<Page> lay_out(const LandingTarget& target, const SheetPlan& plan) {
  std::vector<Page> pages;
  if (plan.tiled()) {
    pages.push_back({"overview", plan.page, [&](cairo_t* cr) { draw_overview(cr, target, plan); }});
  }
  for (size_t i = 0; i < plan.sheets.size(); ++i) {
    const std::string name = plan.tiled() ? tile_name(plan.sheets[i]) : "";
    pages.push_back({name, plan.page, [&, i](cairo_t* cr) { draw_sheet(cr, target, plan, i); }});
  }
  return pages;
}

Page bare_page(const LandingTarget& target) {
  const Bounds bounds = printed_bounds(target);
  const Eigen::Vector2d extent = 1000 * (bounds.upper_right - bounds.lower_left);
  return {"", {extent.x(), extent.y()}, [&target, bounds](cairo_t* cr) {
            cairo_scale(cr, 1000, -1000);
            cairo_translate(cr, -bounds.lower_left.x(), -bounds.upper_right.y());
            draw_target(cr, target);
          }};
}

// Owns a surface and the context that draws on it; cairo keeps the first error of each until asked.
class Canvas {
 public:
  explicit Canvas(cairo_surface_t* surface) : surface_(surface), context_(cairo_create(surface)) {}
  ~Canvas() {
    cairo_destroy(context_);
    cairo_surface_destroy(surface_);
  }
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  // `unit` is a millimetre in the surface's own units.
  void draw(const Page& page, double unit) {
    cairo_save(context_);
    cairo_scale(context_, unit, unit);
    page.draw(context_);
    cairo_restore(context_);
  }
  cairo_t* context() { return context_; }
  cairo_surface_t* surface() { return surface_; }
  void finish() {
    check(cairo_status(context_));
    cairo_surface_finish(surface_);
    check(cairo_surface_status(surface_));
  }
  static void check(cairo_status_t status) {
    if (status != CAIRO_STATUS_SUCCESS) throw std::runtime_error(cairo_status_to_string(status));
  }

 private:
  cairo_surface_t* surface_;
  cairo_t* context_;
};

cairo_status_t append_to_string(void* text, const unsigned char* data, unsigned int length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void write_pdf(const std::vector<Page>& pages, const std::string& title, const fs::path& output) {
  // Readers refuse larger ones (PDF 32000-1, annex C).
  constexpr double kLargest = 14400 / kPointsPerMm;
  for (const Page& page : pages) {
    if (std::max(page.size.width, page.size.height) > kLargest) {
      throw std::runtime_error(output.string() + ": a PDF page is at most 5080 mm long, this one would be " +
                               std::to_string(std::lround(std::max(page.size.width, page.size.height))) +
                               " mm: take tiles (--paper) or .svg");
    }
  }
  std::string pdf;
  const auto points = [](const Size& size) {
    return Size{size.width * kPointsPerMm, size.height * kPointsPerMm};
  };
  const Size first = points(pages.front().size);
  Canvas canvas(cairo_pdf_surface_create_for_stream(append_to_string, &pdf, first.width, first.height));
  cairo_pdf_surface_set_metadata(canvas.surface(), CAIRO_PDF_METADATA_TITLE, title.c_str());
  for (const Page& page : pages) {
    const Size size = points(page.size);
    cairo_pdf_surface_set_size(canvas.surface(), size.width, size.height);
    canvas.draw(page, kPointsPerMm);
    cairo_show_page(canvas.context());
  }
  canvas.finish();
  write_whole_file(output, pdf);
}

void write_svg(const Page& page, const fs::path& output) {
  std::string svg;
  Canvas canvas(
      cairo_svg_surface_create_for_stream(append_to_string, &svg, page.size.width, page.size.height));
  cairo_svg_surface_set_document_unit(canvas.surface(), CAIRO_SVG_UNIT_MM);
  canvas.draw(page, 1);
  canvas.finish();
  write_whole_file(output, svg);
}

void write_png(const Page& page, double dpi, const fs::path& output) {
  const double unit = dpi / kMmPerInch;  // px per mm
  // A hair less, so that rounding does not add a row of paper.
  const auto pixels = [&](double mm) { return std::ceil(mm * unit - 1e-6); };
  const double width = pixels(page.size.width), height = pixels(page.size.height);
  constexpr double kLargest = 32767;  // of a cairo surface
  if (std::max(width, height) > kLargest) {
    throw std::runtime_error(output.string() +
                             ": a picture is at most 32767 pixels wide and high, this one would be " +
                             std::to_string(std::lround(width)) + " x " +
                             std::to_string(std::lround(height)) + ": take a smaller --dpi, --paper or .pdf");
  }
  Canvas canvas(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width), static_cast<int>(height)));
  cairo_set_source_rgb(canvas.context(), 1, 1, 1);
  cairo_paint(canvas.context());
  canvas.draw(page, unit);
  Canvas::check(cairo_status(canvas.context()));
  std::string png;
  Canvas::check(cairo_surface_write_to_png_stream(canvas.surface(), append_to_string, &png));
  write_whole_file(output, with_resolution(png, dpi));
}

// pad.svg, pad-overview.svg, pad-r1c1.svg, ...
fs::path file_of(const Page& page, const fs::path& output) {
  if (page.name.empty()) return output;
  return output.parent_path() / (output.stem().string() + '-' + page.name + output.extension().string());
}

}  // namespace

std::vector<fs::path> print_target(const LandingTarget& target, const fs::path& output,
                                   const PrintOptions& options) {
  if (options.bare && options.paper != Paper::kNone)
    throw std::invalid_argument("a bare target has no paper");
  const SheetPlan plan = plan_sheets(printed_bounds(target), options.paper);
  const std::vector<Page> pages = options.bare ? std::vector{bare_page(target)} : lay_out(target, plan);
  const std::string kind = output.extension().string();
  if (kind == ".pdf") {
    write_pdf(pages, target.name, output);
    return {output};
  }
  if (kind != ".svg" && kind != ".png") {
    throw std::invalid_argument(output.string() + ": expected a name ending in .pdf, .svg or .png");
  }
  std::vector<fs::path> written;
  for (const Page& page : pages) {
    written.push_back(file_of(page, output));
    if (kind == ".svg") {
      write_svg(page, written.back());
    } else {
      write_png(page, options.dpi, written.back());
    }
  }
  return written;
}

}  // namespace perch
