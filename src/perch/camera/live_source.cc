#include "perch/camera/live_source.h"

#include "perch/camera/gst_device.h"
#include "perch/camera/live_camera.h"
#include "perch/camera/paced_source.h"
#include "perch/camera/v4l2_device.h"
#include "perch/config/error.h"

namespace perch {

std::unique_ptr<LiveSource> open_live_source(const std::string& source, const LiveOptions& options,
                                             Channel channel) {
  const size_t colon = source.find(':');
  const std::string kind = source.substr(0, colon);
  const std::string what = colon == std::string::npos ? "" : source.substr(colon + 1);
  if (!what.empty()) {
    if (kind == "v4l2") return make_live_camera(make_v4l2_device(what, options, channel), options);
    if (kind == "gst") return make_live_camera(make_gst_device(what, options, channel), options);
    if (kind == "flight" || kind == "images" || kind == "video") {
      return pace_pictures(open_image_source(source, channel), options.pace);
    }
  }
  throw ConfigError(
      "camera.source: expected v4l2:DEVICE, gst:PIPELINE, flight:FOLDER, images:GLOB or video:FILE, found "
      "\"" +
      source + '"');
}

}  // namespace perch
