// What the state of the material point method is made of, for archives: see compute/archive.h. What
// follows from the scene alone (bodies on their lattices) is not in it, nor what each substep
// writes before it reads it.
#pragma once

#include "compute/archive.h"
#include "frame/state_fields.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, Crossings& x) {
  archive(x.index_, x.of_point_);
}

template <class Archive>
void fields(Archive& archive, Points& p) {
  archive(p.bonds, p.soft, p.crossings);
}

template <class Archive>
void fields(Archive& archive, Nodes& n) {
  archive(n.u, n.v, n.mass, n.inv_mass);
}

template <class Archive>
void fields(Archive& archive, BondWindows& x) {
  for (auto& of : x.bodies_) archive(of.window);
}

template <class Archive>
void fields(Archive& archive, NodeFields::Split& s) {
  archive(s.fields);
}

template <class Archive>
void fields(Archive& archive, NodeFields& x) {
  archive(x.bonds_, x.mass_of_point_, x.splits_, x.split_of_);
}

template <class Archive>
void fields(Archive& archive, Block::Mixture& m) {
  archive(m.law, m.mu, m.lambda, m.neo_hookean, m.viscosity);
}

template <class Archive>
void fields(Archive& archive, Block& b) {
  archive(b.body, b.x, b.y, b.z, b.nx, b.ny, b.nz, b.sides, b.pitch, b.stride, b.plane, b.runs,
          b.node_rows, b.filled, b.filled_columns, b.cell, b.material, b.mixture, b.volume, b.point,
          b.partial, b.node, b.facets, b.surface, b.modulus, b.number, b.force_offset);
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
    for (const Place& p : all) b.all.push_back(&b.regions.at(p.region).blocks.at(p.block));
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
void fields(Archive& archive, AnchorFaces& a) {
  archive(a.rows, a.groups, a.inverse, a.impulse, a.held, a.now, a.moves);
}

template <class Archive>
void fields(Archive& archive, Contacts& c) {
  archive(c.near, c.cells, c.touching, c.changes, c.inertia.nodes, c.inertia.dt, c.until_list);
}

/// The nodes around a cell of a block, -1 for none: they are addresses in it.
template <class Archive>
void cell_nodes(Archive& archive, const Blocks& blocks, std::int32_t number, CellNodes& nodes) {
  std::int64_t cell = -1;
  const Block* const block = number < 0 ? nullptr : blocks.all.at(number);
  if constexpr (!Archive::kReads) {
    if (block != nullptr && !block->node.empty() && nodes.lowest >= block->node.data() &&
        nodes.lowest <= &block->node.back()) {
      cell = nodes.lowest - block->node.data();
    }
  }
  archive(cell);
  if constexpr (Archive::kReads) {
    nodes = {};
    if (cell >= 0 && block != nullptr) nodes = CellNodes(*block, static_cast<int>(cell));
  }
}

template <class Archive>
void fields(Archive& archive, FaceContacts& f, const Blocks& blocks) {
  archive(f.version, f.first_facet, f.block_of, f.motion, f.listed, f.first_near, f.near, f.active,
          f.between, f.first_of_block, f.of_block, f.first_within, f.within, f.kept, f.until_search,
          f.until_look, f.dt);
  f.all.resize(archive.count(f.all.size(), sizeof(FaceSpring)));
  for (FaceContact& c : f.all) {
    archive(static_cast<FaceSpring&>(c), c.has_whole_rows, c.other_has_whole_rows, c.weights,
            c.other_weights, c.looked_at, c.look_at);
    const auto block_of = [&](std::int32_t facet) {
      return facet < 0 || facet >= static_cast<std::int32_t>(f.block_of.size()) ? -1
                                                                                : f.block_of[facet];
    };
    cell_nodes(archive, blocks, block_of(c.facet), c.nodes);
    cell_nodes(archive, blocks, block_of(c.other), c.other_nodes);
  }
}

template <class Archive>
void fields(Archive& archive, FragmentFlight& f) {
  archive(f.piece, f.nodes, f.home, f.from_centre, f.inertia, f.rotation, f.centre, f.velocity,
          f.angular);
}

template <class Archive>
void fields(Archive& archive, MpmState& s) {
  archive(s.points, s.nodes, *s.fields, s.blocks, s.motion, s.wildest, s.time, s.dt, s.tore_at,
          s.threads, s.crumbs, s.contacts, s.anchors, s.scene.gravity, s.scene.damping, s.flights);
  fields(archive, s.faces, s.blocks);
}

}  // namespace tissue_sim
