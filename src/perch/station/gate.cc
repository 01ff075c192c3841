#include "perch/station/gate.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <openssl/sha.h>

#include <array>
#include <boost/asio/ip/address.hpp>
#include <stdexcept>
#include <utility>

namespace perch {
namespace {

constexpr int64_t kSecond = 1'000'000'000;

std::array<unsigned char, SHA256_DIGEST_LENGTH> digest(std::string_view text) {
  std::array<unsigned char, SHA256_DIGEST_LENGTH> result{};
  SHA256(reinterpret_cast<const unsigned char*>(text.data()), text.size(), result.data());
  return result;
}

std::string_view without_port(std::string_view host) {
  if (host.starts_with('[')) {
    const size_t end = host.find(']');
    return end == std::string_view::npos ? std::string_view() : host.substr(1, end - 1);
  }
  return host.substr(0, host.find(':'));
}

}  // namespace

bool equal_in_constant_time(std::string_view a, std::string_view b) {
  // Digests are of one length, so that not even the token's own is told.
  const auto left = digest(a), right = digest(b);
  return CRYPTO_memcmp(left.data(), right.data(), left.size()) == 0;
}

std::string random_secret() {
  std::array<unsigned char, 16> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1)
    throw std::runtime_error("the station: no random numbers for a session");
  std::string text;
  for (const unsigned char byte : bytes) {
    text += "0123456789abcdef"[byte >> 4];
    text += "0123456789abcdef"[byte & 15];
  }
  return text;
}

Gate::Gate(std::string token) : token_(std::move(token)) {}

bool Gate::trusts_host(std::string_view host) const {
  if (needs_token()) return !host.empty();
  const std::string name(without_port(host));
  boost::system::error_code error;
  boost::asio::ip::make_address(name, error);
  const size_t dot = name.find('.');
  const bool local = dot != std::string::npos && dot > 0 && name.substr(dot) == ".local";
  return !error || name == "localhost" || local;
}

bool Gate::same_origin(std::string_view origin, std::string_view host) {
  for (const std::string_view scheme : {"http://", "https://"}) {
    if (origin.starts_with(scheme)) return !host.empty() && origin.substr(scheme.size()) == host;
  }
  return false;
}

bool Gate::admits(std::string_view cookies, int64_t now_ns) const {
  if (!needs_token()) return true;
  bool admitted = false;
  // "a=1; perch_session=..."
  for (size_t begin = 0; begin < cookies.size();) {
    const size_t end = std::min(cookies.find(';', begin), cookies.size());
    std::string_view cookie = cookies.substr(begin, end - begin);
    begin = end + 1;
    cookie.remove_prefix(std::min(cookie.find_first_not_of(' '), cookie.size()));
    const std::string name = std::string(kCookie) + "=";
    if (!cookie.starts_with(name)) continue;
    const std::string_view secret = cookie.substr(name.size());
    for (const Session& session : sessions_) {
      const bool same = equal_in_constant_time(secret, session.secret);
      admitted = admitted || (same && now_ns < session.until_ns);
    }
  }
  return admitted;
}

Gate::LogInResult Gate::log_in(std::string_view token, int64_t now_ns) {
  while (!wrong_ns_.empty() && now_ns - wrong_ns_.front() > 60 * kSecond) wrong_ns_.pop_front();
  if (wrong_ns_.size() >= kMostAttempts) return {LogIn::kTooOften, {}};
  if (!needs_token() || !equal_in_constant_time(token, token_)) {
    wrong_ns_.push_back(now_ns);
    return {LogIn::kWrong, {}};
  }
  if (sessions_.size() >= kMostSessions) sessions_.pop_front();
  sessions_.push_back({random_secret(), now_ns + kSessionSeconds * kSecond});
  return {LogIn::kWelcome, sessions_.back().secret};
}

}  // namespace perch
