#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

struct sqlite3;

namespace perch {

// A season's results as an SQLite file, for those who ask with SQL, pandas, R or DuckDB (docs/BATCH.md):
// tables `flights` (what summary.csv has, and more), `gaps`, `error_bins`, `touch_down`, `stages`, `problems`
// and `run`. Like an AtomicFile, it is whole or not there. The same flights in the same order give the same
// bytes.
class ResultsDatabase {
 public:
  // Throws std::runtime_error naming what cannot be written, as do the others.
  explicit ResultsDatabase(std::filesystem::path file);
  ~ResultsDatabase();
  ResultsDatabase(const ResultsDatabase&) = delete;
  ResultsDatabase& operator=(const ResultsDatabase&) = delete;

  void add_run(const std::string& program, const std::string& configuration);
  // A flight's summary_json, or its summary.json.
  void add(const nlohmann::ordered_json& summary);
  // Nothing can be added afterwards.
  void commit();

 private:
  using Row = std::vector<nlohmann::ordered_json>;
  void execute(const std::string& sql);
  void insert(const std::string& table, const Row& row);
  [[noreturn]] void fail() const;

  std::filesystem::path file_, part_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_;
};

}  // namespace perch
