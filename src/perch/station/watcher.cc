#include "perch/station/watcher.h"

#include <boost/asio/buffer.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <limits>

namespace perch {
namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
using Json = nlohmann::json;

// Everything a page sends is smaller.
constexpr size_t kMostIncoming = 1024;
// An acknowledgement for each of our messages, of which there are 30 a second, and what a person does.
constexpr double kMostMessages = 100;  // a second
constexpr size_t kMostMark = 200;      // bytes

}  // namespace

Watcher::Watcher(Station::Server& server, beast::tcp_stream stream)
    : server_(server),
      socket_(std::move(stream)),
      incoming_(kMostIncoming),
      feed_(server.options.bandwidth, station_now_ns()),
      messages_allowed_(kMostMessages),
      heard_ns_(station_now_ns()) {
  ++server_.watching;
}

Watcher::~Watcher() { --server_.watching; }

void Watcher::begin(Request request) {
  request_ = std::move(request);
  beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has its own
  websocket::stream_base::timeout timeout{};
  timeout.handshake_timeout = std::chrono::seconds(5);
  timeout.idle_timeout = std::chrono::duration_cast<std::chrono::seconds>(
      std::chrono::duration<double>(server_.options.stall_timeout + 0.999));
  timeout.keep_alive_pings = true;
  socket_.set_option(timeout);
  socket_.read_message_max(kMostIncoming);
  socket_.async_accept(request_, [self = shared_from_this()](const beast::error_code& error) {
    if (error) return;
    self->open_ = true;
    self->read();
    self->send_next();
  });
}

void Watcher::hang_up() {
  open_ = false;
  beast::get_lowest_layer(socket_).close();
}

void Watcher::read() {
  socket_.async_read(incoming_, [self = shared_from_this()](const beast::error_code& error, size_t) {
    if (error) return self->hang_up();
    const std::string text(static_cast<const char*>(self->incoming_.data().data()), self->incoming_.size());
    self->incoming_.clear();
    if (!self->open_ || !self->socket_.got_text() || !self->hear(text)) return self->hang_up();
    self->read();
    self->send_next();
  });
}

bool Watcher::hear(std::string_view text) {
  const int64_t now_ns = station_now_ns();
  messages_allowed_ += kMostMessages * 1e-9 * static_cast<double>(now_ns - heard_ns_);
  messages_allowed_ = std::min(messages_allowed_, kMostMessages) - 1;
  heard_ns_ = now_ns;
  if (messages_allowed_ < 0) return false;
  const Json message = Json::parse(text, nullptr, false);
  if (!message.is_object()) return false;
  if (const auto ack = message.find("ack"); ack != message.end())
    return ack->is_number_unsigned() && feed_.acknowledged(ack->get<uint64_t>(), now_ns);
  if (const auto from = message.find("from"); from != message.end()) {
    if (!from->is_object()) return false;
    const auto session = from->find("session"), sequence = from->find("sequence");
    if (session == from->end() || !session->is_string() || sequence == from->end() ||
        !sequence->is_number_unsigned() || sequence->get<uint64_t>() > std::numeric_limits<uint32_t>::max())
      return false;
    const bool ours = session->get_ref<const std::string&>() == server_.session;
    feed_.ask_from(ours ? sequence->get<uint32_t>() : 0, server_.ring);
    return true;
  }
  if (const auto view = message.find("view"); view != message.end()) {
    for (const auto& [name, flag] :
         {std::pair{"grey", &wish_.grey}, {"binary", &wish_.binary}, {"close", &wish_.close}}) {
      if (!view->is_object() || !view->contains(name) || !(*view)[name].is_boolean()) return false;
      *flag = (*view)[name].get<bool>();
    }
    return true;
  }
  return hear_command(message);
}

bool Watcher::hear_command(const Json& message) {
  const auto what = message.find("do");
  if (what == message.end() || !what->is_string() || !server_.options.control) return false;
  using Kind = StationCommand::Kind;
  for (const auto& [name, kind] : {std::pair{"record", Kind::kStartRecording},
                                   {"stop", Kind::kStopRecording},
                                   {"mark", Kind::kMark},
                                   {"centre", Kind::kCentreHead}}) {
    if (*what != name) continue;
    std::string text;
    if (const auto said = message.find("text"); said != message.end() && said->is_string())
      text = said->get<std::string>().substr(0, kMostMark);
    return server_.take_command({kind, text});
  }
  return false;
}

void Watcher::tick() {
  if (!open_) return;
  if (feed_.stalled(station_now_ns()) > server_.options.stall_timeout) return hang_up();
  send_next();
}

bool Watcher::wants_picture(int64_t now_ns) {
  return open_ && (wish_.grey || wish_.binary) && !picture_ && told_picture_ == server_.picture_number &&
         feed_.may_begin_picture(now_ns);
}

void Watcher::send_next() {
  if (!open_ || writing_) return;
  bytes_.clear();
  text_.clear();
  if (choose()) send(text_.empty());
}

// Fills text_ or bytes_.
bool Watcher::choose() {
  if (!greeted_) {
    greeted_ = true;
    text_ = server_.hello;
    return true;
  }
  const int64_t now_ns = station_now_ns();
  const auto rows = feed_.next_rows(server_.ring, now_ns);
  if (!rows.empty()) {
    bytes_ = {1, static_cast<uint8_t>(feed_.whole()), 0, 0};
    for (const uint32_t row : rows) append_row(server_.ring.at(row), bytes_);
    return true;
  }
  if (feed_.in_flight() > ClientFeed::kMostInFlight) return false;
  told_events_ = std::max(told_events_, server_.events_begin);
  if (told_events_ < server_.events_begin + server_.events.size()) {
    text_ = server_.events[told_events_++ - server_.events_begin];
    return true;
  }
  if (told_status_ != server_.status_number) {
    told_status_ = server_.status_number;
    text_ = server_.status;
    return true;
  }
  return choose_part(now_ns);
}

bool Watcher::choose_part(int64_t now_ns) {
  if (!picture_) {
    if (told_picture_ == server_.picture_number || !feed_.may_begin_picture(now_ns)) return false;
    told_picture_ = server_.picture_number;
    if (wish_.grey || wish_.binary) picture_ = server_.picture_for(wish_);
    if (!picture_) return false;
    picture_sent_ = 0;
    feed_.began_picture(picture_->size(), now_ns);
  }
  if (!feed_.may_send_part(now_ns)) return false;
  const size_t size = std::min(feed_.part_bytes(), picture_->size() - picture_sent_);
  const auto begin = picture_->begin() + static_cast<std::ptrdiff_t>(picture_sent_);
  picture_sent_ += size;
  const bool last = picture_sent_ == picture_->size();
  bytes_ = {2, static_cast<uint8_t>(last), 0, 0};
  bytes_.insert(bytes_.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
  if (last) picture_.reset();
  return true;
}

void Watcher::send(bool binary) {
  const auto buffer = binary ? boost::asio::buffer(static_cast<const void*>(bytes_.data()), bytes_.size())
                             : boost::asio::buffer(static_cast<const void*>(text_.data()), text_.size());
  writing_ = true;
  feed_.sent(buffer.size(), station_now_ns());
  server_.bytes_out += buffer.size();
  socket_.binary(binary);
  socket_.async_write(buffer, [self = shared_from_this()](const beast::error_code& error, size_t) {
    self->writing_ = false;
    if (error) return self->hang_up();
    self->send_next();
  });
}

}  // namespace perch
