#include <algorithm>
#include <bit>
#include <fstream>
#include <new>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "perch/camera/image_source.h"
#include "perch/camera/picture_file.h"
#include "perch/camera/to_grey.h"

namespace perch {

namespace fs = std::filesystem;

namespace {

// 16 bits are cut to 8 by a shift, and the shift is that of the bits the picture uses, 10, 12, 14 or 16:
// cameras of 10 and 12 bits store them in the lower end, where a shift by 8 leaves black. A picture of 16
// bits so dark that it is taken for one of 12 comes out brighter, which detection does not mind.
cv::Mat eight_bits(const cv::Mat& grey16) {
  double brightest = 0;
  cv::minMaxIdx(grey16, nullptr, &brightest);
  const int used = std::bit_width(static_cast<unsigned>(brightest));
  const int shift = std::max(0, (used + 1) / 2 * 2 - 8);
  cv::Mat grey(grey16.size(), CV_8UC1);
  for (int y = 0; y < grey.rows; ++y) {
    const auto* from = grey16.ptr<uint16_t>(y);
    auto* to = grey.ptr<uint8_t>(y);
    for (int x = 0; x < grey.cols; ++x) to[x] = static_cast<uint8_t>(from[x] >> shift);
  }
  return grey;
}

}  // namespace

cv::Mat to_grey(const cv::Mat& picture, Channel channel) {
  cv::Mat grey;
  if (picture.channels() <= 2) {  // grey, perhaps with an alpha
    if (picture.channels() == 1) {
      grey = picture;
    } else {
      cv::extractChannel(picture, grey, 0);
    }
  } else if (channel == Channel::kGrey) {
    cv::cvtColor(picture, grey, picture.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  } else {
    cv::extractChannel(picture, grey, bgr_index(channel));
  }
  if (grey.depth() == CV_16U) return eight_bits(grey);
  return grey.isContinuous() ? grey : grey.clone();
}

void read_picture(const fs::path& file, Channel channel, Frame& frame) {
  frame.grey.release();  // never written into: whoever has the last frame may keep it
  frame.problem.clear();
  const auto fail = [&](const std::string& why) { frame.problem = file.string() + ": " + why; };
  std::error_code ignored;
  std::ifstream stream(file, std::ios::binary);
  if (!fs::exists(file, ignored)) return fail("no such file");
  if (!stream || !fs::is_regular_file(file, ignored)) return fail("cannot be read");
  try {
    std::vector<uint8_t> bytes(fs::file_size(file));
    stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    bytes.resize(static_cast<size_t>(stream.gcount()));
    if (const std::string problem = picture_file_problem(bytes); !problem.empty()) return fail(problem);
    const cv::Mat picture = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
    if (picture.empty()) return fail("no picture that can be decoded");
    if (picture.depth() != CV_8U && picture.depth() != CV_16U) return fail("neither 8 nor 16 bits");
    frame.grey = to_grey(picture, channel);
  } catch (const cv::Exception& e) {
    fail("no picture that can be decoded (" + e.err + ")");
  } catch (const std::bad_alloc&) {
    fail("too large for the memory");
  } catch (const fs::filesystem_error& e) {
    fail(e.code().message());
  }
}

}  // namespace perch
