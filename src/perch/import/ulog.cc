#include <array>
#include <stdexcept>

#include "perch/import/log_bytes.h"

namespace perch {
namespace {

constexpr std::array<uint8_t, 7> kMagic{0x55, 0x4c, 0x6f, 0x67, 0x01, 0x12, 0x35};
constexpr size_t kFileHeader = 16;    // magic, version, time of the start
constexpr size_t kMessageHeader = 3;  // size, type
// A format's end may be filled up to the size of its largest number, in the log or not.
constexpr size_t kMostPadding = 8;

// How many messages in a row must make sense where reading goes on after some that do not: one in twenty
// random bytes is a type's.
constexpr int kMessagesToTrust = 4;

// Formats nest two or three deep; one that holds itself would never end.
constexpr int kMostNesting = 8;

struct BasicType {
  std::string_view name;
  size_t size;
  double (*load)(LogBytes, size_t);
};

constexpr BasicType kBasicTypes[] = {
    {"int8_t", 1, load_as_double<int8_t>},   {"uint8_t", 1, load_as_double<uint8_t>},
    {"int16_t", 2, load_as_double<int16_t>}, {"uint16_t", 2, load_as_double<uint16_t>},
    {"int32_t", 4, load_as_double<int32_t>}, {"uint32_t", 4, load_as_double<uint32_t>},
    {"int64_t", 8, load_as_double<int64_t>}, {"uint64_t", 8, load_as_double<uint64_t>},
    {"float", 4, load_as_double<float>},     {"double", 8, load_as_double<double>},
    {"bool", 1, load_as_double<uint8_t>},    {"char", 1, no_number},
};

struct Field {
  std::string type, name;
  size_t count = 1;
  bool is_array = false;
};

// "float[4] q" and "uint64_t timestamp".
std::optional<Field> parse_field(std::string_view text) {
  const size_t space = text.find(' ');
  if (space == std::string_view::npos || space == 0 || space + 1 == text.size()) return std::nullopt;
  Field field;
  std::string_view type = text.substr(0, space);
  field.name = text.substr(space + 1);
  if (const size_t bracket = type.find('['); bracket != std::string_view::npos) {
    field.is_array = true;
    field.count = 0;
    for (const char c : type.substr(bracket + 1)) {
      if (c == ']') break;
      if (c < '0' || c > '9' || field.count > 65535) return std::nullopt;
      field.count = field.count * 10 + static_cast<size_t>(c - '0');
    }
    type = type.substr(0, bracket);
  }
  field.type = type;
  return field;
}

// Where a subscribed topic's numbers are in its messages.
struct Layout {
  struct Column {
    size_t offset;
    double (*load)(LogBytes, size_t);
  };
  std::vector<Column> columns;
  size_t size = 0;  // without padding at the end, which is not logged
};

struct Subscription {
  std::string topic;
  Layout layout;
  LogTable* table = nullptr;  // null: nobody wants it
};

class UlogParser {
 public:
  UlogParser(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted)
      : bytes_(bytes), name_(name), wanted_(wanted) {}

  LogTables parse() {
    if (!is_ulog(bytes_)) throw std::runtime_error(name_ + ": no ULog: expected it to begin with \"ULog\"");
    if (bytes_.size() < kFileHeader) throw std::runtime_error(name_ + ": a ULog cut off within its header");
    size_t at = kFileHeader;
    // Data appended after a crash begin at told places, whatever message stands before them unfinished.
    read_flags(at);
    std::vector<size_t> ends = appended_;
    ends.push_back(bytes_.size());
    std::sort(ends.begin(), ends.end());
    for (const size_t end : ends) {
      if (end > at && end <= bytes_.size()) read_until(at, end);
    }
    note_losses();
    return std::move(log_);
  }

 private:
  struct Message {
    char type;
    LogBytes body;
    size_t end;
  };

  std::optional<Message> message_at(size_t at, size_t end) const {
    if (end - at < kMessageHeader) return std::nullopt;
    const size_t size = load<uint16_t>(bytes_, at);
    if (end - at - kMessageHeader < size) return std::nullopt;
    return Message{static_cast<char>(bytes_[at + 2]), bytes_.subspan(at + kMessageHeader, size),
                   at + kMessageHeader + size};
  }

