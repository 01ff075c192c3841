#include "perch/flight/write_nav.h"

#include "perch/flight/csv_number.h"

namespace perch {

std::string nav_header() {
  return "#timestamp [ns],p_x [m],p_y [m],p_z [m],q_w,q_x,q_y,q_z,v_x [m/s],v_y [m/s],v_z [m/s]\n";
}

void append_nav(const NavSample& nav, std::string& csv) {
  append_number(csv, nav.timestamp_ns);
  const Eigen::Quaterniond& q = nav.world_from_body.rotation;
  for (const double value : nav.world_from_body.translation) append_field(csv, value);
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) {
    if (nav.knows_attitude()) {
      append_field(csv, value);
    } else {
      csv += ',';
    }
  }
  for (const double value : nav.body_velocity_in_world) append_field(csv, value);
  csv += '\n';
}

}  // namespace perch
