#pragma once

#include <string>

#include "perch/flight/nav_track.h"

namespace perch {

// nav0/data.csv of docs/FORMATS.md: the header and a row, with their line ends. Numbers are the shortest that
// read back as the same; an attitude that is not known is empty.
std::string nav_header();
void append_nav(const NavSample& nav, std::string& csv);

}  // namespace perch
