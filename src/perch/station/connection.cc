#include "perch/station/connection.h"

#include <boost/beast/http/error.hpp>
#include <boost/beast/http/read.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/http/write.hpp>
#include <boost/beast/websocket/rfc6455.hpp>

#include "perch/station/watcher.h"

namespace perch {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
using Response = http::response<http::span_body<const char>>;

// Room for a browser's headers and cookies of other programs on this host; a body is a token.
constexpr uint32_t kMostHeader = 8192;
constexpr uint64_t kMostBody = 1024;

std::string_view view(beast::string_view text) { return {text.data(), text.size()}; }

HttpQuestion question_of(const http::request<http::string_body>& request) {
  const auto field = [&](http::field name) { return view(request[name]); };
  return {view(request.method_string()),     view(request.target()),
          field(http::field::host),          field(http::field::origin),
          field(http::field::cookie),        field(http::field::content_type),
          field(http::field::if_none_match), request.body()};
}

int status_of(const beast::error_code& error) {
  if (error == http::error::header_limit || error == http::error::buffer_overflow) return 431;
  return error == http::error::body_limit ? 413 : 400;
}

HttpReply error_reply(int status) { return {status, {{"Cache-Control", "no-store"}}, {}, {}}; }

}  // namespace

Connection::Connection(Station::Server& server, boost::asio::ip::tcp::socket socket)
    : server_(server), stream_(std::move(socket)), buffer_(kMostHeader + kMostBody) {
  ++server_.connections;
}

Connection::~Connection() { --server_.connections; }

void Connection::begin() { read(); }

void Connection::read() {
  parser_.emplace();
  parser_->header_limit(kMostHeader);
  parser_->body_limit(kMostBody);
  // For the whole request, not for each byte of it.
  stream_.expires_after(std::chrono::duration_cast<std::chrono::milliseconds>(
      std::chrono::duration<double>(server_.options.request_timeout)));
  http::async_read(
      stream_, buffer_, *parser_,
      [self = shared_from_this()](const beast::error_code& error, size_t) { self->handle(error); });
}

void Connection::handle(const beast::error_code& error) {
  const bool malformed = error.category() == make_error_code(http::error::bad_method).category();
  if (error == http::error::end_of_stream || (error && !malformed)) return;  // gone, or too slow
  if (malformed) return write(error_reply(status_of(error)), false, false);
  const auto& request = parser_->get();
  const HttpQuestion question = question_of(request);
  if (beast::websocket::is_upgrade(request)) {
    if (!upgrade(question))
      write(error_reply(refusal_of_socket(question, server_.gate, station_now_ns())), false, false);
    return;
  }
  write(reply_to(question, server_.gate, station_now_ns()), request.keep_alive(), question.method == "HEAD");
}

// True: the connection is the WebSocket's now, or refused for want of room.
bool Connection::upgrade(const HttpQuestion& question) {
  if (refusal_of_socket(question, server_.gate, station_now_ns()) != 0) return false;
  if (server_.watching >= server_.options.most_watching) {
    ++server_.refused;
    write(error_reply(503), false, false);
    return true;
  }
  const auto watcher = std::make_shared<Watcher>(server_, std::move(stream_));
  server_.watchers.push_back(watcher);
  watcher->begin(parser_->release());
  return true;
}

void Connection::write(HttpReply reply, bool keep_alive, bool head) {
  reply_ = std::move(reply);
  const std::string_view body = reply_.asset.empty() ? std::string_view(reply_.body) : reply_.asset;
  const auto response = std::make_shared<Response>(static_cast<http::status>(reply_.status), 11);
  for (const auto& [name, value] : reply_.headers) response->insert(name, value);
  if (!head) response->body() = {body.data(), body.size()};
  response->keep_alive(keep_alive);
  response->content_length(reply_.status == 304 ? 0 : body.size());
  if (reply_.status == 304) response->erase(http::field::content_length);
  // 200 kB over 64 kbit/s take 25 s.
  stream_.expires_after(std::chrono::seconds(120));
  const auto done = [self = shared_from_this(), response, keep_alive](const beast::error_code& error,
                                                                      size_t) {
    if (error) return;
    if (keep_alive) return self->read();
    beast::error_code ignored;
    self->stream_.socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send, ignored);
  };
  if (!head) return http::async_write(stream_, *response, done);
  const auto serializer = std::make_shared<http::response_serializer<http::span_body<const char>>>(*response);
  http::async_write_header(
      stream_, *serializer,
      [serializer, done](const beast::error_code& error, size_t bytes) { done(error, bytes); });
}

}  // namespace perch
