#include "perch/flight/matroska.h"

namespace perch {
namespace {

// Element ids of RFC 9559, section 5; an id has as many bytes as it shows.
enum : uint32_t {
  kEbml = 0x1A45DFA3,
  kEbmlVersion = 0x4286,
  kEbmlReadVersion = 0x42F7,
  kEbmlMaxIdLength = 0x42F2,
  kEbmlMaxSizeLength = 0x42F3,
  kDocType = 0x4282,
  kDocTypeVersion = 0x4287,
  kDocTypeReadVersion = 0x4285,
  kSegment = 0x18538067,
  kInfo = 0x1549A966,
  kTimestampScale = 0x2AD7B1,
  kMuxingApp = 0x4D80,
  kWritingApp = 0x5741,
  kTracks = 0x1654AE6B,
  kTrackEntry = 0xAE,
  kTrackNumber = 0xD7,
  kTrackUid = 0x73C5,
  kTrackType = 0x83,
  kFlagLacing = 0x9C,
  kDefaultDuration = 0x23E383,
  kCodecId = 0x86,
  kCodecPrivate = 0x63A2,
  kVideo = 0xE0,
  kPixelWidth = 0xB0,
  kPixelHeight = 0xBA,
  kCluster = 0x1F43B675,
  kTimestamp = 0xE7,
  kSimpleBlock = 0xA3,
};

void append_bytes(uint64_t value, int bytes, std::string& text) {
  for (int shift = 8 * (bytes - 1); shift >= 0; shift -= 8) text += static_cast<char>(value >> shift & 0xFF);
}

void append_id(uint32_t id, std::string& text) {
  append_bytes(id, id > 0xFFFFFF ? 4 : id > 0xFFFF ? 3 : id > 0xFF ? 2 : 1, text);
}

// A size in 8 bytes: the first bit set of 64 says so.
void append_size(uint64_t size, std::string& text) { append_bytes(size | 1ULL << 56, 8, text); }

std::string element(uint32_t id, std::string_view content) {
  std::string text;
  append_id(id, text);
  append_size(content.size(), text);
  text += content;
  return text;
}

std::string number(uint32_t id, uint64_t value) {
  std::string content;
  append_bytes(value, 8, content);
  return element(id, content);
}

}  // namespace

std::string matroska_header(const MatroskaVideo& video) {
  std::string text =
      element(kEbml, number(kEbmlVersion, 1) + number(kEbmlReadVersion, 1) + number(kEbmlMaxIdLength, 4) +
                         number(kEbmlMaxSizeLength, 8) + element(kDocType, "matroska") +
                         number(kDocTypeVersion, 4) + number(kDocTypeReadVersion, 2));
  append_id(kSegment, text);
  append_bytes(0x01FFFFFFFFFFFFFF, 8, text);  // of unknown size: it grows
  text += element(kInfo, number(kTimestampScale, 1'000'000) + element(kMuxingApp, "perch") +
                             element(kWritingApp, "perch"));
  text += element(
      kTracks,
      element(kTrackEntry,
              number(kTrackNumber, 1) + number(kTrackUid, 1) + number(kTrackType, 1) +
                  number(kFlagLacing, 0) + number(kDefaultDuration, static_cast<uint64_t>(video.frame_ns)) +
                  element(kCodecId, "V_FFV1") + element(kCodecPrivate, video.codec_private) +
                  element(kVideo, number(kPixelWidth, static_cast<uint64_t>(video.width)) +
                                      number(kPixelHeight, static_cast<uint64_t>(video.height)))));
  return text;
}

void append_matroska_cluster(int64_t time_ms, std::string_view frame, std::string& text) {
  const std::string timestamp = number(kTimestamp, static_cast<uint64_t>(time_ms));
  // Track 1, no time beyond the cluster's, a key frame.
  constexpr std::string_view kBlockHeader("\x81\x00\x00\x80", 4);
  const size_t block = kBlockHeader.size() + frame.size();
  append_id(kCluster, text);
  append_size(timestamp.size() + 1 + 8 + block, text);  // the block's id has a byte, its size 8
  text += timestamp;
  append_id(kSimpleBlock, text);
  append_size(block, text);
  text += kBlockHeader;
  text += frame;
}

}  // namespace perch
