// What the state of contact of tissue with tissue is made of, for archives: see compute/archive.h.
#pragma once

#include "compute/archive.h"
#include "frame/state_check.h"
#include "mpm/contact/touching_tissue.h"

namespace tissue_sim {

template <class Archive>
void fields(Archive& archive, FacetMotion& m) {
  archive(m.x, m.v, m.normal, m.to_reference);
}

template <class Archive>
void fields(Archive& archive, ListedFacet& l) {
  archive(l.x, l.skin);
}

template <class Archive>
void fields(Archive& archive, KeptContact& k) {
  archive(k.point, k.direction, k.other_body, k.hold, k.depth, k.begun, k.stiffness, k.apart,
          k.looked_at);
}

template <class Archive>
void fields(Archive& archive, AxisWeights& w) {
  archive(w.of);
}

template <class Archive>
void fields(Archive& archive, FaceSpring& c) {
  archive(c.from_middle, c.cell_size, c.hold, c.between, c.apart, c.normal, c.to_reference,
          c.stiffness, c.damping, c.friction, c.own_mobility, c.sudden, c.force, c.touching,
          c.facet, c.other, c.depth, c.begun);
}

/// The nodes around a cell of a block, -1 for none: they are addresses in it.
template <class Archive>
void cell_nodes(Archive& archive, const Blocks& blocks, std::int32_t number, CellNodes& nodes) {
  std::int64_t cell = -1;
  const auto blocks_there = static_cast<std::int32_t>(blocks.all.size());
  check_state(number < blocks_there, "contacts");
  const Block* const block = number < 0 ? nullptr : blocks.all[number];
  if constexpr (!Archive::kReads) {
    if (block != nullptr && !block->node.empty() && nodes.lowest >= block->node.data() &&
        nodes.lowest <= &block->node.back()) {
      cell = nodes.lowest - block->node.data();
    }
  }
  archive(cell);
  if constexpr (Archive::kReads) {
    nodes = {};
    if (cell < 0 || block == nullptr) return;
    check_state(cell + 2 * (block->plane + block->pitch + 1) <
                    static_cast<std::int64_t>(block->node.size()),
                "contacts");
    nodes = CellNodes(*block, static_cast<int>(cell));
  }
}

/// On the CPU: of contacts in blocks that are there already.
template <class Archive>
void fields(Archive& archive, FaceContacts& f, const Blocks& blocks) {
  archive(f.version, f.first_facet, f.block_of, f.motion, f.listed, f.first_near, f.near, f.active,
          f.between, f.first_of_block, f.of_block, f.first_within, f.within, f.kept, f.until_search,
          f.until_look, f.dt, f.fastest);
  f.all.resize(archive.count(f.all.size(), sizeof(FaceSpring) / 2));
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

}  // namespace tissue_sim
