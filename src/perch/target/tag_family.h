#pragma once

#include <apriltag/apriltag.h>

#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace perch {

// A family of libapriltag, destroyed by its own function. It belongs to one detector at a time, which keeps
// its decoding tables in it, and must outlive it.
using TagFamily = std::unique_ptr<apriltag_family_t, void (*)(apriltag_family_t*)>;

// The family of that name (tag36h11, tagStandard41h12, ...) with a border of `border` modules; empty where
// libapriltag has none. Borders other than 1 are for the families with a black border: the data stay as they
// are, one module further in for each module more.
TagFamily make_tag_family(std::string_view name, int border = 1);

// Whether the family has the black border around all its data (tag36h11), rather than a white one with data
// on both sides of it (tagStandard41h12).
bool has_black_border(const apriltag_family_t& family);

const std::vector<std::string>& tag_family_names();

}  // namespace perch
