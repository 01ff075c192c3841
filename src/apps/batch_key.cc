#include "batch_key.h"

#include <openssl/evp.h>
#include <sys/stat.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <vector>

namespace perch {
namespace {

namespace fs = std::filesystem;

class Sha256 {
 public:
  Sha256() : context_(EVP_MD_CTX_new(), &EVP_MD_CTX_free) {
    if (!context_ || EVP_DigestInit_ex(context_.get(), EVP_sha256(), nullptr) != 1) fail();
  }
  void add(std::string_view bytes) {
    if (EVP_DigestUpdate(context_.get(), bytes.data(), bytes.size()) != 1) fail();
  }
  void add_file(const fs::path& file) {
    std::ifstream stream(file, std::ios::binary);
    std::vector<char> block(1 << 20);
    while (stream.read(block.data(), static_cast<std::streamsize>(block.size())), stream.gcount() > 0) {
      add({block.data(), static_cast<size_t>(stream.gcount())});
    }
  }
  std::string hex() {
    std::array<unsigned char, EVP_MAX_MD_SIZE> bytes;
    unsigned size = 0;
    if (EVP_DigestFinal_ex(context_.get(), bytes.data(), &size) != 1) fail();
    std::string text;
    for (unsigned i = 0; i < size; ++i) {
      text += "0123456789abcdef"[bytes[i] >> 4];
      text += "0123456789abcdef"[bytes[i] & 15];
    }
    return text;
  }

 private:
  [[noreturn]] static void fail() { throw std::runtime_error("SHA-256: libcrypto cannot compute it"); }
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context_;
};

// "name size time", a line a file.
std::string describe(const fs::path& file, const fs::path& flight) {
  struct stat status {};
  const bool there = ::stat(file.c_str(), &status) == 0;
  const int64_t size = there ? status.st_size : -1;  // a link to nowhere
  return file.lexically_relative(flight).string() + ' ' + std::to_string(size) + ' ' +
         std::to_string(status.st_mtim.tv_sec) + '.' + std::to_string(status.st_mtim.tv_nsec) + '\n';
}

}  // namespace

std::string program_digest() {
  Sha256 digest;
  digest.add_file("/proc/self/exe");
  return digest.hex();
}

std::string configuration_digest(const std::string& resolved, std::span<const fs::path> files) {
  Sha256 digest;
  digest.add(resolved);
  for (const fs::path& file : files) {
    digest.add("\n");
    digest.add(file.string());
    digest.add("\n");
    digest.add_file(file);
  }
  return digest.hex();
}

std::string flight_digest(const fs::path& flight) {
  std::vector<std::string> lines = {describe(flight / "run" / "aids.csv", flight)};
  std::error_code error;
  fs::recursive_directory_iterator entry(flight / "mav0", fs::directory_options::follow_directory_symlink,
                                         error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    std::error_code ignored;
    if (!entry->is_directory(ignored)) lines.push_back(describe(entry->path(), flight));
  }
  // A folder lists its files in any order.
  std::sort(lines.begin(), lines.end());
  Sha256 digest;
  for (const std::string& line : lines) digest.add(line);
  return digest.hex();
}

}  // namespace perch
