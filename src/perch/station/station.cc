#include "perch/station/station.h"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/ip/address.hpp>
#include <boost/asio/post.hpp>
#include <chrono>
#include <stdexcept>

#include "perch/station/connection.h"
#include "perch/station/hello.h"
#include "perch/station/server.h"
#include "perch/station/watcher.h"

namespace perch {
namespace {

using namespace std::chrono_literals;
using boost::asio::ip::tcp;
using Json = nlohmann::json;

constexpr auto kTick = 50ms;
// Ten pictures a second are a film; the budget mostly allows two.
constexpr int64_t kPictureEvery = 100'000'000;
constexpr size_t kMostEvents = 50;
constexpr size_t kMostCommands = 16;
// Of the page's threads this one may wait when the estimator needs the processor.
constexpr int kNice = 10;

std::string text_of(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace); }

}  // namespace

int64_t station_now_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

Station::Server::Server(Station& owner, const StationOptions& station_options, StationScene station_scene)
    : station(owner),
      options(station_options),
      scene(std::move(station_scene)),
      io(1),
      gate(options.token),
      acceptor_(io),
      timer_(io),
      accept_timer_(io) {
  Json greeting = hello_json(scene, options);
  greeting["session"] = session;
  hello = text_of({{"hello", greeting}});
  const tcp::endpoint endpoint(boost::asio::ip::make_address(options.address), options.port);
  try {
    acceptor_.open(endpoint.protocol());
    acceptor_.set_option(tcp::acceptor::reuse_address(true));
    acceptor_.bind(endpoint);
    acceptor_.listen();
  } catch (const boost::system::system_error& e) {
    throw std::runtime_error("outputs.station.listen: " + options.address + ":" +
                             std::to_string(options.port) + ": " + e.code().message());
  }
  accept();
  tick();
}

Station::Server::~Server() = default;

void Station::Server::run() {
  setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNice);
  while (!stopping_) {
    try {
      io.run();
      return;
    } catch (const std::exception& e) {
      // Of one connection's handler: memory that ran out, a picture that cannot be encoded. The others go on.
      const std::lock_guard lock(mutex);
      if (new_events.size() < kMostEvents) new_events.push_back(std::string("station: ") + e.what());
    }
  }
}

void Station::Server::stop() {
  stopping_ = true;
  io.stop();
}

void Station::Server::accept() {
  acceptor_.async_accept([this](const boost::system::error_code& error, tcp::socket socket) {
    if (error == boost::asio::error::operation_aborted) return;
    if (error) {  // no file descriptor left: not at once again
      accept_timer_.expires_after(100ms);
      accept_timer_.async_wait([this](const boost::system::error_code& aborted) {
        if (!aborted) accept();
      });
      return;
    }
    if (connections + watching < options.most_connections) {
      boost::system::error_code ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      socket.set_option(boost::asio::socket_base::send_buffer_size(options.send_buffer), ignored);
      std::make_shared<Connection>(*this, std::move(socket))->begin();
    } else {
      ++refused;
    }
    accept();
  });
}

void Station::Server::tick() {
  timer_.expires_after(kTick);
  timer_.async_wait([this](const boost::system::error_code& aborted) {
    if (aborted) return;
    tick();
    fetch();
    const int64_t now_ns = station_now_ns();
    std::erase_if(watchers, [](const auto& watcher) { return watcher.expired(); });
    bool wanted = false;
    for (const auto& weak : std::vector(watchers)) {
      const auto watcher = weak.lock();
      if (!watcher) continue;
      watcher->tick();
      wanted = wanted || watcher->wants_picture(now_ns);
    }
    if (wanted && now_ns - picture_asked_ns_ >= kPictureEvery) {
      picture_asked_ns_ = now_ns;
      station.wants_picture_ = true;
    }
    timespec used{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
    station.cpu_seconds_ = static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  });
}

void Station::Server::fetch() {
  if (auto seen = station.mailbox_.fetch(rows_)) {
    picture = std::move(seen);
    ++picture_number;
    pictures_.clear();
  }
  for (const StateRow& row : rows_) ring.add(row);
  const std::lock_guard lock(mutex);
  if (!new_status.empty()) {
    status.swap(new_status);
    new_status.clear();
    ++status_number;
  }
  for (std::string& event : new_events) {
    events.push_back(text_of({{"event", event}}));
    if (events.size() > kMostEvents) {
      events.pop_front();
      ++events_begin;
    }
  }
  new_events.clear();
}

std::shared_ptr<const std::vector<uint8_t>> Station::Server::picture_for(const PictureWish& wish) {
  if (!picture) return nullptr;
  auto& made = pictures_[wish];
  if (!made) {
    made = std::make_shared<const std::vector<uint8_t>>(
        picture_message(*picture, scene.target, scene.camera, wish));
  }
  return made;
}

bool Station::Server::take_command(StationCommand command) {
  const std::lock_guard lock(mutex);
  if (commands.size() < kMostCommands) commands.push_back(std::move(command));
  return true;
}

Station::Station(const StationOptions& options, StationScene scene)
    : server_(std::make_unique<Server>(*this, options, std::move(scene))),
      port_(server_->acceptor_.local_endpoint().port()),
      thread_([this] { server_->run(); }) {}

Station::~Station() {
  server_->stop();
  thread_.join();
}

void Station::tell_status(Json status) {
  std::string text = text_of({{"status", std::move(status)}});
  const std::lock_guard lock(server_->mutex);
  server_->new_status.swap(text);
}

void Station::tell_event(const std::string& what) {
  const std::lock_guard lock(server_->mutex);
  if (server_->new_events.size() < kMostEvents) server_->new_events.push_back(what);
}

std::vector<StationCommand> Station::take_commands() {
  const std::lock_guard lock(server_->mutex);
  return std::exchange(server_->commands, {});
}

StationCounts Station::counts() const {
  return {server_->connections, server_->watching, server_->refused, mailbox_.lost(), server_->bytes_out};
}

}  // namespace perch
