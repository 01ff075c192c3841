#include "perch/detection/apriltag_family.h"

#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <stdexcept>

namespace perch {
namespace {

struct KnownFamily {
  const char* name;
  apriltag_family_t* (*create)();
  void (*destroy)(apriltag_family_t*);
};

constexpr KnownFamily kFamilies[] = {
    {"tag16h5", tag16h5_create, tag16h5_destroy},
    {"tag25h9", tag25h9_create, tag25h9_destroy},
    {"tag36h10", tag36h10_create, tag36h10_destroy},
    {"tag36h11", tag36h11_create, tag36h11_destroy},
    {"tagCircle21h7", tagCircle21h7_create, tagCircle21h7_destroy},
    {"tagCircle49h12", tagCircle49h12_create, tagCircle49h12_destroy},
    {"tagCustom48h12", tagCustom48h12_create, tagCustom48h12_destroy},
    {"tagStandard41h12", tagStandard41h12_create, tagStandard41h12_destroy},
    {"tagStandard52h13", tagStandard52h13_create, tagStandard52h13_destroy},
};

// Each create() returns tables of its own, so they can be changed in place.
void widen_border(apriltag_family_t& family, int border) {
  const int wider = border - 1;
  family.width_at_border += 2 * wider;
  family.total_width += 2 * wider;
  // Bits are counted from the border's outer corner.
  for (uint32_t i = 0; i < family.nbits; ++i) {
    family.bit_x[i] += static_cast<uint32_t>(wider);
    family.bit_y[i] += static_cast<uint32_t>(wider);
  }
}

}  // namespace

AprilTagFamily make_apriltag_family(const std::string& name, int border) {
  for (const KnownFamily& known : kFamilies) {
    if (name != known.name) continue;
    AprilTagFamily family(known.create(), known.destroy);
    if (border < 1)
      throw std::invalid_argument(name + ": a border of " + std::to_string(border) + " modules");
    if (border > 1 && family->reversed_border) {
      throw std::invalid_argument(name + ": has data outside of its border, which can only be 1 module wide");
    }
    widen_border(*family, border);
    return family;
  }
  throw std::invalid_argument(name + ": no AprilTag family that libapriltag knows");
}

}  // namespace perch
