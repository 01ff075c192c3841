#include "perch/camera/image_source.h"

#include <opencv2/core/utils/logger.hpp>
#include <stdexcept>

#include "perch/camera/picture_source.h"
#include "perch/camera/video_source.h"

namespace perch {

std::unique_ptr<ImageSource> open_image_source(const std::string& source, Channel channel) {
  // What is wrong with a file is said by Frame::problem; OpenCV would say it again on stderr.
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  const size_t colon = source.find(':');
  const std::string kind = source.substr(0, colon);
  const std::string what = colon == std::string::npos ? "" : source.substr(colon + 1);
  if (!what.empty()) {
    if (kind == "flight") return open_flight_pictures(what, channel);
    if (kind == "images") return open_pictures(what, channel);
    if (kind == "video") return open_video(what, channel);
  }
  throw std::runtime_error(source + ": expected flight:FOLDER, images:GLOB or video:FILE");
}

}  // namespace perch
