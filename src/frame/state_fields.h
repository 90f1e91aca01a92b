// What states of every method are made of, for archives: see compute/archive.h.
#pragma once

#include "compute/archive.h"
#include "fragments/pieces.h"
#include "tissue_sim/cut.h"
#include "tissue_sim/tissue.h"
#include "tissue_sim/tool.h"

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
void fields(Archive& archive, AnchorMotion& m) {
  archive(m.begin, m.end);
}

template <class Archive>
void fields(Archive& archive, BladePath& p) {
  archive(p.edge, p.poses);
}

template <class Archive>
void fields(Archive& archive, Fragment& f) {
  archive(f.id, f.parent, f.body, f.loose, f.point_count, f.volume, f.centroid, f.velocity, f.box);
}

template <class Archive>
void fields(Archive& archive, Pieces& p) {
  archive(p.of_point, p.all, p.lowest, p.anchored, p.next_id);
}

}  // namespace tissue_sim
