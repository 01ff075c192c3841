#pragma once

namespace perch {

// One axis of a head, rad and rad/s.
struct AxisLimits {
  double min = 0, max = 0;
  double max_speed = 0;
  double speed_step = 0;  // between one speed and the next
  double count = 0;       // between one angle it can tell and the next
};

// What a head can do. Signs as in PanTilt: pan to the right, tilt up.
struct HeadModel {
  AxisLimits pan, tilt;
};

// Sony's EVI-D30 and D31: pan FC90h to 0370h is -100 to 100 degrees, tilt FED4h to 012Ch -25 to 25 (EVI-D70
// technical manual, page 58); speeds of 3.33 degrees/s a step to 18h, and 2.5 to 14h (EVI-D100 technical
// manual, page 44).
HeadModel evi_d30();

}  // namespace perch
