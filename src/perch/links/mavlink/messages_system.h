#pragma once

#include <array>
#include <cstdint>

namespace perch::mavlink {

// What every link needs: who is there, parameters, commands, clocks, texts.
// Fields in wire order, names as in MAVLink's XML, units beside them; an empty line parts the extensions.

struct Heartbeat {  // HEARTBEAT
  static constexpr uint32_t kId = 0;
  uint32_t custom_mode = 0;
  uint8_t type = 0;
  uint8_t autopilot = 0;
  uint8_t base_mode = 0;
  uint8_t system_status = 0;
  uint8_t mavlink_version = 0;
};

struct SystemTime {  // SYSTEM_TIME
  static constexpr uint32_t kId = 2;
  uint64_t time_unix_usec = 0;  // us
  uint32_t time_boot_ms = 0;    // ms
};

struct ParamRequestRead {  // PARAM_REQUEST_READ
  static constexpr uint32_t kId = 20;
  int16_t param_index = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  std::array<char, 16> param_id{};
};

struct ParamRequestList {  // PARAM_REQUEST_LIST
  static constexpr uint32_t kId = 21;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
};

struct ParamValue {  // PARAM_VALUE
  static constexpr uint32_t kId = 22;
  float param_value = 0;
  uint16_t param_count = 0;
  uint16_t param_index = 0;
  std::array<char, 16> param_id{};
  uint8_t param_type = 0;
};

struct ParamSet {  // PARAM_SET
  static constexpr uint32_t kId = 23;
  float param_value = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  std::array<char, 16> param_id{};
  uint8_t param_type = 0;
};

struct CommandInt {  // COMMAND_INT
  static constexpr uint32_t kId = 75;
  float param1 = 0;
  float param2 = 0;
  float param3 = 0;
  float param4 = 0;
  int32_t x = 0;
  int32_t y = 0;
  float z = 0;
  uint16_t command = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  uint8_t frame = 0;
  uint8_t current = 0;
  uint8_t autocontinue = 0;
};

struct CommandLong {  // COMMAND_LONG
  static constexpr uint32_t kId = 76;
  float param1 = 0;
  float param2 = 0;
  float param3 = 0;
  float param4 = 0;
  float param5 = 0;
  float param6 = 0;
  float param7 = 0;
  uint16_t command = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
  uint8_t confirmation = 0;
};

struct CommandAck {  // COMMAND_ACK
  static constexpr uint32_t kId = 77;
  uint16_t command = 0;
  uint8_t result = 0;

  uint8_t progress = 0;  // %
  int32_t result_param2 = 0;
  uint8_t target_system = 0;
  uint8_t target_component = 0;
};

struct RadioStatus {  // RADIO_STATUS
  static constexpr uint32_t kId = 109;
  uint16_t rxerrors = 0;
  uint16_t fixed = 0;
  uint8_t rssi = 0;
  uint8_t remrssi = 0;
  uint8_t txbuf = 0;  // %
  uint8_t noise = 0;
  uint8_t remnoise = 0;
};

struct Timesync {  // TIMESYNC
  static constexpr uint32_t kId = 111;
  int64_t tc1 = 0;  // ns
  int64_t ts1 = 0;  // ns

  uint8_t target_system = 0;
  uint8_t target_component = 0;
};

struct AutopilotVersion {  // AUTOPILOT_VERSION
  static constexpr uint32_t kId = 148;
  uint64_t capabilities = 0;
  uint64_t uid = 0;
  uint32_t flight_sw_version = 0;
  uint32_t middleware_sw_version = 0;
  uint32_t os_sw_version = 0;
  uint32_t board_version = 0;
  uint16_t vendor_id = 0;
  uint16_t product_id = 0;
  std::array<uint8_t, 8> flight_custom_version{};
  std::array<uint8_t, 8> middleware_custom_version{};
  std::array<uint8_t, 8> os_custom_version{};

  std::array<uint8_t, 18> uid2{};
};

struct MessageInterval {  // MESSAGE_INTERVAL
  static constexpr uint32_t kId = 244;
  int32_t interval_us = 0;  // us
  uint16_t message_id = 0;
};

struct ExtendedSysState {  // EXTENDED_SYS_STATE
  static constexpr uint32_t kId = 245;
  uint8_t vtol_state = 0;
  uint8_t landed_state = 0;
};

struct NamedValueFloat {  // NAMED_VALUE_FLOAT
  static constexpr uint32_t kId = 251;
  uint32_t time_boot_ms = 0;  // ms
  float value = 0;
  std::array<char, 10> name{};
};

struct Statustext {  // STATUSTEXT
  static constexpr uint32_t kId = 253;
  uint8_t severity = 0;
  std::array<char, 50> text{};

  uint16_t id = 0;
  uint8_t chunk_seq = 0;
};

struct DebugFloatArray {  // DEBUG_FLOAT_ARRAY
  static constexpr uint32_t kId = 350;
  uint64_t time_usec = 0;  // us
  uint16_t array_id = 0;
  std::array<char, 10> name{};

  std::array<float, 58> data{};
};

}  // namespace perch::mavlink
