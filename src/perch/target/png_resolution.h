#pragma once

#include <string>

namespace perch {

// A PNG file's bytes with its resolution noted (the pHYs chunk), so that printing programs know its size;
// cairo writes none. `png` is a whole file without such a chunk.
std::string with_resolution(const std::string& png, double dpi);

}  // namespace perch
