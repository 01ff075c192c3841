#include "perch/links/mavlink/signing.h"

#include <openssl/crypto.h>
#include <openssl/evp.h>

#include <algorithm>
#include <stdexcept>

namespace perch::mavlink {
namespace {

constexpr uint64_t kTimeMask = (1ULL << 48) - 1;
// A stream not heard before may be this much behind the newest time known, 10 us: 60 s (message_signing.md).
constexpr uint64_t kNewStreamBehind = 6'000'000;
constexpr size_t kLongestFrame = 10 + 255 + 2;

}  // namespace

Signing::Signing(const SigningOptions& options, uint64_t now) : options_(options), time_(now) {}

void Signing::advance(uint64_t now) { time_ = std::max(time_, now & kTimeMask); }

std::array<uint8_t, 6> Signing::hash(std::span<const uint8_t> frame,
                                     std::span<const uint8_t> link_and_time) const {
  std::array<uint8_t, 32 + kLongestFrame + 7> text{};
  if (options_.key.size() + frame.size() + link_and_time.size() > text.size())
    throw std::length_error("a MAVLink frame to sign is too long");
  auto end = std::copy(options_.key.begin(), options_.key.end(), text.begin());
  end = std::copy(frame.begin(), frame.end(), end);
  end = std::copy(link_and_time.begin(), link_and_time.end(), end);
  std::array<uint8_t, EVP_MAX_MD_SIZE> digest{};
  if (!EVP_Digest(text.data(), static_cast<size_t>(end - text.begin()), digest.data(), nullptr, EVP_sha256(),
                  nullptr))
    throw std::runtime_error("libcrypto has no SHA-256");
  std::array<uint8_t, 6> first{};
  std::copy_n(digest.begin(), first.size(), first.begin());
  return first;
}

void Signing::sign(std::span<const uint8_t> frame, std::span<uint8_t, kSignatureSize> signature) {
  signature[0] = options_.link_id;
  for (size_t i = 0; i < 6; ++i) signature[1 + i] = static_cast<uint8_t>(time_ >> (8 * i));
  ++time_;
  const auto first = hash(frame, signature.first<7>());
  std::copy(first.begin(), first.end(), signature.begin() + 7);
}

SignatureVerdict Signing::check(std::span<const uint8_t> frame,
                                std::span<const uint8_t, kSignatureSize> signature, uint8_t system,
                                uint8_t component) {
  const auto first = hash(frame, signature.first<7>());
  if (CRYPTO_memcmp(first.data(), signature.data() + 7, first.size()) != 0) return SignatureVerdict::kBad;

  uint64_t time = 0;
  for (size_t i = 0; i < 6; ++i) time |= static_cast<uint64_t>(signature[1 + i]) << (8 * i);
  const uint32_t stream = (uint32_t{signature[0]} << 16) | (uint32_t{system} << 8) | component;
  const auto known = last_times_.find(stream);
  const bool newer = known != last_times_.end() ? time > known->second : time + kNewStreamBehind >= time_;
  if (!newer) return SignatureVerdict::kReplayed;
  last_times_[stream] = time;
  // Our own time follows the newest, so that a peer with the better clock does not take ours for a replay.
  advance(time);
  return SignatureVerdict::kGood;
}

uint64_t signing_time(int64_t unix_ns) {
  constexpr int64_t k2015_ns = 1'420'070'400LL * 1'000'000'000;
  return unix_ns > k2015_ns ? static_cast<uint64_t>((unix_ns - k2015_ns) / 10'000) : 0;
}

}  // namespace perch::mavlink
