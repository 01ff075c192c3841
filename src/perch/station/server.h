#pragma once

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "perch/station/gate.h"
#include "perch/station/state_ring.h"
#include "perch/station/station.h"

namespace perch {

class Watcher;

// CLOCK_MONOTONIC, ns.
int64_t station_now_ns();

// What the station's thread has; but for what `mutex` guards only that thread uses it.
struct Station::Server {
  Server(Station& owner, const StationOptions& station_options, StationScene station_scene);
  ~Server();

  void run();
  void stop();

  // Of this moment's picture, made once for all who want the same.
  std::shared_ptr<const std::vector<uint8_t>> picture_for(const PictureWish& wish);
  bool take_command(StationCommand command);

  Station& station;
  const StationOptions options;
  const StationScene scene;
  const std::string session = random_secret();  // numbers of rows begin anew with each
  boost::asio::io_context io;
  Gate gate;
  StateRing ring;
  std::shared_ptr<const SeenPicture> picture;
  uint64_t picture_number = 0;
  std::string hello, status;
  uint64_t status_number = 0;
  std::deque<std::string> events;  // as messages, the last ones
  uint64_t events_begin = 0;       // the number of the first of them
  std::vector<std::weak_ptr<Watcher>> watchers;

  std::atomic<size_t> connections = 0, watching = 0;
  std::atomic<uint64_t> refused = 0, bytes_out = 0;

  std::mutex mutex;
  std::string new_status;
  std::vector<std::string> new_events;
  std::vector<StationCommand> commands;

 private:
  void accept();
  void tick();
  void fetch();

  boost::asio::ip::tcp::acceptor acceptor_;
  boost::asio::steady_timer timer_, accept_timer_;
  std::vector<StateRow> rows_;
  std::map<PictureWish, std::shared_ptr<const std::vector<uint8_t>>> pictures_;
  int64_t picture_asked_ns_ = 0;
  std::atomic<bool> stopping_ = false;
  friend class Station;
};

}  // namespace perch
