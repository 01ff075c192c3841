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

// How the grey levels went over time: means of at most kMostColumns stretches of like many frames, a letter
// of base 36 for each level of each: 35 times the root of its share, so that the few pixels of a far target
// show.
Json grey_json(const std::vector<const FrameRecord*>& frames) {
  constexpr size_t kMostColumns = 240;
  std::vector<const FrameRecord*> seen;
  for (const FrameRecord* frame : frames) {
    const auto& share = frame->grey.share;
    if (std::any_of(share.begin(), share.end(), [](uint16_t part) { return part > 0; }))
      seen.push_back(frame);
  }
  if (seen.empty()) return nullptr;
  const size_t each = (seen.size() + kMostColumns - 1) / kMostColumns;
  Json from = Json::array();
  std::string levels;
  for (size_t begin = 0; begin < seen.size(); begin += each) {
    const size_t end = std::min(begin + each, seen.size());
    from.push_back(rounded(
        1e-9 * static_cast<double>(seen[begin]->timestamp_ns - frames.front()->timestamp_ns), kMillisecond));
    for (size_t level = 0; level < GreyHistogram::kBins; ++level) {
      double share = 0;
      for (size_t i = begin; i < end; ++i) share += seen[i]->grey.share[level] / 65535.0;
      const auto digit = std::lround(35 * std::sqrt(share / static_cast<double>(end - begin)));
      levels += "0123456789abcdefghijklmnopqrstuvwxyz"[std::clamp(digit, 0L, 35L)];
    }
  }
  return {{"from_s", from}, {"bins", GreyHistogram::kBins}, {"levels", levels}};
}

// Of a longer flight every so many frames stand as their worst: one without a pose, else that with the
// largest error. A page of an hour's frames would be 30 MB, and no screen has so many pixels.
constexpr size_t kMostFrames = 12'000;

std::vector<const FrameRecord*> worst_of_each(const std::vector<const FrameRecord*>& frames, size_t each,
                                              bool against_truth) {
  const auto badness = [against_truth](const FrameRecord* frame) {
    if (frame->status != EstimateStatus::kOk) return HUGE_VAL;
    const auto& error = error_of(*frame, against_truth);
    return error ? error->position : 0;
  };
  std::vector<const FrameRecord*> worst;
  for (size_t begin = 0; begin < frames.size(); begin += each) {
    const auto first = frames.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = frames.begin() + static_cast<std::ptrdiff_t>(std::min(begin + each, frames.size()));
    worst.push_back(*std::max_element(first, last,
                                      [&](const auto* a, const auto* b) { return badness(a) < badness(b); }));
  }
  return worst;
}

// What the page plots against time. Time must ascend there, also where a camera's clock went back.
Json frames_json(const FlightScore& score) {
  std::vector<const FrameRecord*> all;
  for (const FrameRecord& frame : score.frames) all.push_back(&frame);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto* a, const auto* b) { return a->timestamp_ns < b->timestamp_ns; });
  const size_t each = (all.size() + kMostFrames - 1) / kMostFrames;
  const auto frames = each > 1 ? worst_of_each(all, each, score.truth.has_value()) : all;
  const int64_t start = all.empty() ? 0 : all.front()->timestamp_ns;

  std::string statuses;  // a digit a frame
  for (const FrameRecord* frame : frames)
    statuses += static_cast<char>('0' + static_cast<int>(frame->status));
  return {
      {"each", each},
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
                                   [&](const FrameRecord& f) {
                                     const auto& error = error_of(f, score.truth.has_value());
                                     return error ? short_number(100 * error->position) : Json(nullptr);
                                   })},
      {"nees", column(frames,
                      [&](const FrameRecord& f) {
                        const auto& error = error_of(f, score.truth.has_value());
                        return error && error->nees ? short_number(*error->nees) : Json(nullptr);
                      })},
      {"nis",
       column(frames, [](const FrameRecord& f) { return f.nis ? short_number(*f.nis) : Json(nullptr); })},
      {"view_angle_deg",
       column(frames, [](const FrameRecord& f) { return short_number(kDegFromRad * f.view_angle); })},
      {"visible",
       column(frames,
              [](const FrameRecord& f) { return f.look ? rounded(f.look->visible, 0.001) : Json(nullptr); })},
      {"speed_m_s", column(frames, [](const FrameRecord& f) { return rounded(f.speed, kMillisecond); })},
      {"threshold",
       column(frames,
              [](const FrameRecord& f) { return f.threshold < 0 ? Json(nullptr) : Json(f.threshold); })},
      {"white",
       column(frames,
              [](const FrameRecord& f) { return f.look ? rounded(f.look->white, 1) : Json(nullptr); })},
      {"black",
       column(frames,
              [](const FrameRecord& f) { return f.look ? rounded(f.look->black, 1) : Json(nullptr); })},
      {"grey", grey_json(all)},
      {"range_m", column(frames, [](const FrameRecord& f) { return rounded(f.range, kMillisecond); })},
      {"reprojection_px",
       column(frames, [](const FrameRecord& f) { return short_number(f.reprojection_rms_px); })},
      {"total_us", column(frames, [](const FrameRecord& f) { return short_number(f.total_us); })}};
}

