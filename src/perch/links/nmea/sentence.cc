#include "perch/links/nmea/sentence.h"

#include <array>
#include <charconv>

namespace perch::nmea {

void SentenceParser::parse(std::span<const uint8_t> bytes, int64_t arrival_ns,
                           const OnSentence& on_sentence) {
  for (const uint8_t byte : bytes) {
    if (byte == '$') {
      if (!text_.empty()) give_up();
      text_ = "$";
      star_ = std::string::npos;
      arrival_ns_ = arrival_ns;
    } else if (text_.empty()) {
      statistics_.skipped_bytes += byte != '\r' && byte != '\n';
    } else if (byte < ' ' || byte > '~' || text_.size() >= kLongest) {
      give_up();
    } else {
      if (byte == '*' && star_ == std::string::npos) star_ = text_.size();
      text_ += static_cast<char>(byte);
      // Its line end tells nothing new, and may have been lost.
      if (star_ != std::string::npos && text_.size() == star_ + 3) end(on_sentence);
    }
  }
}

void SentenceParser::give_up() {
  ++statistics_.broken;
  text_.clear();
}

void SentenceParser::end(const OnSentence& on_sentence) {
  const std::string_view body = std::string_view(text_).substr(1, star_ - 1);
  uint8_t sum = 0, told = 0;
  for (const char c : body) sum = static_cast<uint8_t>(sum ^ static_cast<uint8_t>(c));
  const char* const last = text_.data() + text_.size();
  const auto [rest, error] = std::from_chars(last - 2, last, told, 16);
  if (error != std::errc{} || rest != last || sum != told) {
    ++statistics_.bad_checksum;
    text_.clear();
    return;
  }
  std::array<std::string_view, kMostFields + 1> fields;
  size_t count = 0;
  for (size_t from = 0; from <= body.size() && count < fields.size(); ++count) {
    const size_t to = std::min(body.find(',', from), body.size());
    fields[count] = body.substr(from, to - from);
    from = to + 1;
  }
  ++statistics_.good;
  on_sentence({fields[0], std::span(fields).subspan(1, count - 1), arrival_ns_});
  text_.clear();
}

}  // namespace perch::nmea
