#include "calib/camera/calibration_report.h"

#include <algorithm>
#include <cmath>
#include <fstream>

#include "calib/camera/coverage.h"
#include "calib/camera/svg_plot.h"
#include "perch/analysis/page.h"
#include "perch/analysis/page_assets.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

constexpr int kColumns = 32, kRows = 24;
const std::string kSeen = "var(--navigation)", kOff = "var(--vision)";

constexpr std::string_view kStyle = R"(
.pictures { display: grid; grid-template-columns: repeat(auto-fill, minmax(300px, 1fr)); gap: 1.2rem; }
.pictures svg { display: block; }
figcaption { font-size: .85rem; color: var(--muted); margin-bottom: .3rem; }
.scroll + h3 { margin-top: 1.6rem; }
pre { overflow-x: auto; font-size: .85rem; }
)";

std::string figure(const std::string& caption, const std::string& svg) {
  return "<figure><figcaption>" + escaped(caption) + "</figcaption>" + svg + "</figure>\n";
}

std::string section(const std::string& title, const std::string& note, const std::string& body) {
  return "<section><h3>" + escaped(title) + "</h3><p class='note'>" + escaped(note) + "</p>" + body +
         "</section>\n";
}

std::string row(const std::vector<std::string>& cells, const std::string& tag = "td") {
  std::string text = "<tr>";
  for (size_t i = 0; i < cells.size(); ++i) {
    const std::string t = i == 0 ? "th" : tag;
    text += "<" + t + ">" + escaped(cells[i]) + "</" + t + ">";
  }
  return text + "</tr>";
}

std::string table(const std::vector<std::string>& head, const std::string& rows) {
  return "<div class='scroll'><table><thead>" + row(head, "th") + "</thead><tbody>" + rows +
         "</tbody></table></div>";
}

std::string sentences(const std::vector<std::string>& lines) {
  std::string text;
  for (const auto& one : lines) text += "<li>" + escaped(one) + "</li>";
  return text.empty() ? text : "<ul>" + text + "</ul>";
}

std::string verdict_section(const Verdict& verdict) {
  std::string rows;
  for (const auto& gate : verdict.gates)
    rows +=
        row({gate.what, fixed(gate.found, 3),
             (gate.at_least ? "at least " : "at most ") + fixed(gate.limit, 2), gate.met ? "met" : "MISSED"});
  std::string body = table({"what is asked for", "found", "limit", ""}, rows);
  if (!verdict.missing.empty()) body += "<h3>What the pictures lack</h3>" + sentences(verdict.missing);
  if (!verdict.warnings.empty()) body += "<div class='notice'>" + sentences(verdict.warnings) + "</div>";
  return section("Good enough to land on?",
                 "The recommended limits; docs/CALIBRATE_CAMERA.md has their reasons.", body);
}

std::string landing_section(const Verdict& verdict) {
  std::string rows;
  for (const auto& at : verdict.landing) {
    rows += row({fixed(at.range, 1) + " m", fixed(1000 * at.mean_m, 1) + " mm",
                 fixed(1000 * at.worst_m, 1) + " mm", fixed(kDegFromRad * at.mean_rotation, 3) + " deg",
                 fixed(1000 * at.without_mount_calibration_m, 1) + " mm"});
  }
  return section(
      "What it contributes to the landing error",
      "Standard deviations of the position that come of the calibration alone, the target anywhere in the "
      "picture. The last column is for a mount that was measured with a ruler, not calibrated with this "
      "lens.",
      table({"range", "mean", "worst direction", "rotation", "mount not calibrated"}, rows));
}

std::string models_section(const Calibration& calibration) {
  std::string rows;
  for (size_t i = 0; i < calibration.candidates.size(); ++i) {
    const Candidate& c = calibration.candidates[i];
    const auto& cross = c.cross_validation;
    const std::string name = c.name() + (i == calibration.chosen ? " (chosen)" : "");
    if (!c.usable()) {
      rows += row({name, c.failure});
      continue;
    }
    rows += row({name, std::to_string(c.fit.intrinsics.size()), fixed(c.fit.rms_px, 4),
                 std::to_string(c.fit.outliers), cross ? fixed(cross->held_out_px, 4) : "unknown",
                 cross ? fixed(cross->difference_px, 3) : "unknown",
                 cross ? fixed(cross->predicted_px, 3) : "unknown", fixed(c.fit.intrinsics[0], 2)});
  }
  return section("Lens models compared", calibration.why,
                 table({"model", "unknowns", "fit [px]", "outliers", "held out [px]", "halves differ [px]",
                        "predicted [px]", "fx [px]"},
                       rows) +
                     sentences(calibration.remarks));
}

