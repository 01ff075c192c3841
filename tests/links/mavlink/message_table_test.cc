#include "perch/links/mavlink/message_table.h"

#include <gtest/gtest.h>

#include "links/mavlink/messages.h"
#include "perch/links/mavlink/crc.h"

namespace perch::mavlink {
namespace {

struct Known {
  uint32_t id;
  std::string_view name;
  int crc_extra;
  size_t length;
};

// As npm's mavlink-mappings publishes them, which is generated from MAVLink's XML by other people's code.
constexpr Known kPublished[] = {
    {0, "HEARTBEAT", 50, 9},
    {2, "SYSTEM_TIME", 137, 12},
    {20, "PARAM_REQUEST_READ", 214, 20},
    {21, "PARAM_REQUEST_LIST", 159, 2},
    {22, "PARAM_VALUE", 220, 25},
    {23, "PARAM_SET", 168, 23},
    {24, "GPS_RAW_INT", 24, 52},
    {27, "RAW_IMU", 144, 29},
    {30, "ATTITUDE", 39, 28},
    {31, "ATTITUDE_QUATERNION", 246, 48},
    {32, "LOCAL_POSITION_NED", 185, 28},
    {33, "GLOBAL_POSITION_INT", 104, 28},
    {75, "COMMAND_INT", 158, 35},
    {76, "COMMAND_LONG", 152, 33},
    {77, "COMMAND_ACK", 143, 10},
    {102, "VISION_POSITION_ESTIMATE", 158, 117},
    {105, "HIGHRES_IMU", 93, 63},
    {108, "SIM_STATE", 32, 92},
    {109, "RADIO_STATUS", 185, 9},
    {111, "TIMESYNC", 34, 18},
    {132, "DISTANCE_SENSOR", 85, 39},
    {148, "AUTOPILOT_VERSION", 178, 78},
    {149, "LANDING_TARGET", 200, 60},
    {244, "MESSAGE_INTERVAL", 95, 6},
    {245, "EXTENDED_SYS_STATE", 130, 2},
    {251, "NAMED_VALUE_FLOAT", 170, 18},
    {253, "STATUSTEXT", 83, 54},
    {265, "MOUNT_ORIENTATION", 26, 20},
    {271, "CAMERA_FOV_STATUS", 22, 53},
    {280, "GIMBAL_MANAGER_INFORMATION", 70, 33},
    {281, "GIMBAL_MANAGER_STATUS", 48, 13},
    {283, "GIMBAL_DEVICE_INFORMATION", 74, 145},
    {284, "GIMBAL_DEVICE_SET_ATTITUDE", 99, 32},
    {285, "GIMBAL_DEVICE_ATTITUDE_STATUS", 137, 49},
    {286, "AUTOPILOT_STATE_FOR_GIMBAL_DEVICE", 210, 57},
    {287, "GIMBAL_MANAGER_SET_PITCHYAW", 1, 23},
    {331, "ODOMETRY", 91, 233},
    {350, "DEBUG_FLOAT_ARRAY", 232, 252},
    {510, "TARGET_ABSOLUTE", 245, 106},
    {511, "TARGET_RELATIVE", 28, 71},
};

TEST(MessageTable, HashesOfNamesTypesAndOrderAreThePublishedOnes) {
  ASSERT_EQ(known_messages().size(), std::size(kPublished));
  for (const Known& known : kPublished) {
    const MessageInfo* info = find_message(known.id);
    ASSERT_TRUE(info) << known.name;
    EXPECT_EQ(info->name, known.name);
    EXPECT_EQ(info->crc_extra, known.crc_extra) << known.name;
    EXPECT_EQ(info->length, known.length) << known.name;
  }
}

TEST(MessageTable, LargeFieldsComeFirstAndExtensionsLast) {
  for (const MessageInfo& info : known_messages()) {
    size_t largest = 8, offset = 0;
    bool extensions = false;
    for (const FieldInfo& field : info.fields) {
      EXPECT_EQ(field.wire_offset, offset) << info.name << "." << field.name;
      offset += size_of(field);
      EXPECT_FALSE(extensions && !field.extension) << info.name << "." << field.name;
      extensions = field.extension;
      if (extensions) continue;
      EXPECT_LE(size_of(field.type), largest) << info.name << "." << field.name;
      largest = size_of(field.type);
    }
    EXPECT_LE(info.length, kMaxPayload);
  }
}

TEST(MessageTable, FieldsOfAStructDoNotOverlap) {
  for (const MessageInfo& info : known_messages()) {
    std::vector<int> used(info.struct_size, 0);
    for (const FieldInfo& field : info.fields) {
      for (size_t i = 0; i < size_of(field); ++i) ++used.at(field.struct_offset + i);
    }
    for (const int times : used) EXPECT_LE(times, 1) << info.name;
  }
}

TEST(MessageTable, KnowsNothingOfOtherIds) {
  for (const uint32_t id : {1u, 29u, 512u, 149u + 0x10000u, 0xFFFFFFu})
    EXPECT_EQ(find_message(id), nullptr) << id;
}

TEST(MessageTable, TheCrcIsMcrf4xx) {
  const uint8_t text[] = {'1', '2', '3', '4', '5', '6', '7', '8', '9'};
  EXPECT_EQ(crc_add(kCrcStart, text), 0x6F91);  // the check value of the catalogue of CRCs
}

TEST(MessageTable, EveryMessageSurvivesTheWireWithRandomFields) {
  TestRng rng;
  for (int round = 0; round < 50; ++round) {
    for (const MessageInfo& info : known_messages()) {
      const Bytes message = random_message(rng, info);
      for (const uint8_t version : {uint8_t{2}, uint8_t{1}}) {
        if (version == 1 && info.id > 255) continue;
        Bytes wire;
        append_frame(wire, {version, static_cast<uint8_t>(round), 7, 9}, info, message.data());
        FrameParser parser;
        const auto frames = parsed(parser, wire);
        ASSERT_EQ(frames.size(), 1u) << info.name;
        EXPECT_EQ(frames[0].sequence, round);
        EXPECT_EQ(frames[0].version, version);
        EXPECT_TRUE(same_fields(info, decoded(frames[0]), message, version == 2));
      }
    }
  }
}

}  // namespace
}  // namespace perch::mavlink
