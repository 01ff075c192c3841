#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace perch {

// The whole text as one number, whatever the locale. NaN and infinity are numbers here; see parse_finite.
std::optional<double> parse_double(std::string_view text);
std::optional<double> parse_finite(std::string_view text);
// A whole number without exponent: nanoseconds since 1970 do not fit a double.
std::optional<int64_t> parse_integer(std::string_view text);

// A field of a file for a message: in quotes, its first 40 bytes, "?" for what is no printable ASCII. A
// binary file may be one line.
std::string quoted(std::string_view field);

// A column that a table must have, as docs/FORMATS.md writes it: "p_x [m]".
using ColumnName = std::string_view;

// What a last line without a line end is. A program that was ended while it appended rows (kMustEnd) may have
// left half of one, and half a number is a number, too.
enum class LastLine { kMayLackEnd, kMustEnd };

// Reads a file of comma separated values row by row. Files come from loggers, spreadsheets and editors: a
// byte order mark, CR LF, blank lines, comments (#), spaces around a field and a missing last newline are all
// taken. The header is the line, comment or not, before the first row whose first field begins with "time".
class CsvReader {
 public:
  // Throws std::runtime_error naming a file that cannot be read.
  explicit CsvReader(const std::filesystem::path& file, LastLine last_line = LastLine::kMayLackEnd);

  // False at the end. Afterwards fields() are the trimmed fields of the row, valid until the next call.
  bool next();
  std::span<const std::string_view> fields() const { return fields_; }
  // "file:line" of that row.
  std::string place() const;

  // Where the columns are: by the header's names, in the given order where there is no header; the time,
  // which has many names, is the first if not found. Throws std::runtime_error when the header lacks one, or
  // says another unit in its brackets ("p_x [mm]"): numbers of unknown meaning are worse than none.
  std::vector<size_t> columns(std::span<const ColumnName> names) const;
  bool has_column(ColumnName name) const;

  // Notes the last line that was skipped because it has no end, if there was one.
  void note_torn(std::vector<std::string>& problems) const;

 private:
  bool next_line(std::string_view& line);
  void split(std::string_view line, std::vector<std::string_view>& fields) const;

  std::filesystem::path file_;
  std::string text_;
  size_t position_ = 0;
  int line_ = 0;
  int header_line_ = 0;
  std::optional<int> torn_line_;
  std::vector<std::string_view> header_;  // empty: there is none
  std::vector<std::string_view> fields_;
  bool first_is_pending_ = false;  // the first row, read while looking for the header
};

}  // namespace perch