std::string coverage_section(const BoardViews& views, const LensFit& fit) {
  std::string dots, arrows;
  const double size = views.width / 320.;
  // The usual error is drawn a thirtieth of the picture long.
  const double scale = views.width / 30. / std::max(1e-6, fit.sigma_px);
  for (size_t i = 0; i < views.views.size(); ++i) {
    for (size_t k = 0; k < views.views[i].corners.size(); ++k) {
      const auto& at = views.views[i].corners[k].pixel;
      const auto& [error, outlier] = fit.corners[i][k];
      dots += dot(at, size, outlier ? kOff : kSeen);
      arrows += outlier ? dot(at, 1.5 * size, kOff) : line(at, at + scale * error, kSeen, size / 2);
    }
  }
  return section(
      "Corners and their errors",
      "Where corners have been seen, and by how much each is off, " + fixed(scale, 0) +
          " times as long. Errors of one direction in one place tell of a lens model that does not fit. "
          "Orange: rejected.",
      "<div class='pictures'>" + figure("All corners", picture_svg(views.width, views.height, dots)) +
          figure("Errors", picture_svg(views.width, views.height, arrows)) + "</div>");
}

std::string errors_section(const BoardViews& views, const LensFit& fit) {
  constexpr int kBins = 40;
  std::vector<double> counts(kBins, 0);
  double count = 0;
  std::vector<Eigen::Vector2d> by_view;
  SensorMap regions{8, 6, std::vector<double>(48, 0)};
  std::vector<double> in_region(48, 0);
  for (size_t i = 0; i < fit.corners.size(); ++i) {
    double squares = 0;
    for (size_t k = 0; k < fit.corners[i].size(); ++k) {
      const auto& [error, outlier] = fit.corners[i][k];
      squares += error.squaredNorm();
      if (outlier) continue;
      for (const double e : error) {
        const double bin = (e / fit.sigma_px + 4) / 8 * kBins;
        if (bin >= 0 && bin < kBins) ++counts[static_cast<size_t>(bin)];
        ++count;
      }
      const auto& p = views.views[i].corners[k].pixel;
      const int x = std::clamp(static_cast<int>(p.x() / views.width * 8), 0, 7);
      const int y = std::clamp(static_cast<int>(p.y() / views.height * 6), 0, 5);
      regions.values[static_cast<size_t>(8 * y + x)] += error.squaredNorm() / 2;
      ++in_region[static_cast<size_t>(8 * y + x)];
    }
    by_view.emplace_back(i + 1, std::sqrt(squares / (2 * static_cast<double>(fit.corners[i].size()))));
  }
  for (size_t i = 0; i < 48; ++i) regions.values[i] = std::sqrt(regions.values[i] / in_region[i]);
  Curve bars{{}, kSeen, true}, normal{{}, kOff, false};
  for (int i = 0; i < kBins; ++i) {
    const double x = -4 + 8 * (i + 0.5) / kBins;
    bars.points.emplace_back(x, counts[static_cast<size_t>(i)]);
    normal.points.emplace_back(x, count * 8 / kBins * std::exp(-x * x / 2) / std::sqrt(2 * M_PI));
  }
  return section(
      "How the errors scatter", "Against a normal distribution; by picture, rejected corners too; by place.",
      "<div class='pictures'>" +
          figure("Errors in sigmas of " + fixed(fit.sigma_px, 3) + " px and the normal distribution",
                 curves_svg({bars, normal}, "sigmas", "coordinates")) +
          figure("By picture", curves_svg({{by_view, kSeen, true}}, "picture", "root mean square, px")) +
          figure("Root mean square by place",
                 map_svg(views.width, views.height, regions, 2 * fit.sigma_px, "px")) +
          "</div>");
}

std::string uncertainty_section(const BoardViews& views, const Calibration& calibration) {
  const Candidate& best = calibration.best();
  std::string figures;
  std::vector<double> ranges = calibration.ranges;
  ranges.push_back(kAtInfinity);
  for (const double range : ranges) {
    const auto map = uncertainty_map(best.fit, best.covariance, range, kColumns, kRows);
    figures += figure(std::isfinite(range) ? "At " + fixed(range, 1) + " m" : "At infinity",
                      map_svg(views.width, views.height, map, 1.5, "px"));
  }
  if (best.cross_validation) {
    figures += figure("Difference of the lenses from every other picture and from the rest, at infinity",
                      map_svg(views.width, views.height, best.cross_validation->halves.length, 1.5, "px"));
  }
  return section(
      "How well a projection is known",
      "Standard deviation in the worst direction, by place in the picture. Only the noise of the corners is "
      "in it; what a wrong lens model adds shows in the difference of the halves.",
      "<div class='pictures'>" + figures + "</div>");
}

