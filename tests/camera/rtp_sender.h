#pragma once

#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <cstring>
#include <opencv2/core.hpp>
#include <string>

#include "perch/camera/live_source.h"
#include "support/free_port.h"

namespace perch {

// A number drawn as 8 x 8 squares, dark for 0, which survives a JPEG.
inline cv::Mat drawn_number(uint64_t number, int square_px) {
  cv::Mat picture(8 * square_px, 8 * square_px, CV_8UC1);
  for (int bit = 0; bit < 64; ++bit) {
    picture(cv::Rect(bit % 8 * square_px, bit / 8 * square_px, square_px, square_px)) =
        (number >> bit & 1) ? 220 : 30;
  }
  return picture;
}

inline uint64_t number_in(const cv::Mat& picture) {
  uint64_t number = 0;
  const int square_px = picture.cols / 8;
  for (int bit = 0; bit < 64; ++bit) {
    const cv::Rect middle(bit % 8 * square_px + square_px / 4, bit / 8 * square_px + square_px / 4,
                          square_px / 2, square_px / 2);
    if (cv::mean(picture(middle))[0] > 125) number |= uint64_t{1} << bit;
  }
  return number;
}

// A camera on the network: sends pictures on which the time of their making is drawn.
class RtpSender {
 public:
  // `payload` is the pipeline from grey video to RTP.
  RtpSender(const std::string& payload, int port, int square_px) : square_px_(square_px) {
    gst_init(nullptr, nullptr);
    const std::string size = std::to_string(8 * square_px);
    pipeline_ = gst_parse_launch(("appsrc name=in is-live=true do-timestamp=true format=time "
                                  "caps=video/x-raw,format=GRAY8,framerate=0/1,width=" +
                                  size + ",height=" + size + " ! videoconvert ! " + payload +
                                  " ! udpsink host=127.0.0.1 sync=false port=" + std::to_string(port))
                                     .c_str(),
                                 nullptr);
    in_ = gst_bin_get_by_name(GST_BIN(pipeline_), "in");
    gst_element_set_state(pipeline_, GST_STATE_PLAYING);
  }
  ~RtpSender() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(in_);
    gst_object_unref(pipeline_);
  }
  RtpSender(const RtpSender&) = delete;
  RtpSender& operator=(const RtpSender&) = delete;

  void send() {
    const cv::Mat picture = drawn_number(static_cast<uint64_t>(camera_now_ns()), square_px_);
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, picture.total(), nullptr);
    gst_buffer_fill(buffer, 0, picture.data, picture.total());
    gst_app_src_push_buffer(GST_APP_SRC(in_), buffer);
  }

 private:
  int square_px_;
  GstElement *pipeline_, *in_;
};

}  // namespace perch
