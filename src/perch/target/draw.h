#pragma once

#include <cairo.h>

#include "perch/target/landing_target.h"
#include "perch/target/sheet.h"

namespace perch {

// Drawing with cairo; the caller owns the context and asks for its status.

// The target alone in its own frame: a unit of the user space is a metre and y points up. Paints exact
// shapes, black and white; nothing where the target has nothing.
void draw_target(cairo_t* cr, const LandingTarget& target);

// One page; a unit is a millimetre, origin at the upper left corner, y down. `number` is the sheet.s
// index in the plan.
void draw_sheet(cairo_t* cr, const LandingTarget& target, const SheetPlan& plan, size_t number);

// The page that goes with tiles: which one goes where, and how they are put together.
void draw_overview(cairo_t* cr, const LandingTarget& target, const SheetPlan& plan);

}  // namespace perch
