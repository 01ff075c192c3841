#include "perch/analysis/results_database.h"

#include <sqlite3.h>

#include <stdexcept>
#include <vector>

#include "perch/analysis/summary.h"

namespace perch {
namespace {

using Json = nlohmann::ordered_json;

// "x_rms", "[m]" as a name that SQL takes without quotes: x_rms_m.
std::string sql_name(const SummaryColumn& column) {
  const std::string unit = column.unit.size() > 2 ? column.unit.substr(1, column.unit.size() - 2) : "";
  return unit.empty() ? column.name : column.name + '_' + unit;
}

// What the database has of a flight beside the columns of summary.csv.
const std::vector<SummaryColumn>& more_columns() {
  using At = Json::json_pointer;
  static const std::vector<SummaryColumn> columns = {
      {"target", "", At("/target")},
      {"start", "[ns]", At("/start_ns")},
      {"duration", "[s]", At("/duration_s")},
      {"camera", "", At("/conditions/camera")},
      {"rate", "[Hz]", At("/conditions/rate_hz")},
      {"median_range", "[m]", At("/conditions/median_range_m")},
      {"median_view_angle", "[rad]", At("/conditions/median_view_angle_rad")},
      {"median_speed", "[m_s]", At("/conditions/median_speed_m_s")},
      {"median_white", "", At("/conditions/median_white")},
      {"median_visible", "", At("/conditions/median_visible")},
      {"truth_position_rms", "[m]", At("/truth/position_m/rms")},
      {"truth_rotation_rms", "[rad]", At("/truth/rotation_rad/rms")},
      {"truth_position_over_range_rms", "[]", At("/truth/position_over_range_rms")}};
  return columns;
}

std::string flights_table() {
  std::string sql = "CREATE TABLE flights(";
  for (const auto* columns : {&summary_columns(), &more_columns()}) {
    for (const SummaryColumn& column : *columns) {
      sql += sql_name(column) + (column.name == "flight" ? " TEXT PRIMARY KEY, " : ", ");
    }
  }
  sql.resize(sql.size() - 2);
  return sql + ')';
}

// Null where there is none, or nothing to have one.
Json item(const Json& object, const char* key) {
  return object.is_object() ? object.value(key, Json()) : Json();
}

void bind(sqlite3_stmt* statement, int place, const Json& value) {
  if (value.is_number_float()) {
    sqlite3_bind_double(statement, place, value.get<double>());
  } else if (value.is_number_integer()) {
    sqlite3_bind_int64(statement, place, value.get<int64_t>());
  } else if (value.is_null()) {
    sqlite3_bind_null(statement, place);
  } else {
    const std::string text = value.is_string() ? value.get<std::string>() : to_text(value);
    sqlite3_bind_text(statement, place, text.c_str(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }
}

}  // namespace

ResultsDatabase::ResultsDatabase(std::filesystem::path file)
    : file_(std::move(file)), part_(file_.string() + ".part"), database_(nullptr, &sqlite3_close) {
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
  sqlite3* opened = nullptr;
  // Without locks, which not every shared disk has: nobody else knows this name.
  const int code =
      sqlite3_open_v2(part_.c_str(), &opened, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, "unix-none");
  database_.reset(opened);
  if (code != SQLITE_OK) fail();
  // The file has another name until it is whole: a journal beside it would protect nothing.
  execute("PRAGMA journal_mode=OFF");
  execute("PRAGMA synchronous=OFF");
  execute("BEGIN");
  execute("CREATE TABLE run(program TEXT, configuration TEXT)");
  execute(flights_table());
  execute("CREATE TABLE gaps(flight TEXT, first_frame, frames, start_s, duration_s, reasons TEXT)");
  execute(
      "CREATE TABLE error_bins(flight TEXT, quantity TEXT, unit TEXT, low, high, frames, position_rms_m, "
      "position_rms_low_m, position_rms_high_m, position_median_m, rotation_rms_rad)");
  execute(
      "CREATE TABLE touch_down(flight TEXT, from_s, to_s, frames, place_rms_m, place_median_m, time_rms_s, "
      "time_mean_s)");
  execute("CREATE TABLE stages(flight TEXT, stage TEXT, frames, mean_us, median_us, p99_us, share)");
  execute("CREATE TABLE problems(flight TEXT, problem TEXT)");
}

ResultsDatabase::~ResultsDatabase() {
  if (part_.empty()) return;
  database_.reset();
  std::error_code ignored;
  std::filesystem::remove(part_, ignored);
}

void ResultsDatabase::add_run(const std::string& program, const std::string& configuration) {
  insert("run", {program, configuration});
}

void ResultsDatabase::add(const Json& summary) {
  Row row;
  for (const auto* columns : {&summary_columns(), &more_columns()}) {
    for (const SummaryColumn& column : *columns) row.push_back(value_of(summary, column));
  }
  insert("flights", row);
  const Json flight = item(summary, "flight");
  const auto add_list = [&](const char* table, const Json& list, std::initializer_list<const char*> keys,
                            const Row& first = {}) {
    for (const Json& entry : list) {
      Row values = {flight};
      values.insert(values.end(), first.begin(), first.end());
      for (const char* key : keys) values.push_back(item(entry, key));
      insert(table, values);
    }
  };
  add_list("gaps", item(item(summary, "detection"), "gaps"),
           {"first_frame", "frames", "start_s", "duration_s", "reasons"});
  for (const Json& curve : item(summary, "error_curves")) {
    add_list("error_bins", item(curve, "bins"),
             {"from", "to", "frames", "position_rms_m", "position_rms_low_m", "position_rms_high_m",
              "position_median_m", "rotation_rms_rad"},
             {item(curve, "by"), item(curve, "unit")});
  }
  add_list("touch_down", item(item(summary, "touch_down"), "forecasts"),
           {"from_s", "to_s", "frames", "place_rms_m", "place_median_m", "time_rms_s", "time_mean_s"});
  add_list("stages", item(summary, "stages"), {"stage", "frames", "mean_us", "median_us", "p99_us", "share"});
  for (const Json& problem : item(summary, "problems")) insert("problems", {flight, problem});
}

void ResultsDatabase::commit() {
  execute("COMMIT");
  database_.reset();
  std::filesystem::rename(part_, file_);
  part_.clear();
}

void ResultsDatabase::execute(const std::string& sql) {
  if (sqlite3_exec(database_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) fail();
}

void ResultsDatabase::insert(const std::string& table, const Row& row) {
  std::string sql = "INSERT INTO " + table + " VALUES(?";
  for (size_t i = 1; i < row.size(); ++i) sql += ",?";
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(database_.get(), (sql + ')').c_str(), -1, &prepared, nullptr) != SQLITE_OK) fail();
  const std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement(prepared, &sqlite3_finalize);
  for (size_t i = 0; i < row.size(); ++i) bind(prepared, static_cast<int>(i) + 1, row[i]);
  if (sqlite3_step(prepared) != SQLITE_DONE) fail();
}

void ResultsDatabase::fail() const {
  throw std::runtime_error(file_.string() + ": cannot be written: " + sqlite3_errmsg(database_.get()));
}

}  // namespace perch
