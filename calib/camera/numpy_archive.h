#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace perch {

// A NumPy .npz in memory: a ZIP file, not compressed, of one .npy (version 1.0) an array.
class NumpyArchive {
 public:
  using Shape = std::vector<size_t>;
  void add(const std::string& name, const Shape& shape, const std::vector<double>& values);
  void add(const std::string& name, const Shape& shape, const std::vector<int32_t>& values);
  void add(const std::string& name, double value) { add(name, {}, std::vector<double>{value}); }
  void add_bool(const std::string& name, bool value);
  // Of ASCII; all as long as the longest.
  void add(const std::string& name, const Shape& shape, const std::vector<std::string>& values);
  // Ends the archive.
  std::string finish();

 private:
  void add_array(const std::string& name, const std::string& type, const Shape& shape,
                 const std::string& data);
  std::string bytes_, directory_;
  uint16_t count_ = 0;
};

// Python's base64.b85encode.
std::string base85(const std::string& bytes);

}  // namespace perch
