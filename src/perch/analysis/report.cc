#include "perch/analysis/report.h"

#include <algorithm>
#include <cmath>

#include "perch/analysis/page.h"
#include "perch/analysis/page_assets.h"
#include "perch/analysis/summary.h"
#include "perch/geometry/euler.h"

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

// Digits that a plot can show and no more: they make up most of the file.
constexpr double kMicrometre = 1e-6, kTenMicrometres = 1e-5, kTenThousandthDeg = 1e-4, kMillisecond = 1e-3;

Json rounded(double value, double step) {
  if (!std::isfinite(value)) return nullptr;
  // A quotient of whole numbers prints shortest: 3 / 1000, not 3 * 0.001.
  return std::round(value / step) / std::round(1 / step);
}

// To four digits, for values of any size.
Json short_number(double value) {
  if (!std::isfinite(value)) return nullptr;
  if (value == 0) return 0;
  const double decade = std::pow(10, 3 - std::floor(std::log10(std::abs(value))));
  return std::round(value * decade) / decade;
}

// One list a state: positions in m times `length_scale`, angles in degrees; null where there is none.
template <typename Get>
Json state_columns(const std::vector<const FrameRecord*>& frames, double length_scale, double length_step,
                   Get get) {
  Json columns = Json::array();
  for (size_t state = 0; state < 6; ++state) {
    const double scale = is_angle(state) ? kDegFromRad : length_scale;
    const double step = is_angle(state) ? kTenThousandthDeg : length_step;
    Json column = Json::array();
    for (const FrameRecord* frame : frames) {
      const SixStates* states = get(*frame);
      column.push_back(states ? rounded((*states)[static_cast<Eigen::Index>(state)] * scale, step)
                              : Json(nullptr));
    }
    columns.push_back(std::move(column));
  }
  return columns;
}

template <typename Get>
Json column(const std::vector<const FrameRecord*>& frames, Get get) {
  Json values = Json::array();
  for (const FrameRecord* frame : frames) values.push_back(get(*frame));
  return values;
}

const SixStates* pointer(const std::optional<SixStates>& states) { return states ? &*states : nullptr; }

// What the page plots against time. Time must ascend there, also where a camera's clock went back.
Json frames_json(const FlightScore& score) {
  std::vector<const FrameRecord*> frames;
  for (const FrameRecord& frame : score.frames) frames.push_back(&frame);
  std::stable_sort(frames.begin(), frames.end(),
                   [](const auto* a, const auto* b) { return a->timestamp_ns < b->timestamp_ns; });
  const int64_t start = frames.empty() ? 0 : frames.front()->timestamp_ns;

  std::string statuses;  // a digit a frame
  for (const FrameRecord* frame : frames)
    statuses += static_cast<char>('0' + static_cast<int>(frame->status));
  return {
      {"time_s", column(frames,
                        [&](const FrameRecord& f) {
                          return rounded(1e-9 * static_cast<double>(f.timestamp_ns - start), kMillisecond);
                        })},
      {"status", statuses},
      {"vision",
       state_columns(frames, 1, kTenMicrometres, [](const FrameRecord& f) { return pointer(f.vision); })},
      {"navigation",
       state_columns(frames, 1, kTenMicrometres, [](const FrameRecord& f) { return pointer(f.navigation); })},
      {"error_cm_deg",
       state_columns(frames, 100, 100 * kMicrometre,
                     [](const FrameRecord& f) { return f.error ? &f.error->difference : nullptr; })},
      {"sigma_cm_deg",
       state_columns(frames, 100, 100 * kMicrometre, [](const FrameRecord& f) { return pointer(f.sigma); })},
      {"position_error_cm", column(frames,
                                   [](const FrameRecord& f) {
                                     return f.error ? short_number(100 * f.error->position) : Json(nullptr);
                                   })},
      {"nees", column(frames,
                      [&](const FrameRecord& f) {
                        const auto& error = error_of(f, score.truth.has_value());
                        return error && error->nees ? short_number(*error->nees) : Json(nullptr);
                      })},
      {"range_m", column(frames, [](const FrameRecord& f) { return rounded(f.range, kMillisecond); })},
      {"reprojection_px",
       column(frames, [](const FrameRecord& f) { return short_number(f.reprojection_rms_px); })},
      {"total_us", column(frames, [](const FrameRecord& f) { return short_number(f.total_us); })}};
}

