// Whether what was read of a state can be one: each index and count that is believed from there on;
// and what follows from it.
#include <algorithm>

#include "frame/state_check.h"
#include "mpm/contact/face_places.h"
#include "mpm/mpm_fields.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

/// What the parts of a state refer to.
struct Known {
  std::int64_t points, nodes, lattice_nodes, bodies, anchors, colliders;
};

Known known(const MpmState& s) {
  std::int64_t anchors = 0;
  for (const Body& body : s.scene.bodies) anchors += static_cast<std::int64_t>(body.anchors.size());
  return {s.points.size(),
          static_cast<std::int64_t>(s.nodes.size()),
          lattice_node_count(s.bodies),
          static_cast<std::int64_t>(s.bodies.size()),
          anchors,
          collider_count(s.scene)};
}

void check_points(const MpmState& s, const Known& k) {
  const Points& p = s.points;
  check_sizes("points", p.site, p.bonds, s.whole_bonds);
  check_state(p.soft.empty() || p.soft.size() == p.site.size(), "points");
  for (std::size_t i = 0; i < p.bonds.size(); ++i) {
    check_state((p.bonds[i] & ~s.whole_bonds[i]) == 0, "bonds");
  }
  for (std::int32_t i = 0; i < k.points; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const Crossing* const c = p.crossings.find(i, axis);
      if (c != nullptr) check_state(c->place <= 1e3f, "cuts");
    }
  }
}

void check_nodes(const MpmState& s, const Known& k) {
  check_state(k.nodes >= k.lattice_nodes, "nodes");
  for (int a = 0; a < 3; ++a) {
    check_sizes("nodes", s.nodes.mass, s.nodes.inv_mass, s.nodes.u[a], s.nodes.v[a]);
    check_numbers(s.nodes.u[a], kFarthest, "places");
    check_numbers(s.nodes.v[a], kFastestTissue, "speeds");
  }
  check_numbers(s.nodes.mass, 1e9, "masses");
  check_numbers(s.nodes.inv_mass, 1e37, "masses");
  for (std::int64_t i = 0; i < k.lattice_nodes; ++i) {
    const NodeFields::Split* const split = s.fields->split(static_cast<int>(i));
    if (split == nullptr) continue;
    for (const auto& field : split->fields) {
      check_state(field.node >= 0 && field.node < k.nodes, "split nodes");
    }
  }
}

/// A cell's lowest node in a block.
void check_cell(const Block& b, std::int64_t node) {
  check_state(node >= 0 && node + 2 * (b.plane + b.pitch + 1) < b.node_count(), "cells");
}

void check_block(const Block& b, const MpmState& s, const Known& k) {
  check_state(b.body >= 0 && b.body < k.bodies, "blocks");
  check_indices(b.point, -1, k.points, "points");
  check_indices(b.node, -1, k.nodes, "nodes");
  // Where there is volume a cell sees all of its nodes.
  for (int z = 0; z < b.nz; ++z) {
    for (const Block::Span& span : b.filled[z]) {
      for (int j = span.begin; j < span.end; ++j) {
        for (int n = 0; n < 27; ++n) {
          const int at = (z + n / 9) * b.plane + b.cell[j] + n / 3 % 3 * b.pitch + n % 3;
          check_state(b.node[at] >= 0, "nodes");
        }
      }
    }
  }
  for (const Block::NodeRow& r : b.node_rows) {
    check_state(r.local >= 0 && r.count > 0 && r.count <= b.node_count() - r.local &&
                    (r.node == -1 || (r.node >= 0 && r.node + std::int64_t{r.count} <= k.nodes)),
                "nodes");
  }
  const auto materials = static_cast<int>(s.bodies[b.body].materials.size());
  check_state(b.material >= Block::kMixed && b.material < materials, "materials");
  const Block::Mixture& m = b.mixture;
  const bool mixed = b.material == Block::kMixed;
  check_state(
      m.mu.size() == (mixed ? b.volume.size() : 0) && m.lambda.size() == m.mu.size() &&
          (m.neo_hookean.empty() || m.neo_hookean.size() == m.mu.size()) &&
          (m.viscosity.empty() || m.viscosity.size() == static_cast<std::size_t>(b.nz) * b.stride),
      "materials");
  const auto lanes = static_cast<std::int64_t>(b.lane_count());
  for (const Block::PartialCell& c : b.partial) {
    check_state(c.lane >= 0 && c.lane < lanes, "cells");
    check_cell(b, c.node);
  }
  for (const Facet& f : b.facets) {
    check_state(f.point >= 0 && f.point < k.points && f.direction < 6, "facets");
    check_cell(b, f.cell);
  }
  for (const auto* places : {&b.surface, &b.merged}) {
    for (const SurfacePlace& p : *places) {
      check_state(p.point >= 0 && p.point < k.points && p.cell >= 0 && p.cell < lanes, "surface");
      check_cell(b, p.node);
    }
  }
}

