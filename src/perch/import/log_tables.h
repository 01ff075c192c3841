#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace perch {

// The rows of one kind of message. A double holds times in us exactly for 285 years.
struct LogTable {
  std::vector<std::string> columns;
  std::vector<double> numbers;  // row by row; NaN where a field is text

  size_t rows() const { return columns.empty() ? 0 : numbers.size() / columns.size(); }
  double at(size_t row, size_t column) const { return numbers[row * columns.size() + column]; }
  std::optional<size_t> column(std::string_view name) const {
    const auto it = std::find(columns.begin(), columns.end(), name);
    if (it == columns.end()) return std::nullopt;
    return static_cast<size_t>(it - columns.begin());
  }
};

// What a log of an autopilot holds of the kinds that were asked for.
struct LogTables {
  std::map<std::string, LogTable, std::less<>> tables;
  std::vector<std::string> names;     // of all kinds that have rows, for messages
  std::vector<std::string> problems;  // "file: what", each thing that was skipped

  // Null where there is none with rows.
  const LogTable* find(std::string_view name) const {
    const auto it = tables.find(name);
    return it == tables.end() || it->second.rows() == 0 ? nullptr : &it->second;
  }
};

using LogBytes = std::span<const uint8_t>;

// Each reads a log out of memory, however broken: bytes that make no sense are passed over to where messages
// go on, and noted. `name` stands for the file in messages. Throws std::runtime_error when the bytes do not
// begin as such a log does, or cannot be read by its own statement.

// PX4's ULog, https://docs.px4.io/main/en/dev_log/ulog_file_format. Of topics with several instances the
// first; arrays are columns "q[0]", "q[1]"; nested types have none.
LogTables parse_ulog(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted);

// ArduPilot's DataFlash .bin. Numbers are in the units of the log's field documentation: scaled by the
// message MULT where the log has it, else as the format character says.
LogTables parse_dataflash(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted);

bool is_ulog(LogBytes bytes);
bool is_dataflash(LogBytes bytes);

}  // namespace perch
