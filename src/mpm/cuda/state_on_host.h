// What the state of tissue on a GPU has beside the host's, on its way to an archive and back. What
// follows from the rest with the same bits (tables, measures, which nodes contacts push) is not in
// it, nor what each frame, part or substep writes before it reads it.
#pragma once

#include <vector>

#include "mpm/contact/face_fields.h"
#include "mpm/cuda/choose_plan.h"
#include "mpm/cuda/near_cells.h"
#include "mpm/cuda/tables.h"

namespace tissue_sim {

/// FacesOnDevice. Lists are in order here, and have no gaps.
struct FacesOnHost {
  int version = -1;
  bool is_current = false;  ///< those facets are there that the host has; else what is per facet
                            ///< is made anew
  bool pieces_changed = false, lists_hold = false, searched = false, may_meet = false;
  bool has_sites = false, has_figures = false;
  int contacts_count = 0, involved_count = 0;
  std::uint64_t spring_room = 0, near_room = 0;
  CudaFaceFigures figures = {};
  std::vector<FacetMotion> motion;
  std::vector<ListedFacet> listed;
  std::vector<FaceSpring> springs;
  std::vector<std::int32_t> near_count, near;
  std::vector<std::int32_t> contacts, involved;
  std::vector<CudaContactNodes> nodes;  ///< parallels `contacts`; empty before these were looked at
};

struct StateOnHost {
  std::vector<HeldPoint> held;      ///< by entry
  std::vector<std::uint8_t> marks;  ///< per node: what may push it
  FacesOnHost faces;
};

template <class Archive>
void fields(Archive& archive, HeldPoint& p) {
  archive(p.entry, p.with, p.hold);
}

template <class Archive>
void fields(Archive& archive, CudaFaceFigures& f) {
  archive(f.box, f.mean_moved, f.mean_velocity, f.horizon, f.until_look, f.since_look, f.dt,
          f.fastest, f.largest_reach, f.meeting, f.fastest_pair, f.next_pair, f.listed_anew,
          f.in_grid, f.near, f.contacts, f.involved);
}

template <class Archive>
void fields(Archive& archive, CudaContactNodes& n) {
  archive(n.own, n.other, n.weight);
}

template <class Archive>
void fields(Archive& archive, CudaShape& s) {
  BlockShape& b = s.blocks;
  archive(b.x, b.y, b.z, b.uniform, b.has_rows, b.room, s.threads, s.small);
}

template <class Archive>
void each_part(Archive& archive, StateOnHost& s) {
  FacesOnHost& f = s.faces;
  archive.part("held points", s.held);
  archive.part("marks", s.marks);
  archive.part("search", f.version, f.is_current, f.pieces_changed, f.lists_hold, f.searched,
               f.may_meet, f.has_sites, f.has_figures, f.contacts_count, f.involved_count,
               f.spring_room, f.near_room);
  archive.part("search figures", f.figures);
  archive.part("facet motion", f.motion);
  archive.part("listed facets", f.listed);
  archive.part("face springs", f.springs);
  archive.part("near facets", f.near_count, f.near);
  archive.part("face contacts", f.contacts, f.involved);
  archive.part("contact nodes", f.nodes);
}

}  // namespace tissue_sim