void check_blocks(const MpmState& s, const Known& k) {
  const Blocks& blocks = s.blocks;
  for (const BlockRegion& r : blocks.regions) {
    check_state(r.body >= 0 && r.body < k.bodies, "regions");
  }
  for (const Block* block : blocks.all) {
    check_block(*block, s, k);
    check_state(block->number >= 0 && block->number < blocks.next_number, "blocks");
  }
  check_state(blocks.stale_facets.empty() ||
                  static_cast<std::int64_t>(blocks.stale_facets.size()) == k.lattice_nodes,
              "nodes");
  check_state(s.motion.size() == blocks.all.size(), "motion");
}

void check_contacts(const MpmState& s, const Known& k) {
  const Contacts& c = s.contacts;
  check_state(c.touching.size() == s.blocks.all.size(), "blocks' contacts");
  for (std::size_t i = 0; i < c.touching.size(); ++i) {
    const auto lanes = static_cast<std::int64_t>(s.blocks.all[i]->lane_count());
    for (const Touch& t : c.touching[i]) {
      check_state(t.cell >= 0 && t.cell < lanes && t.point >= 0 && t.point < k.points &&
                      t.collider < k.colliders,
                  "touching points");
    }
  }
  for (const InertialNode& n : c.inertia.nodes) {
    check_state(n.node >= 0 && n.node < k.nodes && n.collider >= 0 && n.collider < k.colliders,
                "inertial nodes");
  }
}

void check_faces(const MpmState& s) {
  const FaceContacts& f = s.faces;
  const std::size_t facets = f.block_of.size();
  check_state(f.motion.size() == facets && (f.listed.empty() || f.listed.size() == facets),
              "facets");
  const auto contacts = static_cast<std::int64_t>(f.all.size());
  for (const FaceContact& c : f.all) {
    check_state(c.facet >= 0 && static_cast<std::size_t>(c.facet) < facets && c.other >= -1 &&
                    c.other < static_cast<std::int64_t>(facets),
                "facets of contacts");
  }
  if (!f.all.empty()) {  // else they are what was left of those before
    check_begins(f.first_near, f.all.size(), f.near.size(), "contacts' neighbours");
    check_indices(f.near, 0, static_cast<std::int64_t>(facets), "contacts' neighbours");
  }
  check_indices(f.active, 0, contacts, "active contacts");
  for (const std::int32_t i : f.active) check_state(f.all[i].other >= 0, "active contacts");
}

void check_kept(const MpmState& s, const Known& k) {
  for (const KeptContact& kept : s.faces.kept) {
    check_state(kept.point >= 0 && kept.point < k.points && kept.other_body < k.bodies,
                "kept contacts");
  }
}

void check_anchors(const MpmState& s, const Known& k) {
  const AnchorFaces& a = s.anchors;
  const auto rows = static_cast<std::int64_t>(a.rows.size());
  for (const FaceRow& r : a.rows) {
    check_indices(r.node, 0, k.nodes, "anchors");
    check_state(r.anchor >= 0 && r.anchor < k.anchors, "anchors");
  }
  check_state(a.impulse.size() == a.rows.size() &&
                  (a.now.empty() || static_cast<std::int64_t>(a.now.size()) == k.anchors),
              "anchors");
  for (const FaceGroup& g : a.groups) {
    check_state(g.first >= 0 && g.count > 0 && g.count <= kLargestGroup &&
                    g.first + std::int64_t{g.count} <= rows && g.inverse >= 0 &&
                    g.inverse + std::int64_t{g.count} * g.count <=
                        static_cast<std::int64_t>(a.inverse.size()),
                "anchors");
  }
  for (const AnchorFaces::HeldNode& h : a.held) {
    check_state(h.node >= 0 && h.node < k.nodes && h.anchor >= 0 && h.anchor < k.anchors,
                "anchors");
  }
}

