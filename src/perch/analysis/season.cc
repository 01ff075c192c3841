#include "perch/analysis/season.h"

#include <array>
#include <cmath>

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

struct Column {
  const char* name;
  const char* at;  // in summary.json
};

constexpr std::array<Column, 20> kColumns{{{"flight", "/flight"},
                                           {"comparison", "/comparison"},
                                           {"frames", "/frames"},
                                           {"ok", "/detection/counts/ok"},
                                           {"rate", "/detection/rate"},
                                           {"position_rms_m", "/errors/position_m/rms"},
                                           {"over_range", "/errors/position_over_range_rms"},
                                           {"rotation_rms_rad", "/errors/rotation_rad/rms"},
                                           {"truth_rms_m", "/truth/position_m/rms"},
                                           {"mean_nees", "/consistency/mean_nees"},
                                           {"mean_nis", "/consistency/mean_nis"},
                                           {"total_us", "/total_us/mean"},
                                           {"target", "/target"},
                                           {"camera", "/conditions/camera"},
                                           {"rate_hz", "/conditions/rate_hz"},
                                           {"range_m", "/conditions/median_range_m"},
                                           {"view_angle_rad", "/conditions/median_view_angle_rad"},
                                           {"speed_m_s", "/conditions/median_speed_m_s"},
                                           {"white", "/conditions/median_white"},
                                           {"visible", "/conditions/median_visible"}}};

// Five digits, more than a page shows.
Json shown(const Json& value) {
  if (!value.is_number_float()) return value;
  const double number = value.get<double>();
  if (number == 0 || !std::isfinite(number)) return number == 0 ? Json(0) : Json(nullptr);
  const double decade = std::pow(10, 4 - std::floor(std::log10(std::abs(number))));
  return std::round(number * decade) / decade;
}

}  // namespace

Season::Season() {
  for (const Column& column : kColumns) columns_[column.name] = Json::array();
  for (const char* name : {"start_s", "problems", "first_problem"}) columns_[name] = Json::array();
}

void Season::add(const Json& summary) {
  for (const Column& column : kColumns) {
    const Json::json_pointer at(column.at);
    columns_[column.name].push_back(summary.contains(at) ? shown(summary[at]) : Json(nullptr));
  }
  const Json start = summary.value("start_ns", Json());
  // Milliseconds are enough for a trend; a double of seconds of any clock holds them.
  columns_["start_s"].push_back(start.is_number_integer() ? Json(std::round(start.get<double>() * 1e-6) / 1e3)
                                                          : Json(nullptr));
  const Json problems = summary.value("problems", Json::array());
  columns_["problems"].push_back(problems.size());
  columns_["first_problem"].push_back(problems.empty() ? Json("") : problems.front());
}

}  // namespace perch
