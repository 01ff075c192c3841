#include <array>
#include <stdexcept>

#include "perch/import/log_bytes.h"

namespace perch {
namespace {

// A message: A3 95, the id of its kind, its fields packed. The message FMT, of a fixed kind itself, tells a
// kind's id, length, name, format characters and labels.
constexpr uint8_t kHead1 = 0xA3, kHead2 = 0x95, kFmtId = 0x80;
constexpr size_t kHeader = 3, kFmtLength = 89;

// How many messages in a row must make sense where reading goes on after some that do not.
constexpr int kMessagesToTrust = 3;

struct FormatCharacter {
  char character;
  size_t size;
  double scale;
  double (*load)(LogBytes, size_t);
};

constexpr FormatCharacter kCharacters[] = {
    {'b', 1, 1, load_as_double<int8_t>},
    {'B', 1, 1, load_as_double<uint8_t>},
    {'M', 1, 1, load_as_double<uint8_t>},
    {'h', 2, 1, load_as_double<int16_t>},
    {'H', 2, 1, load_as_double<uint16_t>},
    {'i', 4, 1, load_as_double<int32_t>},
    {'I', 4, 1, load_as_double<uint32_t>},
    {'q', 8, 1, load_as_double<int64_t>},
    {'Q', 8, 1, load_as_double<uint64_t>},
    {'f', 4, 1, load_as_double<float>},
    {'d', 8, 1, load_as_double<double>},
    {'c', 2, 1e-2, load_as_double<int16_t>},
    {'C', 2, 1e-2, load_as_double<uint16_t>},
    {'e', 4, 1e-2, load_as_double<int32_t>},
    {'E', 4, 1e-2, load_as_double<uint32_t>},
    {'L', 4, 1e-7, load_as_double<int32_t>},
    {'n', 4, 1, no_number},
    {'N', 16, 1, no_number},
    {'Z', 64, 1, no_number},
    {'a', 64, 1, no_number},
    {'g', 2, 1, no_number},
};

struct Kind {
  std::string name;
  size_t length = 0;  // with its header
  std::vector<const FormatCharacter*> fields;
  std::vector<std::string> labels;
  LogTable* table = nullptr;  // null: nobody wants it
};

// FMTU's: a character a field.
struct Units {
  std::string units, multipliers;
};

class DataflashParser {
 public:
  DataflashParser(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted)
      : bytes_(bytes), name_(name), wanted_(wanted) {
    kinds_[kFmtId] = Kind{"FMT", kFmtLength, {}, {}, nullptr};
  }

  LogTables parse() {
    if (!is_dataflash(bytes_)) {
      throw std::runtime_error(name_ + ": no DataFlash log: expected it to begin with a message FMT");
    }
    size_t at = 0;
    while (at < bytes_.size()) {
      if (const Kind* kind = kind_at(at)) {
        take(*kind, bytes_.subspan(at + kHeader, kind->length - kHeader));
        at += kind->length;
      } else {
        const size_t lost = at++;
        while (at < bytes_.size() && !trusted(at)) ++at;
        lost_bytes_ += at - lost;
        if (!first_lost_) first_lost_ = lost;
      }
    }
    scale();
    if (lost_bytes_ > 0) {
      log_.problems.push_back(name_ + ": " + std::to_string(lost_bytes_) +
                              " bytes that are no messages, the first at byte " +
                              std::to_string(*first_lost_) + ", skipped");
    }
    return std::move(log_);
  }

 private:
  // The kind of a message that is whole; null where there is none.
  const Kind* kind_at(size_t at) const {
    if (bytes_.size() - at < kHeader || bytes_[at] != kHead1 || bytes_[at + 1] != kHead2) return nullptr;
    const Kind& kind = kinds_[bytes_[at + 2]];
    return kind.length > 0 && bytes_.size() - at >= kind.length ? &kind : nullptr;
  }

  bool trusted(size_t at) const {
    for (int i = 0; i < kMessagesToTrust; ++i) {
      if (at == bytes_.size()) return i > 0;
      const Kind* kind = kind_at(at);
      if (!kind) return false;
      at += kind->length;
    }
    return true;
  }

