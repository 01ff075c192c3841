#include "perch/camera/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace perch {

namespace fs = std::filesystem;

namespace {

std::string_view trimmed(std::string_view text) {
  const size_t first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

template <typename Number>
std::optional<Number> parse(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

struct NameAndUnit {
  std::string_view name, unit;
};

NameAndUnit name_and_unit(std::string_view column) {
  const size_t bracket = column.find('[');
  if (bracket == std::string_view::npos) return {trimmed(column), {}};
  return {trimmed(column.substr(0, bracket)),
          trimmed(column.substr(bracket + 1, column.find(']', bracket) - bracket - 1))};
}

bool same_unit(std::string_view found, std::string_view expected) {
  // A header without units is taken by its names.
  return found.empty() || found == expected || (found == "m s^-1" && expected == "m/s") ||
         (found == "m/s" && expected == "m s^-1");
}

bool is_time(std::string_view column) {
  return column.starts_with("time") || column.starts_with("Time") || column.starts_with("TIME");
}

}  // namespace

std::optional<double> parse_double(std::string_view text) { return parse<double>(text); }

std::optional<double> parse_finite(std::string_view text) {
  const auto value = parse<double>(text);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

std::optional<int64_t> parse_integer(std::string_view text) { return parse<int64_t>(text); }

std::string quoted(std::string_view field) {
  constexpr size_t kShown = 40;
  std::string text = "\"";
  for (const char c : field.substr(0, kShown)) text += ' ' <= c && c <= '~' && c != '"' ? c : '?';
  return text + (field.size() > kShown ? "...\"" : "\"");
}

CsvReader::CsvReader(const fs::path& file, LastLine last_line) : file_(file) {
  std::ifstream stream(file, std::ios::binary);
  std::error_code ignored;
  if (!stream || fs::is_directory(file, ignored))
    throw std::runtime_error(file.string() + ": cannot be read");
  text_.assign(std::istreambuf_iterator<char>(stream), {});
  if (last_line == LastLine::kMustEnd && !text_.empty() && text_.back() != '\n') {
    text_.resize(text_.rfind('\n') + 1);  // npos + 1 is 0
    torn_line_ = static_cast<int>(std::count(text_.begin(), text_.end(), '\n')) + 1;
  }
  if (text_.starts_with("\xEF\xBB\xBF")) position_ = 3;

  std::string_view line;
  while (next_line(line)) {
    if (line.empty()) continue;
    const bool comment = line.front() == '#';
    if (comment) line = trimmed(line.substr(1));
    split(line, fields_);
    if (is_time(fields_.front())) {
      header_ = fields_;
      header_line_ = line_;
      break;
    }
    first_is_pending_ = !comment;
    if (!comment) break;
  }
}

bool CsvReader::next_line(std::string_view& line) {
  if (position_ >= text_.size()) return false;
  const size_t end = std::min(text_.find('\n', position_), text_.size());
  line = trimmed(std::string_view(text_).substr(position_, end - position_));
  position_ = end + 1;
  ++line_;
  return true;
}

void CsvReader::split(std::string_view line, std::vector<std::string_view>& fields) const {
  fields.clear();
  for (size_t start = 0; start <= line.size();) {
    const size_t comma = std::min(line.find(',', start), line.size());
    fields.push_back(trimmed(line.substr(start, comma - start)));
    start = comma + 1;
  }
}

bool CsvReader::next() {
  if (first_is_pending_) {
    first_is_pending_ = false;
    return true;
  }
  std::string_view line;
  while (next_line(line)) {
    if (line.empty() || line.front() == '#') continue;
    split(line, fields_);
    return true;
  }
  return false;
}

std::string CsvReader::place() const { return file_.string() + ":" + std::to_string(line_); }

void CsvReader::note_torn(std::vector<std::string>& problems) const {
  if (!torn_line_) return;
  problems.push_back(file_.string() + ":" + std::to_string(*torn_line_) +
                     ": the file was cut off within this row, row skipped");
}

bool CsvReader::has_column(ColumnName name) const {
  return std::any_of(header_.begin(), header_.end(), [&](std::string_view column) {
    return name_and_unit(column).name == name_and_unit(name).name;
  });
}

std::vector<size_t> CsvReader::columns(std::span<const ColumnName> names) const {
  const std::string place = file_.string() + ":" + std::to_string(header_line_);
  std::vector<size_t> found;
  for (const ColumnName& name : names) {
    const size_t position = found.size();
    if (header_.empty()) {
      found.push_back(position);
      continue;
    }
    const NameAndUnit expected = name_and_unit(name);
    size_t i = 0;
    while (i < header_.size() && name_and_unit(header_[i]).name != expected.name) ++i;
    if (i == header_.size() && position == 0) i = 0;
    if (i == header_.size()) {
      throw std::runtime_error(place + ": expected the column " + std::string(name) +
                               ", found none of that name");
    }
    if (!same_unit(name_and_unit(header_[i]).unit, expected.unit)) {
      throw std::runtime_error(place + ": expected the column " + std::string(name) + ", found " +
                               std::string(header_[i]));
    }
    found.push_back(i);
  }
  return found;
}

}  // namespace perch
