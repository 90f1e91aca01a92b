// What states of every method are made of, for archives: see compute/archive.h.
#pragma once

#include "compute/archive.h"
#include "cutting/resisting_edge.h"
#include "fragments/pieces.h"
#include "frame/stability_limit.h"
#include "frame/step_acceptance.h"
#include "frame/step_length.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/tissue.h"
#include "tissue_sim/tool.h"
#include "tools/collider.h"
#include "tools/instrument.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, Pose& p) {
  archive(p.position, p.orientation);
}

template <class Archive>
void fields(Archive& archive, Box& b) {
  archive(b.min, b.max);
}

template <class Archive>
void fields(Archive& archive, ToolMotion& m) {
  archive(m.present, m.begin, m.end, m.jaw_begin, m.jaw_end);
}

template <class Archive>
void fields(Archive& archive, ColliderLoad& l) {
  archive(l.force, l.torque, l.points);
}

template <class Archive>
void fields(Archive& archive, Grip& g) {
  archive(g.pressed_, g.stiffness_);
}

template <class Archive>
void fields(Archive& archive, Instrument& i) {
  archive(i.asked_, i.jaw_, i.is_placed_, i.is_asked_, i.way_in_, i.grip_pressure_, i.grip_);
}

template <class Archive>
void fields(Archive& archive, AnchorMotion& m) {
  archive(m.begin, m.end);
}

template <class Archive>
void fields(Archive& archive, BladePath& p) {
  archive(p.edge, p.poses, p.edge_at_end);
}

template <class Archive>
void fields(Archive& archive, EdgePlace& p) {
  archive(p.body, p.site, p.at);
}

template <class Archive>
void fields(Archive& archive, EdgeHold& h) {
  archive(h.place, h.swept, h.ahead, h.slides, h.stiffness, h.presses, h.lets_go);
}

template <class Archive>
void fields(Archive& archive, FluidOrder& o) {
  archive(o.body, o.pressure, o.drain);
}
template <class Archive>
void fields(Archive& archive, Fragment& f) {
  archive(f.id, f.parent, f.body, f.loose, f.point_count, f.volume, f.centroid, f.velocity, f.box);
}

template <class Archive>
void fields(Archive& archive, Stiffness& s) {
  archive(s.measured, s.last);
}

template <class Archive>
void fields(Archive& archive, StabilityLimit& x) {
  archive(x.limit_, x.measured_at_, x.longest_age_, x.growth_, x.trend_, x.followed_at_);
}

template <class Archive>
void fields(Archive& archive, StepLength& x) {
  archive(x.part_, x.most_, x.held_, x.of_swing_, x.of_last_swing_, x.swing_end_);
}

template <class Archive>
void fields(Archive& archive, StepAcceptance& x) {
  archive(x.energy_, x.shortened_);
}

template <class Archive>
void fields(Archive& archive, Pieces& p) {
  archive(p.of_point, p.all, p.lowest, p.anchored, p.next_id);
}

}  // namespace tissue_sim