  void take(const Kind& kind, LogBytes body) {
    if (kind.name == "FMT" && kind.length == kFmtLength) {
      define(body);
      return;
    }
    if (kind.name == "MULT" && is_like(kind, "Qbd")) multipliers_[body[8]] = load<double>(body, 9);
    if (kind.name == "FMTU" && is_like(kind, "QBNN")) {
      units_[body[8]] = {load_text(body.subspan(9, 16)), load_text(body.subspan(25, 16))};
      return;
    }
    if (std::find(log_.names.begin(), log_.names.end(), kind.name) == log_.names.end()) {
      log_.names.push_back(kind.name);
    }
    if (!kind.table) return;
    size_t offset = 0;
    for (const FormatCharacter* field : kind.fields) {
      kind.table->numbers.push_back(field->load(body, offset));
      offset += field->size;
    }
  }

  static bool is_like(const Kind& kind, std::string_view format) {
    return kind.fields.size() == format.size() &&
           std::equal(format.begin(), format.end(), kind.fields.begin(),
                      [](char c, const FormatCharacter* field) { return field->character == c; });
  }

  void define(LogBytes body) {
    const uint8_t id = body[0];
    if (id == kFmtId) return;
    Kind kind;
    kind.length = body[1];
    kind.name = load_text(body.subspan(2, 4));
    const std::string format = load_text(body.subspan(6, 16));
    std::string_view labels;
    const std::string all_labels = load_text(body.subspan(22, 64));
    labels = all_labels;
    size_t length = kHeader;
    for (const char c : format) {
      const auto* field = std::find_if(std::begin(kCharacters), std::end(kCharacters),
                                       [&](const FormatCharacter& known) { return known.character == c; });
      if (field == std::end(kCharacters)) break;
      kind.fields.push_back(field);
      length += field->size;
      const size_t comma = std::min(labels.find(','), labels.size());
      kind.labels.emplace_back(labels.substr(0, comma));
      labels.remove_prefix(std::min(comma + 1, labels.size()));
    }
    const bool other = kinds_[id].length > 0 && kinds_[id].name != kind.name;
    if (kind.length < kHeader || other || !kinds_[id].fields.empty())
      return;  // what is known and sound stays
    const bool wanted = std::find(wanted_.begin(), wanted_.end(), kind.name) != wanted_.end();
    if (kind.fields.size() != format.size() || length != kind.length) {
      if (wanted) {
        log_.problems.push_back(name_ + ": " + kind.name + ": its format makes " + std::to_string(length) +
                                " bytes, its messages have " + std::to_string(kind.length) + ", skipped");
      }
      kind.fields.clear();
    } else if (wanted) {
      LogTable& table = log_.tables[kind.name];
      if (table.columns.empty()) {
        table.columns = kind.labels;
        ids_[kind.name] = id;
      }
      if (table.columns == kind.labels) kind.table = &table;
    }
    kinds_[id] = std::move(kind);
  }

  // By the log's own multipliers, which take the place of what format characters imply ('?' is one that
  // nobody has worked out, '-' that of a text); but for times, whose names say their units (TimeUS, GMS).
  // FMTU comes after rows already.
  void scale() {
    for (auto& [kind_name, table] : log_.tables) {
      const Kind& kind = kinds_[ids_[kind_name]];
      const auto told = units_.find(ids_[kind_name]);
      for (size_t i = 0; i < table.columns.size() && i < kind.fields.size(); ++i) {
        const double told_factor = told == units_.end() ? 0 : multiplier(told->second, i);
        const double factor = told_factor != 0 ? told_factor : kind.fields[i]->scale;
        if (factor == 1) continue;
        for (size_t row = 0; row < table.rows(); ++row)
          table.numbers[row * table.columns.size() + i] *= factor;
      }
    }
  }

  // 0 where the log says none.
  double multiplier(const Units& of, size_t field) const {
    if (field >= of.multipliers.size() || field >= of.units.size()) return 0;
    const char c = of.multipliers[field];
    if (c == '?' || c == '-' || of.units[field] == 's') return 0;
    const auto it = multipliers_.find(static_cast<uint8_t>(c));
    return it == multipliers_.end() ? 0 : it->second;
  }

  LogBytes bytes_;
  const std::string& name_;
  std::span<const std::string_view> wanted_;
  LogTables log_;
  std::array<Kind, 256> kinds_;
  std::map<std::string, uint8_t> ids_;
  std::map<uint8_t, Units> units_;  // of a kind
  std::map<uint8_t, double> multipliers_;
  size_t lost_bytes_ = 0;
  std::optional<size_t> first_lost_;
};

}  // namespace

bool is_dataflash(LogBytes bytes) {
  return bytes.size() >= kHeader && bytes[0] == kHead1 && bytes[1] == kHead2 && bytes[2] == kFmtId;
}

LogTables parse_dataflash(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted) {
  return DataflashParser(bytes, name, wanted).parse();
}

}  // namespace perch
