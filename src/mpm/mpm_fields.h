// What the state of the material point method is made of, for archives: see compute/archive.h. What
// follows from the scene alone (bodies on their lattices) is not in it, nor what each substep
// writes before it reads it.
#pragma once

#include "compute/archive.h"
#include "frame/state_check.h"
#include "frame/state_fields.h"
#include "mpm/contact/touching_tissue.h"
#include "mpm/fragment_forecast.h"
#include "mpm/mpm_state.h"
#include "mpm/substep_choice.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, Crossings& x) {
  archive(x.index_, x.of_point_);
  if constexpr (Archive::kReads) {
    check_indices(x.index_, -1, static_cast<std::int64_t>(x.of_point_.size()), "cuts");
  }
}

template <class Archive>
void fields(Archive& archive, NodeFields& x) {
  archive(x.splits_, x.split_of_);
  if constexpr (Archive::kReads) {
    check_indices(x.split_of_, -1, static_cast<std::int64_t>(x.splits_.size()), "split nodes");
    for (const NodeFields::Split& split : x.splits_) {
      check_state(!split.fields.empty(), "split nodes");
    }
    check_state(x.split_of_.empty() || x.split_of_.size() == x.mass_of_point_.size(),
                "split nodes");
  }
}

/// Of a block that was read: makes what follows from the rest. Throws as check_state().
void complete_block(Block& block);

template <class Archive>
void fields(Archive& archive, Block& b) {
  archive(b.body, b.x, b.y, b.z, b.nx, b.ny, b.nz, b.sides, b.runs, b.node_rows, b.material,
          b.mixture, b.volume, b.point, b.partial, b.node, b.facets, b.surface, b.merged, b.modulus,
          b.number);
  if constexpr (Archive::kReads) complete_block(b);
}

template <class Archive>
void fields(Archive& archive, Blocks& b) {
  archive(b.regions, b.room, b.next_number, b.stale_facets);
  if constexpr (Archive::kReads) list_blocks(b);
}

template <class Archive>
void fields(Archive& archive, Touch& t) {
  archive(t.cell, t.point, t.key, t.collider, t.hold, t.along, t.inertia, t.begun, t.doubled,
          t.part);
}

template <class Archive>
void fields(Archive& archive, FrontNodes& f) {
  std::vector<std::int64_t> bonds;
  std::vector<std::uint32_t> passed;
  for (const auto& [bond, mask] : f.rim) {
    bonds.push_back(bond);
    passed.push_back(mask);
  }
  archive(bonds, passed, f.nodes);
  if constexpr (Archive::kReads) {
    f.rim.clear();
    check_sizes("rim", bonds, passed);
    for (std::size_t i = 0; i < bonds.size(); ++i) f.rim[bonds[i]] = passed[i];
  }
}

/// Of a state that was read: checks it, but for its scene and what follows from that, and makes
/// what follows from it. Throws std::runtime_error: see frame/state_check.h.
void complete_tissue(MpmState& state);
/// The same of what the CPU has beside that.
void complete_state(MpmState& state);

/// All but contact of tissue with tissue, which each device has in its way.
template <class Archive>
void tissue_fields(Archive& archive, MpmState& s) {
  archive.part("scene", s.scene.gravity, s.scene.damping);
  std::apply([&](auto&... of) { archive.part("topology", of...); }, topology_of(s));
  std::apply([&](auto&... of) { archive.part("motion", of...); }, motion_of(s));
  archive.part("records", static_cast<TearRecords&>(s));
  archive.part("blocks' motion", s.motion, s.worst_stiffening);
}

}  // namespace tissue_sim