void check_edges(const MpmState& s) {
  check_sizes("edges", s.edges.pieces, s.edges.holds);
  for (const EdgeHold& h : s.edges.holds) {
    check_numbers(h.ahead, 2, "edges");
    check_numbers(h.slides, 2, "edges");
    check_state(h.stiffness >= 0 && h.stiffness < 1e30, "edges");
    check_state(h.place.body == h.swept.body && h.lets_go == 0, "edges");
    for (const EdgePlace* p : {&h.place, &h.swept}) {
      if (p->body == -1) continue;
      check_numbers(p->at, 1e3, "edges");
      check_state(p->body >= 0 && p->body < static_cast<std::int32_t>(s.bodies.size()) &&
                      s.bodies[p->body].point(p->site[0], p->site[1], p->site[2]) >= 0,
                  "edges");
    }
  }
}

void check_front(const MpmState& s, const Known& k) {
  const Front& f = s.front;
  for (int a = 0; a < 3; ++a) check_sizes("front", f.nodes, f.d[a], f.rate[a]);
  for (const FrontNode& n : f.nodes) {
    check_state(n.body >= 0 && n.body < k.bodies && n.node >= 0 && n.node < k.nodes &&
                    s.bodies[n.body].node(n.x, n.y, n.z) >= 0,
                "front");
  }
  for (const auto& bond : f.rim) check_state(bond.first >= 0 && bond.first < 3 * k.points, "front");
}

}  // namespace

void complete_block(Block& b) {
  constexpr int kMost = 1 << 15;
  check_state(b.nx > 0 && b.ny > 0 && b.nz > 0 && b.nx < kMost && b.ny < kMost && b.nz < kMost &&
                  !b.runs.empty() && !b.sides.empty(),
              "blocks");
  std::int64_t lane = 0;
  for (const Block::Run& r : b.runs) {
    check_state(r.lane == lane && r.count > 0 && r.x >= 0 && r.count <= b.nx - r.x && r.y >= 0 &&
                    r.y < b.ny,
                "blocks");
    lane += r.count;
  }
  for (const Block::Side& side : b.sides) {
    check_state(side.column >= 0 && side.count >= 0 && side.column + side.count <= b.nx + 2 &&
                    std::abs(side.x) < kMost,
                "blocks");
  }
  const std::size_t layers = b.nz + 2;
  check_state(8 * lane * b.nz <= static_cast<std::int64_t>(b.volume.size()), "blocks");
  lay_out(b);
  check_state(b.volume.size() == b.lane_count() && b.point.size() == b.lane_count() &&
                  b.node.size() == layers * b.plane,
              "blocks");
  check_numbers(b.volume, 1e30, "volumes");
  find_filled(b);
}

void complete_tissue(MpmState& s) {
  const Known k = known(s);
  check_state(std::isfinite(s.time) && std::isfinite(s.dt) && s.dt >= 0, "time");
  check_points(s, k);
  check_nodes(s, k);
  check_anchors(s, k);
  check_front(s, k);
  check_state(s.tore_at.empty() || static_cast<std::int64_t>(s.tore_at.size()) == k.bodies,
              "tears");
  check_indices(s.bridge_ends, 0, k.points, "tears");
  check_indices(s.debris, 0, k.points, "debris");
  check_indices(s.expected, 0, k.points, "points expected to part");
  check_blocks(s, k);
  check_kept(s, k);
  s.fields->follow(s.bodies, s.points);
  list_front_cells(s);
  mark_row_nodes(s.nodes.size(), s.anchors);
}

void complete_state(MpmState& s) {
  complete_tissue(s);
  const Known k = known(s);
  check_contacts(s, k);
  number_facets(s.faces, s.blocks);
  check_faces(s);
  check_edges(s);
  connect_forces(s.blocks, s.nodes.size());
  for (FaceContact& c : s.faces.all) find_nodes(s, c);
  index_active(s.faces);
  forget_near(s.contacts, s.blocks.all.size());
  s.inertial_index.assign(s.nodes.size(), -1);
  index_inertia(s);
  s.work.force.clear();
  s.work.force.resize(s.blocks.force_size);
}

}  // namespace tissue_sim
