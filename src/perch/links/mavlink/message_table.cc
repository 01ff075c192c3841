#include "perch/links/mavlink/message_table.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <type_traits>

#include "perch/links/mavlink/crc.h"
#include "perch/links/mavlink/messages.h"

namespace perch::mavlink {

// Numbers are copied as they lie in memory, and the wire is little-endian.
static_assert(std::endian::native == std::endian::little);

namespace {

constexpr std::array<std::string_view, 10> kTypeNames = {"uint8_t",  "int8_t",   "char",    "uint16_t",
                                                         "int16_t",  "uint32_t", "int32_t", "float",
                                                         "uint64_t", "int64_t"};
constexpr std::array<size_t, 10> kTypeSizes = {1, 1, 1, 2, 2, 4, 4, 4, 8, 8};

constexpr size_t bytes_of(const FieldInfo& field) {
  return kTypeSizes[static_cast<size_t>(field.type)] * (field.array_length ? field.array_length : 1u);
}

template <class T>
constexpr WireType wire_type() {
  if constexpr (std::is_same_v<T, char>) return WireType::kChar;
  if constexpr (std::is_same_v<T, float>) return WireType::kFloat;
  if constexpr (std::is_integral_v<T> && !std::is_same_v<T, char>) {
    constexpr bool sign = std::is_signed_v<T>;
    if constexpr (sizeof(T) == 1) return sign ? WireType::kInt8 : WireType::kUint8;
    if constexpr (sizeof(T) == 2) return sign ? WireType::kInt16 : WireType::kUint16;
    if constexpr (sizeof(T) == 4) return sign ? WireType::kInt32 : WireType::kUint32;
    if constexpr (sizeof(T) == 8) return sign ? WireType::kInt64 : WireType::kUint64;
  }
}

template <class T>
struct Describe {
  static constexpr FieldInfo field(std::string_view name, size_t offset, bool extension) {
    return {name, wire_type<T>(), 0, extension, offset, 0};
  }
};
template <class T, size_t N>
struct Describe<std::array<T, N>> {
  static constexpr FieldInfo field(std::string_view name, size_t offset, bool extension) {
    return {name, wire_type<T>(), static_cast<uint8_t>(N), extension, offset, 0};
  }
};

// Fields follow each other without a gap.
template <size_t N>
constexpr std::array<FieldInfo, N> laid_out(std::array<FieldInfo, N> fields) {
  size_t offset = 0;
  for (FieldInfo& field : fields) {
    field.wire_offset = offset;
    offset += bytes_of(field);
  }
  return fields;
}

constexpr uint16_t add_text(uint16_t crc, std::string_view text) {
  for (const char c : text) crc = crc_add(crc, static_cast<uint8_t>(c));
  return crc;
}

// devguide, serialization.md: over "NAME " and, for each field that is no extension, in wire order, "type
// name " and the length of an array.
constexpr uint8_t crc_extra_of(std::string_view name, std::span<const FieldInfo> fields) {
  uint16_t crc = add_text(add_text(kCrcStart, name), " ");
  for (const FieldInfo& field : fields) {
    if (field.extension) break;
    crc = add_text(add_text(crc, kTypeNames[static_cast<size_t>(field.type)]), " ");
    crc = add_text(add_text(crc, field.name), " ");
    if (field.array_length) crc = crc_add(crc, field.array_length);
  }
  return static_cast<uint8_t>((crc & 0xFF) ^ (crc >> 8));
}

template <class Message>
constexpr MessageInfo describe_message(std::string_view name, std::span<const FieldInfo> fields) {
  static_assert(std::is_standard_layout_v<Message> && std::is_trivially_copyable_v<Message>);
  MessageInfo info{Message::kId, name, fields, sizeof(Message), 0, 0, crc_extra_of(name, fields)};
  for (const FieldInfo& field : fields) {
    info.length += bytes_of(field);
    if (!field.extension) info.min_length += bytes_of(field);
  }
  return info;
}

// The table. A field's type, length and place in the struct are taken from the struct itself, its place on
// the wire from the order here; tests hold the hash of it all against the published CRC_EXTRA.
#define FIELD(member) Describe<decltype(Message::member)>::field(#member, offsetof(Message, member), false)
#define EXTENSION(member) Describe<decltype(Message::member)>::field(#member, offsetof(Message, member), true)
#define FIELDS_OF(Type, ...)                  \
  constexpr auto k##Type##Fields = [] {       \
    using Message = Type;                     \
    return laid_out(std::array{__VA_ARGS__}); \
  }()

FIELDS_OF(Heartbeat, FIELD(custom_mode), FIELD(type), FIELD(autopilot), FIELD(base_mode),
          FIELD(system_status), FIELD(mavlink_version));
FIELDS_OF(SystemTime, FIELD(time_unix_usec), FIELD(time_boot_ms));
FIELDS_OF(ParamRequestRead, FIELD(param_index), FIELD(target_system), FIELD(target_component),
          FIELD(param_id));
FIELDS_OF(ParamRequestList, FIELD(target_system), FIELD(target_component));
FIELDS_OF(ParamValue, FIELD(param_value), FIELD(param_count), FIELD(param_index), FIELD(param_id),
          FIELD(param_type));
FIELDS_OF(ParamSet, FIELD(param_value), FIELD(target_system), FIELD(target_component), FIELD(param_id),
          FIELD(param_type));
FIELDS_OF(CommandInt, FIELD(param1), FIELD(param2), FIELD(param3), FIELD(param4), FIELD(x), FIELD(y),
          FIELD(z), FIELD(command), FIELD(target_system), FIELD(target_component), FIELD(frame),
          FIELD(current), FIELD(autocontinue));
FIELDS_OF(CommandLong, FIELD(param1), FIELD(param2), FIELD(param3), FIELD(param4), FIELD(param5),
          FIELD(param6), FIELD(param7), FIELD(command), FIELD(target_system), FIELD(target_component),
          FIELD(confirmation));
FIELDS_OF(CommandAck, FIELD(command), FIELD(result), EXTENSION(progress), EXTENSION(result_param2),
          EXTENSION(target_system), EXTENSION(target_component));
FIELDS_OF(RadioStatus, FIELD(rxerrors), FIELD(fixed), FIELD(rssi), FIELD(remrssi), FIELD(txbuf), FIELD(noise),
          FIELD(remnoise));
FIELDS_OF(Timesync, FIELD(tc1), FIELD(ts1), EXTENSION(target_system), EXTENSION(target_component));
FIELDS_OF(AutopilotVersion, FIELD(capabilities), FIELD(uid), FIELD(flight_sw_version),
          FIELD(middleware_sw_version), FIELD(os_sw_version), FIELD(board_version), FIELD(vendor_id),
          FIELD(product_id), FIELD(flight_custom_version), FIELD(middleware_custom_version),
          FIELD(os_custom_version), EXTENSION(uid2));
FIELDS_OF(MessageInterval, FIELD(interval_us), FIELD(message_id));
FIELDS_OF(ExtendedSysState, FIELD(vtol_state), FIELD(landed_state));
FIELDS_OF(NamedValueFloat, FIELD(time_boot_ms), FIELD(value), FIELD(name));
FIELDS_OF(Statustext, FIELD(severity), FIELD(text), EXTENSION(id), EXTENSION(chunk_seq));
FIELDS_OF(DebugFloatArray, FIELD(time_usec), FIELD(array_id), FIELD(name), EXTENSION(data));
FIELDS_OF(GpsRawInt, FIELD(time_usec), FIELD(lat), FIELD(lon), FIELD(alt), FIELD(eph), FIELD(epv), FIELD(vel),
          FIELD(cog), FIELD(fix_type), FIELD(satellites_visible), EXTENSION(alt_ellipsoid), EXTENSION(h_acc),
          EXTENSION(v_acc), EXTENSION(vel_acc), EXTENSION(hdg_acc), EXTENSION(yaw));
FIELDS_OF(RawImu, FIELD(time_usec), FIELD(xacc), FIELD(yacc), FIELD(zacc), FIELD(xgyro), FIELD(ygyro),
          FIELD(zgyro), FIELD(xmag), FIELD(ymag), FIELD(zmag), EXTENSION(id), EXTENSION(temperature));
FIELDS_OF(Attitude, FIELD(time_boot_ms), FIELD(roll), FIELD(pitch), FIELD(yaw), FIELD(rollspeed),
          FIELD(pitchspeed), FIELD(yawspeed));
FIELDS_OF(AttitudeQuaternion, FIELD(time_boot_ms), FIELD(q1), FIELD(q2), FIELD(q3), FIELD(q4),
          FIELD(rollspeed), FIELD(pitchspeed), FIELD(yawspeed), EXTENSION(repr_offset_q));
FIELDS_OF(LocalPositionNed, FIELD(time_boot_ms), FIELD(x), FIELD(y), FIELD(z), FIELD(vx), FIELD(vy),
          FIELD(vz));
FIELDS_OF(GlobalPositionInt, FIELD(time_boot_ms), FIELD(lat), FIELD(lon), FIELD(alt), FIELD(relative_alt),
          FIELD(vx), FIELD(vy), FIELD(vz), FIELD(hdg));
FIELDS_OF(VisionPositionEstimate, FIELD(usec), FIELD(x), FIELD(y), FIELD(z), FIELD(roll), FIELD(pitch),
          FIELD(yaw), EXTENSION(covariance), EXTENSION(reset_counter));
FIELDS_OF(HighresImu, FIELD(time_usec), FIELD(xacc), FIELD(yacc), FIELD(zacc), FIELD(xgyro), FIELD(ygyro),
          FIELD(zgyro), FIELD(xmag), FIELD(ymag), FIELD(zmag), FIELD(abs_pressure), FIELD(diff_pressure),
          FIELD(pressure_alt), FIELD(temperature), FIELD(fields_updated), EXTENSION(id));
FIELDS_OF(SimState, FIELD(q1), FIELD(q2), FIELD(q3), FIELD(q4), FIELD(roll), FIELD(pitch), FIELD(yaw),
          FIELD(xacc), FIELD(yacc), FIELD(zacc), FIELD(xgyro), FIELD(ygyro), FIELD(zgyro), FIELD(lat),
          FIELD(lon), FIELD(alt), FIELD(std_dev_horz), FIELD(std_dev_vert), FIELD(vn), FIELD(ve), FIELD(vd),
          EXTENSION(lat_int), EXTENSION(lon_int));
FIELDS_OF(DistanceSensor, FIELD(time_boot_ms), FIELD(min_distance), FIELD(max_distance),
          FIELD(current_distance), FIELD(type), FIELD(id), FIELD(orientation), FIELD(covariance),
          EXTENSION(horizontal_fov), EXTENSION(vertical_fov), EXTENSION(quaternion),
          EXTENSION(signal_quality));
FIELDS_OF(Odometry, FIELD(time_usec), FIELD(x), FIELD(y), FIELD(z), FIELD(q), FIELD(vx), FIELD(vy), FIELD(vz),
          FIELD(rollspeed), FIELD(pitchspeed), FIELD(yawspeed), FIELD(pose_covariance),
          FIELD(velocity_covariance), FIELD(frame_id), FIELD(child_frame_id), EXTENSION(reset_counter),
          EXTENSION(estimator_type), EXTENSION(quality));
FIELDS_OF(MountOrientation, FIELD(time_boot_ms), FIELD(roll), FIELD(pitch), FIELD(yaw),
          EXTENSION(yaw_absolute));
FIELDS_OF(CameraFovStatus, FIELD(time_boot_ms), FIELD(lat_camera), FIELD(lon_camera), FIELD(alt_camera),
          FIELD(lat_image), FIELD(lon_image), FIELD(alt_image), FIELD(q), FIELD(hfov), FIELD(vfov),
          EXTENSION(camera_device_id));
FIELDS_OF(GimbalManagerInformation, FIELD(time_boot_ms), FIELD(cap_flags), FIELD(roll_min), FIELD(roll_max),
          FIELD(pitch_min), FIELD(pitch_max), FIELD(yaw_min), FIELD(yaw_max), FIELD(gimbal_device_id));
FIELDS_OF(GimbalManagerStatus, FIELD(time_boot_ms), FIELD(flags), FIELD(gimbal_device_id),
          FIELD(primary_control_sysid), FIELD(primary_control_compid), FIELD(secondary_control_sysid),
          FIELD(secondary_control_compid));
FIELDS_OF(GimbalDeviceInformation, FIELD(uid), FIELD(time_boot_ms), FIELD(firmware_version),
          FIELD(hardware_version), FIELD(roll_min), FIELD(roll_max), FIELD(pitch_min), FIELD(pitch_max),
          FIELD(yaw_min), FIELD(yaw_max), FIELD(cap_flags), FIELD(custom_cap_flags), FIELD(vendor_name),
          FIELD(model_name), FIELD(custom_name), EXTENSION(gimbal_device_id));
FIELDS_OF(GimbalDeviceSetAttitude, FIELD(q), FIELD(angular_velocity_x), FIELD(angular_velocity_y),
          FIELD(angular_velocity_z), FIELD(flags), FIELD(target_system), FIELD(target_component));
FIELDS_OF(GimbalDeviceAttitudeStatus, FIELD(time_boot_ms), FIELD(q), FIELD(angular_velocity_x),
          FIELD(angular_velocity_y), FIELD(angular_velocity_z), FIELD(failure_flags), FIELD(flags),
          FIELD(target_system), FIELD(target_component), EXTENSION(delta_yaw), EXTENSION(delta_yaw_velocity),
          EXTENSION(gimbal_device_id));
FIELDS_OF(AutopilotStateForGimbalDevice, FIELD(time_boot_us), FIELD(q), FIELD(q_estimated_delay_us),
          FIELD(vx), FIELD(vy), FIELD(vz), FIELD(v_estimated_delay_us),
          FIELD(feed_forward_angular_velocity_z), FIELD(estimator_status), FIELD(target_system),
          FIELD(target_component), FIELD(landed_state), EXTENSION(angular_velocity_z));
FIELDS_OF(GimbalManagerSetPitchyaw, FIELD(flags), FIELD(pitch), FIELD(yaw), FIELD(pitch_rate),
          FIELD(yaw_rate), FIELD(target_system), FIELD(target_component), FIELD(gimbal_device_id));
FIELDS_OF(LandingTarget, FIELD(time_usec), FIELD(angle_x), FIELD(angle_y), FIELD(distance), FIELD(size_x),
          FIELD(size_y), FIELD(target_num), FIELD(frame), EXTENSION(x), EXTENSION(y), EXTENSION(z),
          EXTENSION(q), EXTENSION(type), EXTENSION(position_valid));
FIELDS_OF(TargetAbsolute, FIELD(timestamp), FIELD(lat), FIELD(lon), FIELD(alt), FIELD(vel), FIELD(acc),
          FIELD(q_target), FIELD(rates), FIELD(position_std), FIELD(vel_std), FIELD(acc_std), FIELD(id),
          FIELD(sensor_capabilities));
FIELDS_OF(TargetRelative, FIELD(timestamp), FIELD(x), FIELD(y), FIELD(z), FIELD(pos_std), FIELD(yaw_std),
          FIELD(q_target), FIELD(q_sensor), FIELD(id), FIELD(frame), FIELD(type));

#undef FIELDS_OF
#undef EXTENSION
#undef FIELD

constexpr std::array kMessages = {
    describe_message<Heartbeat>("HEARTBEAT", kHeartbeatFields),
    describe_message<SystemTime>("SYSTEM_TIME", kSystemTimeFields),
    describe_message<ParamRequestRead>("PARAM_REQUEST_READ", kParamRequestReadFields),
    describe_message<ParamRequestList>("PARAM_REQUEST_LIST", kParamRequestListFields),
    describe_message<ParamValue>("PARAM_VALUE", kParamValueFields),
    describe_message<ParamSet>("PARAM_SET", kParamSetFields),
    describe_message<GpsRawInt>("GPS_RAW_INT", kGpsRawIntFields),
    describe_message<RawImu>("RAW_IMU", kRawImuFields),
    describe_message<Attitude>("ATTITUDE", kAttitudeFields),
    describe_message<AttitudeQuaternion>("ATTITUDE_QUATERNION", kAttitudeQuaternionFields),
    describe_message<LocalPositionNed>("LOCAL_POSITION_NED", kLocalPositionNedFields),
    describe_message<GlobalPositionInt>("GLOBAL_POSITION_INT", kGlobalPositionIntFields),
    describe_message<CommandInt>("COMMAND_INT", kCommandIntFields),
    describe_message<CommandLong>("COMMAND_LONG", kCommandLongFields),
    describe_message<CommandAck>("COMMAND_ACK", kCommandAckFields),
    describe_message<VisionPositionEstimate>("VISION_POSITION_ESTIMATE", kVisionPositionEstimateFields),
    describe_message<HighresImu>("HIGHRES_IMU", kHighresImuFields),
    describe_message<SimState>("SIM_STATE", kSimStateFields),
    describe_message<RadioStatus>("RADIO_STATUS", kRadioStatusFields),
    describe_message<Timesync>("TIMESYNC", kTimesyncFields),
    describe_message<DistanceSensor>("DISTANCE_SENSOR", kDistanceSensorFields),
    describe_message<AutopilotVersion>("AUTOPILOT_VERSION", kAutopilotVersionFields),
    describe_message<LandingTarget>("LANDING_TARGET", kLandingTargetFields),
    describe_message<MessageInterval>("MESSAGE_INTERVAL", kMessageIntervalFields),
    describe_message<ExtendedSysState>("EXTENDED_SYS_STATE", kExtendedSysStateFields),
    describe_message<NamedValueFloat>("NAMED_VALUE_FLOAT", kNamedValueFloatFields),
    describe_message<Statustext>("STATUSTEXT", kStatustextFields),
    describe_message<MountOrientation>("MOUNT_ORIENTATION", kMountOrientationFields),
    describe_message<CameraFovStatus>("CAMERA_FOV_STATUS", kCameraFovStatusFields),
    describe_message<GimbalManagerInformation>("GIMBAL_MANAGER_INFORMATION", kGimbalManagerInformationFields),
    describe_message<GimbalManagerStatus>("GIMBAL_MANAGER_STATUS", kGimbalManagerStatusFields),
    describe_message<GimbalDeviceInformation>("GIMBAL_DEVICE_INFORMATION", kGimbalDeviceInformationFields),
    describe_message<GimbalDeviceSetAttitude>("GIMBAL_DEVICE_SET_ATTITUDE", kGimbalDeviceSetAttitudeFields),
    describe_message<GimbalDeviceAttitudeStatus>("GIMBAL_DEVICE_ATTITUDE_STATUS",
                                                 kGimbalDeviceAttitudeStatusFields),
    describe_message<AutopilotStateForGimbalDevice>("AUTOPILOT_STATE_FOR_GIMBAL_DEVICE",
                                                    kAutopilotStateForGimbalDeviceFields),
    describe_message<GimbalManagerSetPitchyaw>("GIMBAL_MANAGER_SET_PITCHYAW",
                                               kGimbalManagerSetPitchyawFields),
    describe_message<Odometry>("ODOMETRY", kOdometryFields),
    describe_message<DebugFloatArray>("DEBUG_FLOAT_ARRAY", kDebugFloatArrayFields),
    describe_message<TargetAbsolute>("TARGET_ABSOLUTE", kTargetAbsoluteFields),
    describe_message<TargetRelative>("TARGET_RELATIVE", kTargetRelativeFields),
};

static_assert(std::is_sorted(kMessages.begin(), kMessages.end(),
                             [](const MessageInfo& a, const MessageInfo& b) { return a.id < b.id; }));

}  // namespace

