#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <span>

namespace perch::mavlink {

inline constexpr size_t kSignatureSize = 13;  // link id, 48 bits of time, 48 bits of hash

struct SigningOptions {
  std::array<uint8_t, 32> key{};
  uint8_t link_id = 0;           // of what we send; each link of ours its own
  bool accept_unsigned = false;  // RADIO_STATUS is always accepted: radios cannot sign
};

enum class SignatureVerdict { kGood, kBad, kReplayed };

// MAVLink 2 signatures (devguide, message_signing.md): the first 6 bytes of SHA-256 over key, frame from its
// magic to its CRC, link id and time. The time counts 10 us since 2015 and rises strictly in each stream
// (system, component, link).
class Signing {
 public:
  // `now` as signing_time() gives it. It should come from a clock that does not fall behind an earlier run's.
  Signing(const SigningOptions& options, uint64_t now);

  // Time goes on: what is signed from here on has at least this time. Going back changes nothing.
  void advance(uint64_t now);

  // Writes the signature of a frame (from its magic to its CRC) with the next time.
  void sign(std::span<const uint8_t> frame, std::span<uint8_t, kSignatureSize> signature);

  // Judges a received frame of a stream and, if it is good, remembers its time.
  SignatureVerdict check(std::span<const uint8_t> frame, std::span<const uint8_t, kSignatureSize> signature,
                         uint8_t system, uint8_t component);

  const SigningOptions& options() const { return options_; }

 private:
  std::array<uint8_t, 6> hash(std::span<const uint8_t> frame, std::span<const uint8_t> link_and_time) const;

  SigningOptions options_;
  uint64_t time_;                            // of the next signature; also what new streams are held against
  std::map<uint32_t, uint64_t> last_times_;  // by link, system, component
};

// Of a wall clock, ns since 1970; 0 before 2015.
uint64_t signing_time(int64_t unix_ns);

}  // namespace perch::mavlink
