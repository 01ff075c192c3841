#include "perch/camera/gst_device.h"

#include <gst/app/gstappsink.h>
#include <gst/gst.h>
#include <gst/video/video.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <stdexcept>

#include "perch/camera/to_grey.h"
#include "perch/config/error.h"

namespace perch {

namespace {

// GStreamer's counted things, each with what gives it back.
template <auto Free>
struct Release {
  template <typename T>
  void operator()(T* thing) const {
    Free(thing);
  }
};
using Element = std::unique_ptr<GstElement, Release<gst_object_unref>>;
using Sample = std::unique_ptr<GstSample, Release<gst_sample_unref>>;
using Message = std::unique_ptr<GstMessage, Release<gst_message_unref>>;
using Bus = std::unique_ptr<GstBus, Release<gst_object_unref>>;
using Clock = std::unique_ptr<GstClock, Release<gst_object_unref>>;
using Pad = std::unique_ptr<GstPad, Release<gst_object_unref>>;
using GError_ = std::unique_ptr<GError, Release<g_error_free>>;

constexpr char kSink[] = "perch_sink";
// How often a wait for a picture looks whether the pipeline broke meanwhile.
constexpr int64_t kLookNs = 50'000'000;
// An rtpjitterbuffer matches the sender's clock to ours by the quickest packet of two seconds. Until it has
// seen these, stamps are late by what the first packet was, less and less: 3 ms where that was encoded
// slowly, as long as a radio link likes to take.
constexpr int64_t kRtpSettlesNs = 2'100'000'000;

void start_gstreamer() {
  static std::once_flag once;
  std::call_once(once, [] {
    gst_segtrap_set_enabled(FALSE);  // a program's signals are its own
    GError* error = nullptr;
    if (gst_init_check(nullptr, nullptr, &error)) return;
    const GError_ owned(error);
    throw std::runtime_error(std::string("GStreamer does not start: ") +
                             (error ? error->message : "no reason"));
  });
}

Element parse(const std::string& description) {
  GError* error = nullptr;
  GstElement* parsed =
      gst_parse_launch_full(description.c_str(), nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &error);
  Element pipeline(parsed ? GST_ELEMENT(gst_object_ref_sink(parsed)) : nullptr);
  const GError_ owned(error);
  if (error) throw std::runtime_error(error->message);
  if (!pipeline || !GST_IS_PIPELINE(pipeline.get())) throw std::runtime_error("no pipeline");
  return pipeline;
}

class GstDevice : public CameraDevice {
 public:
  GstDevice(const std::string& pipeline, const LiveOptions& options, Channel channel)
      : pipeline_text_(pipeline), options_(options), channel_(channel) {
    if (!options.format.empty() || options.exposure || options.gain) {
      throw ConfigError(
          "camera: format, exposure and gain are for v4l2 sources; a pipeline sets them itself");
    }
    start_gstreamer();
    try {
      parse(description());
    } catch (const std::runtime_error& e) {
      throw ConfigError("camera.source: " + name() + ": " + e.what());
    }
  }
  ~GstDevice() override { close(); }

  std::string name() const override { return "gst:" + pipeline_text_; }