size_t size_of(WireType type) { return kTypeSizes[static_cast<size_t>(type)]; }

std::string_view name_of(WireType type) { return kTypeNames[static_cast<size_t>(type)]; }

size_t size_of(const FieldInfo& field) { return bytes_of(field); }

std::span<const MessageInfo> known_messages() { return kMessages; }

const MessageInfo* find_message(uint32_t id) {
  const auto found =
      std::lower_bound(kMessages.begin(), kMessages.end(), id,
                       [](const MessageInfo& info, uint32_t wanted) { return info.id < wanted; });
  return found != kMessages.end() && found->id == id ? &*found : nullptr;
}

void read_payload(const MessageInfo& info, std::span<const uint8_t> payload, void* message) {
  std::array<uint8_t, kMaxPayload> whole{};
  std::copy_n(payload.begin(), std::min(payload.size(), whole.size()), whole.begin());
  auto* to = static_cast<uint8_t*>(message);
  for (const FieldInfo& field : info.fields)
    std::memcpy(to + field.struct_offset, whole.data() + field.wire_offset, bytes_of(field));
}

void write_payload(const MessageInfo& info, const void* message, std::span<uint8_t, kMaxPayload> payload) {
  const auto* from = static_cast<const uint8_t*>(message);
  for (const FieldInfo& field : info.fields)
    std::memcpy(payload.data() + field.wire_offset, from + field.struct_offset, bytes_of(field));
}

}  // namespace perch::mavlink
