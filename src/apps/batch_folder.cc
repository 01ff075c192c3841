#include "batch_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>
#include <vector>

namespace perch {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr char kComplete[] = "complete.json", kSummary[] = "summary.json";

[[noreturn]] void fail(const fs::path& path) {
  throw std::runtime_error(path.string() + ": cannot be written: " + std::generic_category().message(errno));
}

std::string host_prefix() {
  std::array<char, 256> name{};
  gethostname(name.data(), name.size() - 1);
  return std::string(name.data()) + '-';
}

Json key_json(const BatchKey& key) {
  return {{"program", key.program}, {"configuration", key.configuration}, {"flight", key.flight}};
}

}  // namespace

BatchFolder::BatchFolder(fs::path folder) : folder_(std::move(folder)), parts_(folder_ / ".part") {
  fs::create_directories(folder_);
  const fs::path lock = folder_ / ".lock";
  lock_ = open(lock.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
  if (lock_ < 0) fail(lock);
  if (flock(lock_, LOCK_EX | LOCK_NB) == 0) remove_leftovers();
  // On a file system without locks leftovers stay, and are in nobody's way.
  while (flock(lock_, LOCK_SH) != 0 && errno == EINTR) continue;
  std::string name;
  // Whoever ends at this moment removes an empty OUT/.part.
  for (int attempt = 0; attempt < 10 && own_.empty(); ++attempt) {
    fs::create_directories(parts_);
    name = (parts_ / (host_prefix() + "XXXXXX")).string();
    if (mkdtemp(name.data())) own_ = name;
  }
  if (own_.empty()) fail(name);
}

BatchFolder::~BatchFolder() {
  std::error_code ignored;
  fs::remove_all(own_, ignored);
  fs::remove(parts_, ignored);  // when it is empty
  close(lock_);
}

void BatchFolder::remove_leftovers() const {
  // A lock may be known on one machine alone: what others write is theirs.
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(parts_, ignored)) {
    if (entry.path().filename().string().starts_with(host_prefix())) fs::remove_all(entry.path(), ignored);
  }
}

bool BatchFolder::is_finished(const std::string& flight, const BatchKey& key) const {
  std::ifstream stream(of(flight) / kComplete);
  const Json complete = Json::parse(stream, nullptr, /*allow_exceptions=*/false);
  if (!complete.is_object() || complete.value("key", Json()) != key_json(key)) return false;
  const Json files = complete.value("files", Json());
  if (!files.is_object() || files.empty()) return false;
  for (const auto& [name, size] : files.items()) {
    std::error_code error;
    const auto found = fs::file_size(of(flight) / name, error);
    if (error || !size.is_number_unsigned() || found != size.get<uintmax_t>()) return false;
  }
  return true;
}

void BatchFolder::share(const std::string& name, std::string_view content) const {
  std::ifstream there(of(name), std::ios::binary);
  const std::string found{std::istreambuf_iterator<char>(there), {}};
  if (found == content) return;
  std::ofstream stream(own_ / name, std::ios::binary);
  stream << content;
  stream.close();
  if (!stream) fail(own_ / name);
  fs::rename(own_ / name, of(name));
}

fs::path BatchFolder::begin(const std::string& flight) const {
  fs::create_directories(own_ / flight);
  return own_ / flight;
}

void BatchFolder::finish(const std::string& flight, const BatchKey& key) const {
  const fs::path from = own_ / flight, to = of(flight);
  Json files = Json::object();
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(from)) names.push_back(entry.path().filename().string());
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) files[name] = fs::file_size(from / name);
  std::ofstream stream(from / kComplete);
  stream << Json{{"key", key_json(key)}, {"files", files}}.dump(2) << '\n';
  stream.close();
  if (!stream) fail(from / kComplete);

  fs::create_directories(to);
  // Files of two runs are no result: who reads a flight asks for its summary.
  fs::remove(to / kComplete);
  fs::remove(to / kSummary);
  std::stable_partition(names.begin(), names.end(), [](const std::string& name) { return name != kSummary; });
  for (const std::string& name : names) fs::rename(from / name, to / name);
  fs::rename(from / kComplete, to / kComplete);
  std::error_code ignored;
  fs::remove(from, ignored);
}

void BatchFolder::forget(const std::string& flight) const {
  std::error_code ignored;
  // Other things may lie there that are not ours.
  for (const char* name : {kComplete, kSummary, "estimates.csv", "states.csv", "errors.csv",
                           "pad_from_body.tum", "report.html"}) {
    fs::remove(of(flight) / name, ignored);
  }
  fs::remove_all(own_ / flight, ignored);
}

}  // namespace perch
