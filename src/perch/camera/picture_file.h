#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace perch {

// What is wrong with the bytes of a PNG, JPEG or binary PGM/PPM, "" if nothing is. The decoders only warn and
// return half a picture, or a grey one, where a file is cut: so its structure is walked to its end before.
// A picture that claims more than 50 million pixels is refused unread. Other formats are for the decoder.
std::string picture_file_problem(std::span<const uint8_t> bytes);

}  // namespace perch
