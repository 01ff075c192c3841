#include "perch/target/tag_family.h"

#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

namespace perch {
namespace {

struct Maker {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr Maker kMakers[] = {
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
};

}  // namespace

TagFamily make_tag_family(std::string_view name, int border) {
  for (const Maker& maker : kMakers) {
    if (name != maker.name) continue;
    TagFamily family(maker.create(), maker.destroy);
    // libapriltag looks for the edge of a square width_at_border modules wide and counts its data from that
    // square's corner; its families are made with a border of one.
    const int more = border - 1;
    family->width_at_border += 2 * more;
    family->total_width += 2 * more;
    for (uint32_t i = 0; i < family->nbits; ++i) {
      family->bit_x[i] += static_cast<uint32_t>(more);
      family->bit_y[i] += static_cast<uint32_t>(more);
    }
    return family;
  }
  return TagFamily(nullptr, [](apriltag_family_t*) {});
}

bool has_black_border(const apriltag_family_t& family) { return !family.reversed_border; }

const std::vector<std::string>& tag_family_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const Maker& maker : kMakers) list.push_back(maker.name);
    return list;
  }();
  return names;
}

}  // namespace perch