  void open() override {
    try {
      pipeline_ = parse(description());
      sink_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), kSink));
      bus_.reset(gst_element_get_bus(pipeline_.get()));
      if (!sink_) throw std::runtime_error("an element of the name " + std::string(kSink) + " is not ours");
      number_arrivals();
      use_monotonic_clock();
      play();
    } catch (const std::runtime_error& e) {
      const std::string why = broken().value_or(e.what());
      close();
      throw std::runtime_error(name() + ": " + why);
    }
  }

  void close() override {
    if (pipeline_) gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
    sink_.reset();
    bus_.reset();
    pipeline_.reset();
  }

  Grab grab(Frame& frame, int64_t timeout_ns) override {
    Sample sample;
    for (int64_t left = timeout_ns; !sample && left >= 0; left -= kLookNs) {
      if (const auto why = broken()) throw std::runtime_error(name() + ": " + *why);
      sample.reset(gst_app_sink_try_pull_sample(GST_APP_SINK(sink_.get()),
                                                static_cast<GstClockTime>(std::min(left, kLookNs))));
    }
    if (!sample) return {};
    Grab grab{true, lost_before(sample.get()), ""};
    convert(sample.get(), frame);
    stamp(sample.get(), frame, grab);
    if (first_) set_synchronised();
    if (first_ && matches_clocks()) {
      settled_ns_ = frame.timestamp_ns + kRtpSettlesNs;
      grab.problem = name() + ": RTP: pictures of the first 2.1 s are left out, until their times are known";
    }
    first_ = false;
    grab.settling = frame.timestamp_ns < settled_ns_;
    return grab;
  }

 private:
  std::string description() const {
    std::string caps = channel_ == Channel::kGrey ? "video/x-raw,format=GRAY8" : "video/x-raw,format=BGR";
    if (options_.width > 0) {
      caps += ",width=" + std::to_string(options_.width) + ",height=" + std::to_string(options_.height);
    }
    return pipeline_text_ + " ! videoconvert ! " + caps + " ! appsink name=" + kSink +
           " max-buffers=1 drop=true enable-last-sample=false";
  }

  // The appsink does not tell what it drops: buffers get numbers when they come to it.
  void number_arrivals() {
    arrived_ = taken_ = 0;
    const Pad pad(gst_element_get_static_pad(sink_.get(), "sink"));
    gst_pad_add_probe(
        pad.get(), GST_PAD_PROBE_TYPE_BUFFER,
        [](GstPad*, GstPadProbeInfo* info, gpointer arrived) {
          GstBuffer* buffer = gst_buffer_make_writable(GST_PAD_PROBE_INFO_BUFFER(info));
          GST_BUFFER_OFFSET(buffer) = (*static_cast<uint64_t*>(arrived))++;
          GST_PAD_PROBE_INFO_DATA(info) = buffer;
          return GST_PAD_PROBE_OK;
        },
        &arrived_, nullptr);
  }

  int64_t lost_before(GstSample* sample) {
    const uint64_t number = GST_BUFFER_OFFSET(gst_sample_get_buffer(sample)), expected = taken_;
    taken_ = number + 1;
    return static_cast<int64_t>(number - expected);
  }

  // Else an element of the pipeline may offer a clock of its own: a sound card's drifts against ours.
  void use_monotonic_clock() {
    const Clock clock(GST_CLOCK(g_object_new(GST_TYPE_SYSTEM_CLOCK, "name", "perch_clock", "clock-type",
                                             GST_CLOCK_TYPE_MONOTONIC, nullptr)));
    gst_pipeline_use_clock(GST_PIPELINE(pipeline_.get()), clock.get());
    // It is CLOCK_MONOTONIC as it stands; were it not, this is the difference.
    const int64_t before = camera_now_ns();
    const auto theirs = static_cast<int64_t>(gst_clock_get_time(clock.get()));
    clock_offset_ns_ = (before + camera_now_ns()) / 2 - theirs;
  }

  void play() {
    first_ = true;
    settled_ns_ = std::numeric_limits<int64_t>::min();
    const auto paused = gst_element_set_state(pipeline_.get(), GST_STATE_PAUSED);
    // A live source gives nothing in PAUSED. What is not known to be live is played by its time stamps, until
    // its first picture tells (set_synchronised): a file would be over in a moment.
    g_object_set(sink_.get(), "sync", paused == GST_STATE_CHANGE_NO_PREROLL ? FALSE : TRUE, nullptr);
    if (paused == GST_STATE_CHANGE_FAILURE ||
        gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) {
      throw std::runtime_error("does not start");
    }
  }

  // A live pipeline's pictures are wanted when they are there, not when a viewer with the pipeline's latency
  // (2 s of an RTSP source) would be shown them.
  void set_synchronised() {
    GstQuery* query = gst_query_new_latency();
    gboolean live = FALSE;
    // Asked of what is before the sink: the sink itself would say whether it waits.
    const Pad pad(gst_element_get_static_pad(sink_.get(), "sink"));
    if (gst_pad_peer_query(pad.get(), query)) gst_query_parse_latency(query, &live, nullptr, nullptr);
    gst_query_unref(query);
    if (live) g_object_set(sink_.get(), "sync", FALSE, nullptr);
  }

  // Asked with the first picture: what the pipeline makes as it goes, as rtspsrc does, is there by then.
  bool matches_clocks() const {
    GstIterator* found =
        gst_bin_iterate_all_by_element_factory_name(GST_BIN(pipeline_.get()), "rtpjitterbuffer");
    GValue element = G_VALUE_INIT;
    GstIteratorResult result = GST_ITERATOR_RESYNC;
    while ((result = gst_iterator_next(found, &element)) == GST_ITERATOR_RESYNC) gst_iterator_resync(found);
    if (result == GST_ITERATOR_OK) g_value_unset(&element);
    gst_iterator_free(found);
    return result == GST_ITERATOR_OK;
  }

  // Why no more pictures will come; nothing: they will.
  std::optional<std::string> broken() {
    if (!bus_) return std::nullopt;
    const auto kinds = static_cast<GstMessageType>(GST_MESSAGE_ERROR | GST_MESSAGE_EOS);
    const Message message(gst_bus_pop_filtered(bus_.get(), kinds));  // others are thrown away
    if (!message) return std::nullopt;
    if (GST_MESSAGE_TYPE(message.get()) == GST_MESSAGE_EOS) return "the stream ended";
    GError* error = nullptr;
    gchar* details = nullptr;
    gst_message_parse_error(message.get(), &error, &details);
    const GError_ owned(error);
    std::string text = std::string(GST_OBJECT_NAME(GST_MESSAGE_SRC(message.get()))) + ": " + error->message;
    // The last line of the details is the cause: "Cannot identify device '/dev/video7'" has "No such file".
    if (details) {
      const std::string all = details;
      const auto line = all.find_last_of('\n');
      if (line != std::string::npos) text += " (" + all.substr(line + 1) + ")";
    }
    g_free(details);
    return text;
  }

  void convert(GstSample* sample, Frame& frame) {
    GstBuffer* buffer = gst_sample_get_buffer(sample);
    GstVideoInfo info;
    GstVideoFrame video;
    if (!gst_video_info_from_caps(&info, gst_sample_get_caps(sample)) ||
        !gst_video_frame_map(&video, &info, buffer, GST_MAP_READ)) {
      frame.problem = name() + ": a buffer that is no picture";
      return;
    }
    const bool colour = channel_ != Channel::kGrey;
    const cv::Mat theirs(GST_VIDEO_FRAME_HEIGHT(&video), GST_VIDEO_FRAME_WIDTH(&video),
                         colour ? CV_8UC3 : CV_8UC1, GST_VIDEO_FRAME_PLANE_DATA(&video, 0),
                         static_cast<size_t>(GST_VIDEO_FRAME_PLANE_STRIDE(&video, 0)));
    if (colour) {
      cv::extractChannel(theirs, grey_, bgr_index(channel_));
    } else {
      theirs.copyTo(grey_);
    }
    gst_video_frame_unmap(&video);
    frame.grey = grey_;
  }

  void stamp(GstSample* sample, Frame& frame, Grab& grab) {
    const GstClockTime shown = GST_BUFFER_PTS(gst_sample_get_buffer(sample));
    const GstClockTime running =
        gst_segment_to_running_time(gst_sample_get_segment(sample), GST_FORMAT_TIME, shown);
    if (!GST_CLOCK_TIME_IS_VALID(shown) || !GST_CLOCK_TIME_IS_VALID(running)) {
      frame.timestamp_ns = camera_now_ns();
      grab.problem = name() + ": pictures without a time: that of their arrival here is taken";
      return;
    }
    frame.timestamp_ns =
        static_cast<int64_t>(gst_element_get_base_time(pipeline_.get()) + running) + clock_offset_ns_;
  }

  std::string pipeline_text_;
  LiveOptions options_;
  Channel channel_;
  uint64_t arrived_ = 0;         // at the sink since it was opened; of the pipeline's own thread
  uint64_t taken_ = 0;           // the number that the next picture has if none is lost
  int64_t clock_offset_ns_ = 0;  // CLOCK_MONOTONIC less the pipeline's clock
  bool first_ = true;            // no picture yet since it was opened
  int64_t settled_ns_ = 0;       // stamps from then on are to be relied upon
  cv::Mat grey_;
  Element pipeline_, sink_;
  Bus bus_;
};

}  // namespace

std::unique_ptr<CameraDevice> make_gst_device(const std::string& pipeline, const LiveOptions& options,
                                              Channel channel) {
  return std::make_unique<GstDevice>(pipeline, options, channel);
}

}  // namespace perch
