#include "mpm/mpm_state.h"

#include <algorithm>
#include <cmath>

#include "mpm/anchors/anchor_faces.h"
#include "mpm/contact/block_contact.h"
#include "mpm/contact/contact_inertia.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {

void make_mpm_state(const Scene& scene, NodeRange range, MpmState& state,
                    std::vector<std::string>* notes) {
  state.scene = scene;
  state.cpu = std::make_unique<Cpu>(scene.threads);
  state.bodies = make_lattice_bodies(scene, state.points, notes, range);
  state.whole_bonds = state.points.bonds;
  find_free_volumes(state);
  state.fields = std::make_unique<NodeFields>(state.bodies, state.points, state.nodes);
  find_face_links(scene, state, state.anchors);
  find_face_rows(state, state.anchors);
  for (const std::int32_t p : state.anchors.points) {
    if (state.points.anchored[p] == 0) state.points.anchored[p] = Points::kAtAnchor;
  }
  state.instructions = instruction_set();
  state.kernels = &block_kernels(state.instructions);
}

namespace {

constexpr int kRows = 32;  // moved at a time

/// Moves the nodes of a row on.
class MoveRow {
 public:
  MoveRow(MpmState& state, const NodeStep& step)
      : state_(state), update_{step, {}, {}, state.nodes.mass.data(), state.nodes.inv_mass.data()} {
    for (int a = 0; a < 3; ++a) {
      update_.u[a] = state.nodes.u[a].data();
      update_.v[a] = state.nodes.v[a].data();
    }
  }
  void operator()(int i) const {
    const NodeRow& row = state_.blocks.rows[i];
    state_.kernels->update_row(row, state_.blocks.row_parts.data() + row.first_part,
                               state_.work.force.data(), update_);
  }

 private:
  const MpmState& state_;
  UpdateNode update_;
};

}  // namespace

float substep(MpmState& state, float dt, std::vector<ColliderLoad>& loads,
              const std::vector<RigidMotion>& anchors) {
  Blocks& blocks = state.blocks;
  const int block_count = static_cast<int>(blocks.all.size());
  const std::size_t collider_count = state.colliders.size();
  state.work.block_loads.resize(block_count);
  FaceContacts& faces = state.faces;
  const bool list = is_list_due(state.contacts);
  if (list && !state.contacts.inertia.nodes.empty()) tidy_inertia(state, false);
  fit_inertia(state, dt);
  NodeStep step;
  step.dt = dt;
  step.kick = kick_of(state.dt, dt);
  step.keep = static_cast<float>(std::exp(-state.scene.damping * step.kick));
  for (int a = 0; a < 3; ++a) step.gravity[a] = static_cast<float>(state.scene.gravity[a]);
  const MoveRow move_row(state, step);
  SharedWork pushes(static_cast<int>(faces.between.size()), 32), work(block_count, 1),
      moves(static_cast<int>(blocks.rows.size()), kRows),
      holds(static_cast<int>(state.anchors.groups.size()), 64), changes(1, 1);
  std::vector<InertialNode>& inertial = state.contacts.inertia.nodes;
  // How many there are shows as late as after the changes.
  const auto part = [&](int i) {
    constexpr int kParts = 16;
    const std::size_t count = inertial.size();
    for (std::size_t n = count * i / kParts; n < count * (i + 1) / kParts; ++n) {
      resist_acceleration(inertial[n], step.keep, dt, state.nodes);
    }
  };
  SharedWork resists(16, 1);
  SharedWork front_cells(static_cast<int>(state.front.cells.size()), 8),
      front(front_moves(state.front), 1);
  const RigidMotion* const before = anchors.empty() ? nullptr : state.anchors.now.data();
  const RigidMotion* const after = anchors.empty() ? nullptr : anchors.data();
  const auto work_on_block = [&](int i) {
    const Block& block = *blocks.all[i];
    float* force = state.work.force.data() + block.force_offset;
    BlockField field = block_field(state, block);
    BlockScratch& scratch = state.scratch.local();
    if (!faces.active.empty() && faces.first_within[i] < faces.first_within[i + 1]) {
      push_faces_within(state, i, dt, state.kernels->gather(block, state.nodes.u, scratch));
      field.has_nodes = true;
    }
    state.kernels->forces(block, field, scratch, force);
    state.work.block_loads[i].assign(collider_count, {});
    if (list) list_near_cells(state, i, dt);
    add_contact(state, i, dt, force, state.work.block_loads[i]);
    if (faces.active.empty()) return;
    pushes.wait();
    add_face_contacts(state, i, force);
  };
  state.cpu->on_each_thread([&] {
    pushes.help([&](int i) { push_faces(state, faces.all[faces.between[i]], dt); });
    work.help([&](int i) { work_on_block(blocks.by_cost[i]); });
    front_cells.help([&](int i) { work_on_front_cell(state, i); });
    work.wait();
    front_cells.wait();
    changes.help([&](int) { change_inertia(state); });
    changes.wait();
    moves.help(move_row);
    const bool has_front = !state.front.cells.empty();
    if (state.anchors.groups.empty() && inertial.empty() && !has_front) return;
    moves.wait();
    if (has_front) {
      front.help([&](int i) { move_front(state, step, i); });
      front.wait();
    }
    resists.help(part);
    if (state.anchors.groups.empty()) return;
    resists.wait();
    holds.help([&](int i) {
      calm_swings(state, i, dt);
      if (is_beside_tools(state, i)) return hold_beside_tools(state, i, dt, before, after);
      hold_group(state.anchors, i, dt, before, after, state.nodes);
    });
  });
  if (after != nullptr) {
    move_held(state.anchors, dt, before, after, state.nodes);
    state.anchors.now = anchors;
  }
  add_inertial_loads(state, step.kick, loads);
  for (const auto& of_block : state.work.block_loads) {
    for (std::size_t c = 0; c < of_block.size(); ++c) loads[c].add(of_block[c]);
  }
  state.dt = dt;
  return step.kick;
}

void move_nodes(MpmState& state, const NodeStep& step) {
  state.cpu->for_each(static_cast<int>(state.blocks.rows.size()), MoveRow(state, step), kRows);
  state.cpu->for_each(front_moves(state.front), [&](int i) { move_front(state, step, i); });
}

}  // namespace tissue_sim