  // The definitions begin with it, if the file has it at all.
  void read_flags(size_t at) {
    const auto message = message_at(at, bytes_.size());
    if (!message || message->type != 'B' || message->body.size() < 40) return;
    constexpr uint8_t kDataAppended = 1;
    for (size_t i = 0; i < 8; ++i) {
      const uint8_t known = i == 0 ? kDataAppended : 0;
      if (message->body[8 + i] & ~known) {
        throw std::runtime_error(name_ + ": a ULog that says by its flags that it cannot be read without " +
                                 "knowing more than the format's version 1");
      }
    }
    for (size_t i = 0; i < 3 && message->body[8]; ++i) {
      appended_.push_back(load<uint64_t>(message->body, 16 + 8 * i));
    }
  }

  void read_until(size_t& at, size_t end) {
    while (at < end) {
      const auto message = message_at(at, end);
      const bool sound = message && makes_sense(*message);
      if (sound && (message->end == end || next_makes_sense(message->end, end))) {
        take(*message);
        at = message->end;
        continue;
      }
      // This one is broken, or the next: a length that is wrong leads past messages that are right.
      size_t next = at + 1;
      while (next < end && !trusted(next, end)) ++next;
      if (message && next >= message->end) {
        // A sound one, or of a type yet to be invented, or of a topic whose subscription was lost.
        if (sound) take(*message);
        if (sound || next == message->end) {
          at = message->end;
          continue;
        }
      }
      lost_bytes_ += next - at;
      if (!first_lost_) first_lost_ = at;
      at = next;
    }
  }

  bool next_makes_sense(size_t at, size_t end) const {
    const auto message = message_at(at, end);
    return message && makes_sense(*message);
  }

  bool makes_sense(const Message& message) const {
    const LogBytes body = message.body;
    switch (message.type) {
      case 'D': {
        if (body.size() < 2) return false;
        const auto it = subscriptions_.find(load<uint16_t>(body, 0));
        if (it == subscriptions_.end() || body.size() - 2 < it->second.layout.size) return false;
        return body.size() - 2 - it->second.layout.size < kMostPadding;
      }
      case 'A':
        return body.size() > 3 && is_text(body.subspan(3));
      case 'F':
        return is_text(body);
      case 'R':
      case 'O':
        return body.size() == 2;
      case 'S':
        return body.size() == 8;
      case 'L':  // level, time, text; with a tag between
      case 'C':
        return body.size() >= 9 && body.size() < 1024 && body[0] >= '0' && body[0] <= '7';
      case 'B':
        return body.size() == 40;
      case 'I':  // the length of a key, the key
      case 'P':
        return body.size() > 1 && body.size() > body[0] && is_text(body.subspan(1, body[0]));
      case 'M':  // the same after a byte of flags
      case 'Q':
        return body.size() > 2 && body.size() > body[1] + 1U && is_text(body.subspan(2, body[1]));
      default:
        return false;
    }
  }

  static bool is_text(LogBytes bytes) {
    return std::all_of(bytes.begin(), bytes.end(), [](uint8_t c) { return c >= ' ' && c <= '~'; });
  }

  bool trusted(size_t at, size_t end) const {
    for (int i = 0; i < kMessagesToTrust; ++i) {
      if (at == end) return i > 0;
      const auto message = message_at(at, end);
      if (!message || !makes_sense(*message)) return false;
      at = message->end;
    }
    return true;
  }

  void take(const Message& message) {
    if (message.type == 'F') define(load_text(message.body));
    if (message.type == 'A') subscribe(message.body);
    if (message.type == 'R' && message.body.size() >= 2)
      subscriptions_.erase(load<uint16_t>(message.body, 0));
    if (message.type == 'O' && message.body.size() >= 2) {
      ++dropouts_;
      dropped_ms_ += load<uint16_t>(message.body, 0);
    }
    if (message.type == 'D') add_row(message.body);
  }

  void define(std::string_view text) {
    const size_t colon = text.find(':');
    if (colon == std::string_view::npos) return;
    std::vector<Field> fields;
    for (std::string_view rest = text.substr(colon + 1); !rest.empty();) {
      const size_t semicolon = std::min(rest.find(';'), rest.size());
      if (const auto field = parse_field(rest.substr(0, semicolon))) fields.push_back(*field);
      rest.remove_prefix(std::min(semicolon + 1, rest.size()));
    }
    formats_.emplace(text.substr(0, colon), std::move(fields));
  }

