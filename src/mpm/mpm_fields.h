// What the state of the material point method is made of, for archives: see compute/archive.h. What
// follows from the scene alone (bodies on their lattices) is not in it, nor what each substep
// writes before it reads it.
#pragma once

#include "compute/archive.h"
#include "frame/state_check.h"
#include "frame/state_fields.h"
#include "mpm/fragment_forecast.h"
#include "mpm/mpm_state.h"
#include "mpm/substep_choice.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, Crossing& x) {
  archive(x.place, x.normal);
}

template <class Archive>
void fields(Archive& archive, Crossings& x) {
  archive(x.index_, x.of_point_);
  if constexpr (Archive::kReads) {
    check_indices(x.index_, -1, static_cast<std::int64_t>(x.of_point_.size()), "cuts");
  }
}

template <class Archive>
void fields(Archive& archive, PointBonds& p) {
  archive(p.bonds, p.soft, p.crossings);
}

template <class Archive>
void fields(Archive& archive, NodeMotion& n) {
  archive(n.u, n.v);
}

template <class Archive>
void fields(Archive& archive, NodeMasses& n) {
  archive(n.mass, n.inv_mass);
}

template <class Archive>
void fields(Archive& archive, BondWindows& x) {
  for (auto& of : x.bodies_) archive(of.window);
}

template <class Archive>
void fields(Archive& archive, NodeFields::Split::Field& f) {
  archive(f.points, f.node);
}

template <class Archive>
void fields(Archive& archive, NodeFields::Split& s) {
  archive(s.fields);
}

template <class Archive>
void fields(Archive& archive, NodeFields& x) {
  const std::size_t lattice_nodes = x.mass_of_point_.size();
  archive(x.bonds_, x.mass_of_point_, x.splits_, x.split_of_);
  if constexpr (Archive::kReads) {
    check_state(x.mass_of_point_.size() == lattice_nodes, "split nodes");
    check_indices(x.split_of_, -1, static_cast<std::int64_t>(x.splits_.size()), "split nodes");
    for (const NodeFields::Split& split : x.splits_) {
      check_state(!split.fields.empty(), "split nodes");
    }
    check_state(x.split_of_.empty() || x.split_of_.size() == x.mass_of_point_.size(),
                "split nodes");
  }
}

template <class Archive>
void fields(Archive& archive, Block::Mixture& m) {
  archive(m.law, m.mu, m.lambda, m.neo_hookean, m.viscosity);
}

template <class Archive>
void fields(Archive& archive, Block::PartialCell& c) {
  archive(c.lane, c.node, c.mu);
}

template <class Archive>
void fields(Archive& archive, Facet& f) {
  archive(f.point, f.cell, f.direction, f.center, f.normal, f.extent, f.area);
}

template <class Archive>
void fields(Archive& archive, SurfacePlace& p) {
  archive(p.cell, p.node, p.point, p.points, p.key, p.place, p.normal, p.area);
}

template <class Archive>
void fields(Archive& archive, Block& b) {
  archive(b.body, b.x, b.y, b.z, b.nx, b.ny, b.nz, b.sides, b.pitch, b.stride, b.plane, b.runs,
          b.node_rows, b.filled, b.filled_columns, b.cell, b.material, b.mixture, b.volume, b.point,
          b.partial, b.node, b.facets, b.surface, b.merged, b.modulus, b.number, b.force_offset);
}

template <class Archive>
void fields(Archive& archive, BlockRegion& r) {
  archive(r.body, r.x, r.y, r.z, r.nx, r.ny, r.nz, r.blocks, r.half);
}

template <class Archive>
void fields(Archive& archive, Blocks& b) {
  archive(b.regions, b.uniform, b.has_rows, b.room, b.origin, b.force_size, b.next_number,
          b.stale_facets, b.by_cost, b.rows, b.row_parts, b.first_split_node);
  struct Place {
    std::int32_t region, block;
  };
  std::vector<Place> all;
  if constexpr (!Archive::kReads) {
    for (const Block* block : b.all) {
      for (std::size_t r = 0; r < b.regions.size(); ++r) {
        const std::vector<Block>& blocks = b.regions[r].blocks;
        if (blocks.empty() || block < &blocks.front() || block > &blocks.back()) continue;
        all.push_back(
            {static_cast<std::int32_t>(r), static_cast<std::int32_t>(block - blocks.data())});
      }
    }
  }
  archive(all);
  if constexpr (Archive::kReads) {
    b.all.clear();
    for (const Place& p : all) {
      check_state(p.region >= 0 && p.region < static_cast<std::int32_t>(b.regions.size()),
                  "blocks");
      std::vector<Block>& of = b.regions[p.region].blocks;
      check_state(p.block >= 0 && p.block < static_cast<std::int32_t>(of.size()), "blocks");
      b.all.push_back(&of[p.block]);
    }
  }
}