std::string board_section(const BoardViews& views, const Candidate& best) {
  Curve along{{}, kSeen, false}, across{{}, kOff, false};
  for (int i = 0; i <= 40; ++i) {
    const double s = i / 40.;
    along.points.emplace_back(s, 4000 * best.fit.warp.x() * s * (1 - s));
    across.points.emplace_back(s, 4000 * best.fit.warp.y() * s * (1 - s));
  }
  std::string rows;
  const auto poses = board_poses(views, best.fit);
  std::vector<size_t> order(views.views.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  const auto square = [&](size_t i) {
    double sum = 0;
    for (const auto& corner : best.fit.corners[i]) sum += corner.error_px.squaredNorm();
    return sum / static_cast<double>(2 * best.fit.corners[i].size());
  };
  std::ranges::sort(order, std::greater{}, square);
  std::string worst;
  for (size_t n = 0; n < std::min<size_t>(order.size(), 6); ++n) {
    const size_t i = order[n];
    const double rms = std::sqrt(square(i)), scale = views.width / 25. / std::max(1e-6, rms);
    std::string inside;
    for (size_t k = 0; k < best.fit.corners[i].size(); ++k) {
      const auto& at = views.views[i].corners[k].pixel;
      const std::string& colour = best.fit.corners[i][k].outlier ? kOff : kSeen;
      inside += dot(at, views.width / 250., colour) +
                line(at, at + scale * best.fit.corners[i][k].error_px, colour, views.width / 400.);
    }
    worst += figure(views.views[i].picture + ": " + fixed(rms, 3) + " px, tilt " +
                        fixed(kDegFromRad * poses[i].tilt, 0) + " deg, " + fixed(poses[i].distance, 2) + " m",
                    picture_svg(views.width, views.height, inside));
  }
  return section("The board's bend",
                 "Its middle against its edges: " + fixed(1000 * best.fit.warp.x(), 2) + " +- " +
                     fixed(1000 * best.covariance.warp_sigma.x(), 2) + " mm along the columns (blue), " +
                     fixed(1000 * best.fit.warp.y(), 2) + " +- " +
                     fixed(1000 * best.covariance.warp_sigma.y(), 2) + " mm along the rows (orange).",
                 "<div class='pictures'>" +
                     figure("Profile", curves_svg({along, across}, "part of the board", "mm")) + "</div>") +
         section("Pictures that fit worst", "Their corners with their errors, each to its own scale.",
                 "<div class='pictures'>" + worst + "</div>");
}

std::string suspects_section(const BoardViews& views, const Verdict& verdict) {
  if (verdict.suspects.empty()) return "";
  std::string rows;
  for (const auto& s : verdict.suspects)
    rows += row({views.views[s.view].picture, fixed(s.rms_px, 2) + " px", s.why});
  return section("Pictures to look at",
                 "They do not fit as the others do: leave them out, or take them again.",
                 table({"picture", "error", "why"}, rows));
}

std::string commands_section(const std::string& model) {
  std::string commands;
  for (const char* command :
       {"mrcal-show-projection-uncertainty", "mrcal-show-residuals --vectorfield",
        "mrcal-show-residuals --regional", "mrcal-show-residuals-board-observation --from-worst --explore",
        "mrcal-show-geometry", "mrcal-show-distortion-off-pinhole"})
    commands += std::string(command) + " " + model + "\n";
  return section("mrcal's own plots", "Of Debian's package mrcal; the model carries all that they need.",
                 "<pre>" + escaped(commands) + "</pre>");
}

}  // namespace

std::string calibration_report_html(const BoardViews& views, const Calibration& calibration,
                                    const Verdict& verdict, const std::string& model_file) {
  std::string html = page_head("Perch camera calibration", PageScripts::kNone) + "<style>\n";
  html += kReportCss;
  html += kStyle;
  html += "</style>\n</head>\n<body>\n<main>\n<h1>Perch camera calibration</h1>\n<h2>" +
          escaped(calibration.best().name()) + "<small>" + std::to_string(views.views.size()) +
          " pictures of " + std::to_string(views.width) + " x " + std::to_string(views.height) +
          "</small></h2>\n<p class='lead'>" + escaped(verdict.summary) + "</p>\n";
  html += verdict_section(verdict) + landing_section(verdict) + suspects_section(views, verdict) +
          models_section(calibration) + coverage_section(views, calibration.fit()) +
          errors_section(views, calibration.fit()) + uncertainty_section(views, calibration) +
          board_section(views, calibration.best()) + commands_section(model_file);
  return html + "</main>\n</body>\n</html>\n";
}

void write_calibration_report(const std::filesystem::path& file, const BoardViews& views,
                              const Calibration& calibration, const Verdict& verdict,
                              const std::string& model_file) {
  std::ofstream stream(file, std::ios::binary);
  stream << calibration_report_html(views, calibration, verdict, model_file);
  stream.close();
  if (!stream) throw CalibrationError(file.string() + ": cannot be written");
}

}  // namespace perch
