#pragma once

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/string_body.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <memory>
#include <string>
#include <vector>

#include "perch/station/client_feed.h"
#include "perch/station/picture_message.h"
#include "perch/station/server.h"

namespace perch {

// One page that watches: a WebSocket with at most one message on the way to the kernel. Messages out are
// numbered from 1, and the page acknowledges each.
//
//   out   {"hello": ...} first, {"status": ...}, {"event": ...}; binary: rows (1), a part of a picture (2)
//   in    {"from": {"session": "...", "sequence": 17}}   what it has of which run; the first message
//         {"ack": 12}   {"view": {"grey": true, "binary": true, "close": false}}
//         {"do": "record" | "stop" | "mark" | "centre", "text": "..."}
// What is in it and none of these ends the connection. docs/STATION.md says what is in each.
class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  using Request = boost::beast::http::request<boost::beast::http::string_body>;

  Watcher(Station::Server& server, boost::beast::tcp_stream stream);
  ~Watcher();

  void begin(Request request);
  // Sends what may be sent; to be called now and then.
  void tick();
  bool wants_picture(int64_t now_ns);

 private:
  void read();
  bool hear(std::string_view text);
  bool hear_command(const nlohmann::json& message);
  void send_next();
  bool choose();
  bool choose_part(int64_t now_ns);
  void send(bool binary);
  void hang_up();

  Station::Server& server_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> socket_;
  Request request_;
  boost::beast::flat_buffer incoming_;
  std::vector<uint8_t> bytes_;  // on the way to the kernel: these, or
  std::string text_;
  std::shared_ptr<const std::vector<uint8_t>> picture_;  // that is being sent
  size_t picture_sent_ = 0;                              // bytes of it
  ClientFeed feed_;
  PictureWish wish_;
  bool open_ = false, writing_ = false, greeted_ = false;
  uint64_t told_status_ = 0, told_events_ = 0, told_picture_ = 0;
  double messages_allowed_;
  int64_t heard_ns_;
};

}  // namespace perch
