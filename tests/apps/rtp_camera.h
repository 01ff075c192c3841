#pragma once

#include <gst/app/gstappsrc.h>
#include <gst/gst.h>

#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace perch {

// A camera on the network, of the real GStreamer: JPEGs in RTP packets to ports of this machine.
class RtpCamera {
 public:
  RtpCamera(cv::Size size, const std::vector<int>& ports) {
    gst_init(nullptr, nullptr);
    std::string clients;
    for (const int port : ports) clients += (clients.empty() ? "" : ",") + url(port);
    pipeline_ = gst_parse_launch(("appsrc name=in is-live=true format=time caps=image/jpeg,framerate=0/1,"
                                  "width=" +
                                  std::to_string(size.width) + ",height=" + std::to_string(size.height) +
                                  " ! rtpjpegpay ! multiudpsink sync=false clients=" + clients)
                                     .c_str(),
                                 nullptr);
    in_ = gst_bin_get_by_name(GST_BIN(pipeline_), "in");
    gst_element_set_state(pipeline_, GST_STATE_PLAYING);
    gst_element_get_state(pipeline_, nullptr, nullptr, GST_SECOND);  // a base time there is
  }
  ~RtpCamera() {
    gst_element_set_state(pipeline_, GST_STATE_NULL);
    gst_object_unref(in_);
    gst_object_unref(pipeline_);
  }
  RtpCamera(const RtpCamera&) = delete;
  RtpCamera& operator=(const RtpCamera&) = delete;

  // What perch-live is given as camera.source.
  static std::string source(int port) {
    return "gst:udpsrc port=" + std::to_string(port) +
           " caps=\"application/x-rtp,media=video,clock-rate=90000,encoding-name=JPEG,payload=26\" ! "
           "rtpjitterbuffer latency=100 ! rtpjpegdepay ! jpegdec";
  }

  // A picture as send() takes it: that takes a camera time before it sends, which a test has none of then.
  static std::vector<uint8_t> encoded(const cv::Mat& grey) {
    cv::Mat colours;  // RTP's JPEG has three
    cv::merge(std::vector<cv::Mat>{grey, grey, grey}, colours);
    std::vector<uint8_t> jpeg;
    cv::imencode(".jpg", colours, jpeg, {cv::IMWRITE_JPEG_QUALITY, 95});
    return jpeg;
  }

  // Sends it now; `exposed_ns` of CLOCK_MONOTONIC is what RTP's own times tell apart.
  void send(const std::vector<uint8_t>& jpeg, int64_t exposed_ns) {
    GstBuffer* buffer = gst_buffer_new_allocate(nullptr, jpeg.size(), nullptr);
    gst_buffer_fill(buffer, 0, jpeg.data(), jpeg.size());
    GST_BUFFER_PTS(buffer) = static_cast<GstClockTime>(exposed_ns) - gst_element_get_base_time(pipeline_);
    gst_app_src_push_buffer(GST_APP_SRC(in_), buffer);
  }

 private:
  static std::string url(int port) { return "127.0.0.1:" + std::to_string(port); }

  GstElement *pipeline_, *in_;
};

}  // namespace perch