  // False where a type is unknown.
  bool lay_out(const std::string& type, int depth, Layout& layout, std::vector<std::string>* names) const {
    const auto format = formats_.find(type);
    if (format == formats_.end() || depth > kMostNesting) return false;
    for (const Field& field : format->second) {
      const auto* basic = std::find_if(std::begin(kBasicTypes), std::end(kBasicTypes),
                                       [&](const BasicType& t) { return t.name == field.type; });
      for (size_t i = 0; i < field.count; ++i) {
        // No message is longer than this; nested arrays of arrays would be.
        if (layout.size > 65535) return false;
        if (basic == std::end(kBasicTypes)) {
          const size_t before = layout.size;
          if (!lay_out(field.type, depth + 1, layout, nullptr)) return false;
          if (layout.size == before) break;  // nothing is in it, however many there are
          continue;
        }
        if (names) {
          names->push_back(field.is_array ? field.name + "[" + std::to_string(i) + "]" : field.name);
          layout.columns.push_back({layout.size, basic->load});
        }
        layout.size += basic->size;
      }
      // PX4 fills up a format's end, and leaves that out of the log.
      if (names && field.name.starts_with("_padding") && &field == &format->second.back()) {
        for (size_t i = 0; i < field.count && basic != std::end(kBasicTypes); ++i) {
          names->pop_back();
          layout.columns.pop_back();
          layout.size -= basic->size;
        }
      }
    }
    return true;
  }

  void subscribe(LogBytes body) {
    if (body.size() < 4) return;
    const uint8_t instance = body[0];
    Subscription subscription;
    subscription.topic = load_text(body.subspan(3));
    std::vector<std::string> names;
    if (!lay_out(subscription.topic, 0, subscription.layout, &names)) {
      log_.problems.push_back(name_ + ": topic " + printable(subscription.topic) +
                              ": its format is not in the log, skipped");
      return;
    }
    if (instance == 0 && std::find(wanted_.begin(), wanted_.end(), subscription.topic) != wanted_.end()) {
      LogTable& table = log_.tables[subscription.topic];
      if (table.columns.empty()) table.columns = names;
      // One that was subscribed to again has the same format, or its rows would not fit.
      if (table.columns == names) subscription.table = &table;
    }
    subscriptions_.insert_or_assign(load<uint16_t>(body, 1), std::move(subscription));
  }

  void add_row(LogBytes body) {
    const Subscription& subscription = subscriptions_.find(load<uint16_t>(body, 0))->second;
    if (std::find(log_.names.begin(), log_.names.end(), subscription.topic) == log_.names.end()) {
      log_.names.push_back(subscription.topic);
    }
    if (!subscription.table) return;
    for (const auto& column : subscription.layout.columns) {
      subscription.table->numbers.push_back(column.load(body, 2 + column.offset));
    }
  }

  static std::string printable(std::string text) {
    text.resize(std::min<size_t>(text.size(), 40));
    for (char& c : text) {
      if (c < ' ' || c > '~') c = '?';
    }
    return text;
  }

  void note_losses() {
    if (lost_bytes_ > 0) {
      log_.problems.push_back(name_ + ": " + std::to_string(lost_bytes_) +
                              " bytes that are no messages, the first at byte " +
                              std::to_string(*first_lost_) + ", skipped");
    }
    if (dropouts_ > 0) {
      log_.problems.push_back(name_ + ": the logger dropped messages " + std::to_string(dropouts_) +
                              " times, " + std::to_string(dropped_ms_) + " ms in all");
    }
  }

  LogBytes bytes_;
  const std::string& name_;
  std::span<const std::string_view> wanted_;
  LogTables log_;
  std::vector<size_t> appended_;
  std::map<std::string, std::vector<Field>> formats_;
  std::map<uint16_t, Subscription> subscriptions_;
  size_t lost_bytes_ = 0;
  std::optional<size_t> first_lost_;
  size_t dropouts_ = 0, dropped_ms_ = 0;
};

}  // namespace

bool is_ulog(LogBytes bytes) {
  return bytes.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
}

LogTables parse_ulog(LogBytes bytes, const std::string& name, std::span<const std::string_view> wanted) {
  return UlogParser(bytes, name, wanted).parse();
}

}  // namespace perch