template <class Archive>
void fields(Archive& archive, BlockMotion& m) {
  archive(m.box, m.speed);
}

template <class Archive>
void fields(Archive& archive, RigidMotion& m) {
  archive(m.rotation, m.translation);
}

template <class Archive>
void fields(Archive& archive, FaceRow& r) {
  archive(r.node, r.weight, r.share, r.anchor, r.place);
}

template <class Archive>
void fields(Archive& archive, AnchorRows::HeldNode& n) {
  archive(n.node, n.anchor, n.place);
}

template <class Archive>
void fields(Archive& archive, AnchorRows& a) {
  archive(a.rows, a.groups, a.inverse, a.held, a.moves);
}

template <class Archive>
void fields(Archive& archive, AnchorFaceMotion& a) {
  archive(a.impulse, a.now);
}

template <class Archive>
void fields(Archive& archive, Touch& t) {
  archive(t.cell, t.point, t.key, t.collider, t.hold, t.along, t.inertia, t.begun, t.doubled,
          t.part);
}

template <class Archive>
void fields(Archive& archive, NearCell& c) {
  archive(c.lane, c.node, c.collider, c.points, c.first_place, c.place_count, c.middle,
          c.first_part, c.lightest, c.clear, c.points_clear);
}

template <class Archive>
void fields(Archive& archive, NearPart& p) {
  archive(p.mobility, p.clear, p.side);
}

template <class Archive>
void fields(Archive& archive, InertialNode& n) {
  archive(n.node, n.uses, n.changed, n.collider, n.place, n.mass, n.inertia, n.share, n.before,
          n.impulse, n.grown);
}

template <class Archive>
void fields(Archive& archive, InertiaChange& c) {
  archive(c.sign, c.begins, c.node, c.collider, c.place, c.normal, c.inertia, c.velocity);
}

template <class Archive>
void fields(Archive& archive, Contacts& c) {
  archive(c.near, c.cells, c.parts, c.touching, c.changes, c.inertia.nodes, c.inertia.dt,
          c.until_list);
}

template <class Archive>
void fields(Archive& archive, FragmentFlight& f) {
  archive(f.piece, f.nodes, f.home, f.from_centre, f.inertia, f.rotation, f.centre, f.velocity,
          f.angular);
}

template <class Archive>
void fields(Archive& archive, SubstepChoice& x) {
  archive(x.limit_, x.length_, x.acceptance_);
}

template <class Archive>
void fields(Archive& archive, FragmentChance& c) {
  archive(c.point, c.time, c.probability, c.F, c.deviation, c.expected);
}

template <class Archive>
void fields(Archive& archive, WaitingFragment& w) {
  archive(w.piece, w.until, w.F);
}

template <class Archive>
void fields(Archive& archive, FrontNode& n) {
  archive(n.node, n.body, n.x, n.y, n.z, n.share, n.first, n.other, n.mass, n.lambda_over_mu, n.all,
          n.first_side);
}

template <class Archive>
void fields(Archive& archive, FrontMotion& f) {
  archive(f.d, f.rate);
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

template <class Archive>
void fields(Archive& archive, TearRecords& r) {
  archive(r.tore_at, r.bridge_ends, r.debris);
}

/// Of a state that was read, on the CPU, but for its scene and what follows from that. Throws
/// std::runtime_error: see frame/state_check.h.
void check_state(const MpmState& state);
/// What of it the GPU keeps as well.
void check_tissue(const MpmState& state);

/// All but contact of tissue with tissue: mpm/contact/face_fields.h.
template <class Archive>
void tissue_fields(Archive& archive, MpmState& s) {
  archive.part("scene", s.scene.gravity, s.scene.damping);
  std::apply([&](auto&... of) { archive.part("topology", of...); }, topology_of(s));
  std::apply([&](auto&... of) { archive.part("motion", of...); }, motion_of(s));
  archive.part("records", static_cast<TearRecords&>(s));
  archive.part("blocks' motion", s.motion, s.worst_stiffening);
}

}  // namespace tissue_sim
