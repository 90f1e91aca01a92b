// What the state of tissue on a GPU has beside the host's, on its way to an archive and back. What
// follows from the rest with the same bits (tables, measures, which nodes contacts push) is not in
// it, nor what each frame, part or substep writes before it reads it.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/archive.h"
#include "frame/state_check.h"
#include "mpm/cuda/face_tables.h"

namespace tissue_sim {

/// An entry of CudaTables::with and ::hold.
struct HeldPoint {
  std::int32_t entry;
  std::uint8_t with;
  float hold[4];
  TISSUE_SIM_FIELDS(entry, with, hold)
};

/// How far the search of faces has come.
struct FacesState {
  int version = -1;             ///< FaceContacts::version of the facets that are there
  bool pieces_changed = false;  ///< since they went up
  bool lists_hold = false;      ///< there are lists
  int contacts_count = 0, involved_count = 0;  ///< see CudaFaceFigures
  bool searched = false;                       ///< and not looked at since
  bool may_meet = false;                       ///< whether any two may before the next search
};

/// FacesOnDevice. Lists are in order here, and have no gaps.
struct FacesOnHost : FacesState {
  bool is_current = false;  ///< those facets are there that the host has; else what is per facet
                            ///< is made anew
  bool has_sites = false, has_figures = false;
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

/// What it refers to.
struct KnownToDevice {
  int version;                       ///< FaceContacts::version
  std::int64_t facets, nodes, held;  ///< CudaTables::with has so many entries
  int colliders;
};

/// That all counts and indices that kernels believe can be so.
inline void check_state_on_host(const StateOnHost& s, const KnownToDevice& k) {
  for (const HeldPoint& p : s.held) {
    check_state(p.entry >= 0 && p.entry < k.held && p.with > 0 && p.with <= k.colliders,
                "held points");
  }
  check_state(static_cast<std::int64_t>(s.marks.size()) == k.nodes, "marks");
  const FacesOnHost& f = s.faces;
  constexpr std::uint64_t kMost = std::uint64_t{1} << 31;
  check_state(f.is_current == (f.version == k.version) && f.spring_room < kMost &&
                  f.near_room < kMost && f.contacts_count >= 0 && f.involved_count >= 0,
              "facets");
  check_state(f.figures.next_pair >= 0 && f.figures.next_pair < 2, "search");
  if (!f.is_current) return;
  if (k.facets == 0) {
    check_state(f.contacts_count == 0, "facets");
    return;
  }
  const auto is = [](std::size_t size, std::int64_t wanted, const char* what) {
    check_state(static_cast<std::int64_t>(size) == wanted, what);
  };
  is(f.motion.size(), k.facets, "facets");
  is(f.listed.size(), k.facets, "facets");
  if (f.spring_room > 0) {
    is(f.springs.size(), k.facets, "face springs");
    is(f.spring_room, k.facets, "face springs");
  }
  for (const FaceSpring& spring : f.springs) {
    check_state(spring.facet >= 0 && spring.facet < k.facets && spring.other >= -1 &&
                    spring.other < k.facets,
                "face springs");
  }
  // The next search, which may find that they hold, believes the figures.
  if (f.lists_hold) {
    check_state(f.has_figures && f.figures.contacts == f.contacts_count &&
                    f.figures.involved == f.involved_count,
                "search");
  }
  if (f.contacts_count == 0) return;
  check_state(f.has_figures && f.spring_room > 0, "face contacts");
  is(f.contacts.size(), f.contacts_count, "face contacts");
  is(f.involved.size(), f.involved_count, "face contacts");
  for (const auto* facets : {&f.contacts, &f.involved}) {
    check_indices(*facets, 0, k.facets, "face contacts");
    for (std::size_t i = 1; i < facets->size(); ++i) {  // none twice
      check_state((*facets)[i - 1] < (*facets)[i], "face contacts");
    }
  }
  is(f.near_count.size(), k.facets, "near facets");
  std::int64_t near = 0;
  for (const std::int32_t count : f.near_count) {
    check_state(count >= 0, "near facets");
    near += count;
  }
  is(f.near.size(), near, "near facets");
  check_state(f.near.size() <= f.near_room && near <= f.figures.near, "near facets");
  check_indices(f.near, 0, k.facets, "near facets");
  if (f.searched) return;  // the next look finds the nodes
  is(f.nodes.size(), f.contacts_count, "contact nodes");
  for (const CudaContactNodes& n : f.nodes) {
    check_indices(n.own, 0, k.nodes, "contact nodes");
    check_indices(n.other, 0, k.nodes, "contact nodes");
  }
}

}  // namespace tissue_sim