// What a landing's states foretold, the longest before first.
Json forecasts_json(const std::optional<TouchDown>& touch_down) {
  if (!touch_down) return nullptr;
  Json to_go = Json::array(), place = Json::array(), time = Json::array();
  for (const TouchDownForecast& forecast : touch_down->forecasts) {
    to_go.push_back(rounded(forecast.to_go, kMillisecond));
    place.push_back(short_number(100 * forecast.place_error));
    time.push_back(rounded(forecast.time_error, kMillisecond));
  }
  return {{"to_go_s", to_go}, {"place_cm", place}, {"time_s", time}};
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

std::string page_html(PageScripts scripts, const Json& season, const Json& before,
                      std::span<const std::string> flights, const std::string& configuration) {
  std::string html = page_head("Perch flight report", scripts);
  const auto add = [&html](std::initializer_list<std::string_view> parts) {
    for (const std::string_view part : parts) html += part;
  };
  add({"<style>\n", kReportCss, "</style>\n</head>\n<body>\n<main id=\"report\">"});
  if (scripts == PageScripts::kBeside) {
    // The script takes its place.
    add({"<p>This page is drawn by ../", kReportScript,
         ", which is not there: it belongs to the run's whole folder.</p>"});
  }
  add({"</main>\n"});
  add(
      {"<noscript>This report draws its plots with JavaScript; the same numbers are in "
       "summary.json.</noscript>\n"});
  add({"<script id=\"configuration\" type=\"application/json\">", script_json(configuration), kScriptEnd});
  add({"<script id=\"season\" type=\"application/json\">", script_json(season), kScriptEnd});
  add({"<script id=\"before\" type=\"application/json\">", script_json(before), kScriptEnd});
  // A script tag a flight: one flight's JSON tree at a time is in memory, here and in the browser.
  for (const std::string& flight : flights) add({kFlightBegin, flight, kScriptEnd});
  if (scripts == PageScripts::kBeside) {
    add({"<script src=\"../", kReportScript, "\">", kScriptEnd});
  } else {
    add({"<script>\n", kReportJs, kScriptEnd});
  }
  add({"</body>\n</html>\n"});
  return html;
}

}  // namespace

std::string flight_data(const ReportFlight& flight) {
  return script_json(Json{{"summary", summary_json(flight.score)},
                          {"frames", frames_json(flight.score)},
                          {"forecasts", forecasts_json(flight.score.touch_down)},
                          {"pictures", pictures_json(flight)},
                          {"pad", flight.pad}});
}

std::string flight_data_of_page(const std::string& html) {
  const size_t tag = html.find(kFlightBegin);
  if (tag == std::string::npos) return {};
  const size_t begin = tag + kFlightBegin.size(), end = html.find(kScriptEnd, begin);
  return end == std::string::npos ? std::string() : html.substr(begin, end - begin);
}

std::string flight_html(const ReportFlight& flight, const std::string& configuration) {
  const std::string data = flight_data(flight);
  return page_html(PageScripts::kBeside, nullptr, nullptr, {&data, 1}, configuration);
}

std::string_view report_script() { return kReportJs; }

std::string season_html(const Json& season, const Json& before, std::span<const std::string> flights,
                        const std::string& configuration) {
  return page_html(PageScripts::kInline, season, before, flights, configuration);
}

}  // namespace perch
