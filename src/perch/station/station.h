#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "perch/camera/camera_model.h"
#include "perch/frames/frame_chain.h"
#include "perch/station/mailbox.h"
#include "perch/station/station_options.h"
#include "perch/target/landing_target.h"

namespace perch {

// What the page is about.
struct StationScene {
  LandingTarget target;
  CameraModel camera;
  FrameChain frames;
  std::string title;      // the picture source
  bool recorded = false;  // a replay
};

// What someone at the page asks for; only with station.control.
struct StationCommand {
  enum class Kind { kStartRecording, kStopRecording, kMark, kCentreHead };
  Kind kind;
  std::string text;  // of a mark
};

struct StationCounts {
  size_t connections = 0, watching = 0;
  uint64_t refused = 0;    // connections beyond the cap
  uint64_t rows_lost = 0;  // by a full mailbox
  uint64_t bytes_out = 0;  // to those who watch
};

// The ground station's server: HTTP and WebSocket on one thread of its own, of lower priority. Nobody who
// calls any of this waits for it, and no client for another.
//
//   estimator --Mailbox--> station's thread --ClientFeed of each client--> WebSocket
class Station {
 public:
  // Throws std::runtime_error when it cannot listen there.
  Station(const StationOptions& options, StationScene scene);
  ~Station();
  Station(const Station&) = delete;
  Station& operator=(const Station&) = delete;

  // From the estimator's thread.
  void post(const StateRow& row) { mailbox_.post(row); }
  // Whether somebody would see a picture now; if so it is worth a copy.
  bool wants_picture() const { return wants_picture_; }
  void post(std::shared_ptr<const SeenPicture> picture) {
    wants_picture_ = false;
    mailbox_.post(std::move(picture));
  }

  // From any thread. `status` is shown as it is (web/station/status.js); events are lines of a log.
  void tell_status(nlohmann::json status);
  void tell_event(const std::string& what);
  // What was asked for since the last call.
  std::vector<StationCommand> take_commands();

  uint16_t port() const { return port_; }
  StationCounts counts() const;
  double cpu_seconds() const { return cpu_seconds_; }

  struct Server;  // the thread's own

 private:
  Mailbox mailbox_;
  std::atomic<bool> wants_picture_ = false;
  std::atomic<double> cpu_seconds_ = 0;
  std::unique_ptr<Server> server_;
  uint16_t port_ = 0;
  std::thread thread_;
};

}  // namespace perch
