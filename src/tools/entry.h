// How a tool comes into tissue that it is placed in.
#pragma once

#include "tissue_sim/point.h"
#include "tissue_sim/tool.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// How far the tool must be drawn back along its shaft until none of the points lies in it [m], in
/// steps of `step` [m]; 0 if none does where it is, -1 if they do up to `farthest` [m]. A scalpel's
/// blade is thin and cuts its way: 0.
///
/// A tool that appears within tissue has it on all sides, and between the jaws of a grasper what
/// closed jaws would have pushed away: it reads almost no force. So it comes in from there: one
/// that is placed, and one that first stands deeper than two cells (Instrument::move()).
double way_out(const Tool& tool, const Pose& pose, double jaw, Span<const Point> points,
               double step, double farthest);

}  // namespace tissue_sim
