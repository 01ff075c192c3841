#pragma once

#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/http/parser.hpp>
#include <boost/beast/http/string_body.hpp>
#include <memory>
#include <optional>

#include "perch/station/http_reply.h"
#include "perch/station/server.h"

namespace perch {

// One connection of a browser: requests and replies, until one asks for the WebSocket, which takes it over.
class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(Station::Server& server, boost::asio::ip::tcp::socket socket);
  ~Connection();

  void begin();

 private:
  void read();
  void handle(const boost::beast::error_code& error);
  bool upgrade(const HttpQuestion& question);
  void write(HttpReply reply, bool keep_alive, bool head);

  Station::Server& server_;
  boost::beast::tcp_stream stream_;
  boost::beast::flat_buffer buffer_;
  std::optional<boost::beast::http::request_parser<boost::beast::http::string_body>> parser_;
  HttpReply reply_;
};

}  // namespace perch