std::string base64(const std::vector<unsigned char>& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (size_t i = 0; i < bytes.size(); i += 3) {
    const size_t count = std::min<size_t>(3, bytes.size() - i);
    unsigned group = 0;
    for (size_t k = 0; k < 3; ++k) group = group << 8 | (k < count ? bytes[i + k] : 0u);
    for (size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[group >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

Json pictures_json(const ReportFlight& flight) {
  Json pictures = Json::array();
  for (const ReportPicture& picture : flight.pictures) {
    const FlightScore& score = flight.score;
    if (picture.shown.frame >= score.frames.size() || picture.jpeg.empty()) continue;
    const FrameRecord& frame = score.frames[picture.shown.frame];
    pictures.push_back(
        {{"why", picture.shown.why},
         {"frame", picture.shown.frame},
         {"name", score.frame_names[picture.shown.frame]},
         {"status", to_string(frame.status)},
         {"position_error_cm", frame.error ? short_number(100 * frame.error->position) : Json(nullptr)},
         {"rotation_error_deg",
          frame.error ? short_number(kDegFromRad * frame.error->rotation) : Json(nullptr)},
         {"reprojection_px", short_number(frame.reprojection_rms_px)},
         {"range_m", short_number(frame.range)},
         {"jpeg", base64(picture.jpeg)}});
  }
  return pictures;
}

constexpr std::string_view kFlightBegin = "<script class=\"flight\" type=\"application/json\">",
                           kScriptEnd = "</script>\n";

std::string page_html(const Json& season, std::span<const std::string> flights,
                      const std::string& configuration) {
  std::string html = page_head("Perch flight report", PageScripts::kInline);
  const auto add = [&html](std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts) html += part;
  };
  add({"<style>\n", kReportCss, "</style>\n</head>\n<body>\n<main id=\"report\"></main>\n"});
  add(
      {"<noscript>This report draws its plots with JavaScript; the same numbers are in "
       "summary.json.</noscript>\n"});
  add({"<script id=\"configuration\" type=\"application/json\">", script_json(configuration), kScriptEnd});
  add({"<script id=\"season\" type=\"application/json\">", script_json(season), kScriptEnd});
  // A script tag a flight: one flight's JSON tree at a time is in memory, here and in the browser.
  for (const std::string& flight : flights) add({kFlightBegin, flight, kScriptEnd});
  add({"<script>\n", kReportJs, kScriptEnd});
  add({"</body>\n</html>\n"});
  return html;
}

}  // namespace

std::string flight_data(const ReportFlight& flight) {
  return script_json(Json{{"summary", summary_json(flight.score)},
                          {"frames", frames_json(flight.score)},
                          {"pictures", pictures_json(flight)},
                          {"pad", flight.pad}});
}

std::string flight_data_of_page(const std::string& html) {
  const size_t tag = html.find(kFlightBegin);
  if (tag == std::string::npos) return {};
  const size_t begin = tag + kFlightBegin.size(), end = html.find(kScriptEnd, begin);
  return end == std::string::npos ? std::string() : html.substr(begin, end - begin);
}

std::string report_html(std::span<const ReportFlight> flights, const std::string& configuration) {
  std::vector<std::string> data;
  for (const ReportFlight& flight : flights) data.push_back(flight_data(flight));
  return page_html(nullptr, data, configuration);
}

std::string season_html(const Json& season, std::span<const std::string> flights,
                        const std::string& configuration) {
  return page_html(season, flights, configuration);
}

}  // namespace perch
