#include "mpm/contact/block_contact.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "contact/contact_spring.h"
#include "mpm/contact/facet_motion.h"
#include "mpm/lattice/bonds.h"
#include "mpm/lattice/cell_points.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

/// Spring of a point of unit volume; stiffness and damping both grow with the volume.
ContactSpring unit_spring(const LatticeBody& body, int material) {
  const Material& m = body.materials[material];
  const auto modulus = static_cast<float>(lame_lambda(m) + 2 * lame_mu(m));
  const float edge = 0.5f * static_cast<float>(body.cell_size);
  return contact_spring(modulus, static_cast<float>(m.density), edge, 1.0f);
}

bool comes_before(const Touch& a, const Touch& b) {
  return std::tie(a.collider, a.cell, a.sub) < std::tie(b.collider, b.cell, b.sub);
}

/// The place of a point in its cell: x + 2 y + 4 z.
int sub_position(const Points::Site& site) {
  return (site.x & 1) + 2 * (site.y & 1) + 4 * (site.z & 1);
}

/// Lane of the first point of the cell in which the block has a point, -1 where it has it not.
int first_lane(const Block& block, std::int32_t point, const Points::Site& site) {
  const int y = site.y / 2 - block.y, z = site.z / 2 - block.z;
  if (z < 0 || z >= block.nz) return -1;
  for (const Block::Run& run : block.runs) {
    const int i = site.x / 2 - block.cell_x(run.x), lane = 8 * z * block.stride + run.lane + i;
    if (run.y == y && i >= 0 && i < run.count &&
        block.point[lane + sub_position(site) * block.stride] == point) {
      return lane;
    }
  }
  return -1;
}

bool overlap(const Box& a, const Box& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

/// Substeps between two lists of the cells near colliders, and how much nearer than foreseen either
/// may come in that time [cells].
constexpr int kListLasts = 8;
constexpr double kListMargin = 0.5;

/// How much nearer a block's points and a collider may come in a substep [m].
double approach(const MpmState& state, int block, const Collider& collider, float dt) {
  return kListMargin * state.scene.cell_size / kListLasts +
         (state.motion[block].speed + speed(collider)) * dt;
}

}  // namespace

void find_near_colliders(MpmState& state, const std::vector<Box>& reach, double duration,
                         const std::vector<BlockMotion>& before) {
  Contacts& contacts = state.contacts;
  const int count = static_cast<int>(state.blocks.all.size());
  contacts.near.assign(count, {});
  contacts.cells.assign(count, {});
  contacts.touching.resize(count);
  contacts.until_list = 0;
  state.cpu->for_each(count, [&](int i) {
    Box box = state.motion[i].box;
    if (!before.empty()) {
      box.min = box.min.cwiseMin(before[i].box.min);
      box.max = box.max.cwiseMax(before[i].box.max);
    }
    const double margin = state.motion[i].speed * duration + 0.5 * state.scene.cell_size;
    box.min.array() -= margin;
    box.max.array() += margin;
    for (std::size_t c = 0; c < reach.size(); ++c) {
      if (overlap(box, reach[c])) contacts.near[i].push_back(static_cast<std::uint8_t>(c));
    }
    if (contacts.near[i].empty()) contacts.touching[i].clear();
  });
}

bool came_unforeseen(const MpmState& state, const std::vector<Box>& reach) {
  for (std::size_t i = 0; i < state.motion.size(); ++i) {
    const std::vector<std::uint8_t>& near = state.contacts.near[i];
    for (std::size_t c = 0; c < reach.size(); ++c) {
      if (!overlap(state.motion[i].box, reach[c])) continue;
      if (std::find(near.begin(), near.end(), c) == near.end()) return true;
    }
  }
  return false;
}

void list_contacts(MpmState& state) {
  Contacts& contacts = state.contacts;
  const std::vector<std::vector<Touch>> before = std::move(contacts.touching);
  contacts.touching.assign(state.blocks.all.size(), {});
  contacts.near.assign(state.blocks.all.size(), {});
  contacts.cells.assign(state.blocks.all.size(), {});
  if (before.empty()) return;  // on a GPU
  for (std::size_t i = 0; i < state.blocks.all.size(); ++i) {
    const Block& block = *state.blocks.all[i];
    std::vector<Touch>& touches = contacts.touching[i];
    for (int b = state.blocks.origin[i].begin; b < state.blocks.origin[i].end; ++b) {
      for (Touch touch : before[b]) {
        const Points::Site& site = state.points.site[touch.point];
        touch.cell = first_lane(block, touch.point, site);
        if (touch.cell < 0) continue;
        touch.sub = static_cast<std::uint8_t>(sub_position(site));
        touches.push_back(touch);
      }
    }
    std::sort(touches.begin(), touches.end(), comes_before);
  }
}

bool is_list_due(Contacts& contacts) {
  const bool due = contacts.until_list == 0;
  contacts.until_list = due ? kListLasts - 1 : contacts.until_list - 1;
  return due;
}

void list_near_cells(MpmState& state, int index, float dt) {
  std::vector<NearCell>& cells = state.contacts.cells[index];
  cells.clear();
  if (state.contacts.near[index].empty()) return;
  const Block& block = *state.blocks.all[index];
  const LatticeBody& body = state.bodies[block.body];
  BlockScratch& scratch = state.scratch.local();
  const std::size_t lanes = block.lane_count();
  if (scratch.values.size() < 3 * lanes) scratch.values.resize(3 * lanes);
  if (scratch.lanes.size() < lanes) scratch.lanes.resize(lanes);
  float* x = scratch.values.data();
  state.kernels->positions(block, block_field(state, block), state.nodes.u, scratch, x);
  std::vector<std::uint8_t> points(static_cast<std::size_t>(block.nz) * block.stride);  // of cells
  for (const std::uint8_t c : state.contacts.near[index]) {
    const Collider& collider = state.colliders[c];
    const double margin = kListLasts * approach(state, index, collider, dt);
    const Box box = bounds(collider);
    float min[3], max[3];
    for (int a = 0; a < 3; ++a) {
      min[a] = static_cast<float>(box.min[a] - margin);
      max[a] = static_cast<float>(box.max[a] + margin);
    }
    std::fill(points.begin(), points.end(), std::uint8_t{0});
    const int found = state.kernels->lanes_in_box(x, lanes, min, max, scratch.lanes.data());
    for (int f = 0; f < found; ++f) {
      const int lane = scratch.lanes[f];
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      // The flats of a blade push where it has cut.
      if (collider.kind == Collider::kBlade && state.points.bonds[p] == kAllBonds) continue;
      const float at[3] = {x[lane], x[lanes + lane], x[2 * lanes + lane]};
      // Where the flats of a blade end, its gap does: there the box must do.
      if (collider.kind != Collider::kBlade && gap(collider, at).distance > margin) continue;
      const int row = lane / block.stride;
      points[row / 8 * block.stride + lane % block.stride] |= 1u << row % 8;
    }
    for (int z = 0, i = 0; z < block.nz; ++z) {
      for (int lane = 0; lane < block.stride; ++lane, ++i) {
        if (points[i] == 0) continue;
        const int node = z * block.plane + block.cell[lane];
        const Vec3 middle = reference_place(body, block, node, {});
        cells.push_back({z * 8 * block.stride + lane,
                         node,
                         c,
                         points[i],
                         {static_cast<float>(middle[0]), static_cast<float>(middle[1]),
                          static_cast<float>(middle[2])}});
      }
    }
  }
}

void add_contact(MpmState& state, int index, float dt, float* force,
                 std::vector<ColliderLoad>& loads) {
  Contacts& contacts = state.contacts;
  const Block& block = *state.blocks.all[index];
  const LatticeBody& body = state.bodies[block.body];
  const auto quarter = static_cast<float>(0.25 * body.cell_size);
  int material = std::max(0, block.material);
  ContactSpring unit = unit_spring(body, material);
  auto held = contacts.touching[index].begin();
  const auto held_end = contacts.touching[index].end();
  std::vector<Touch> touching;
  for (NearCell& cell : contacts.cells[index]) {
    if (cell.clear > 0) {
      --cell.clear;
      continue;
    }
    const Collider& collider = state.colliders[cell.collider];
    ColliderLoad& load = loads[cell.collider];
    const CellNodes nodes(block, cell.node);
    Vec<4> u[8], v[8], pushes[8];
    values_at_points(state.nodes.u, nodes, u);
    bool touches = false;
    float clear = std::numeric_limits<float>::max();
    for (unsigned points = cell.points; points != 0; points &= points - 1) {
      const int s = __builtin_ctz(points), lane = cell.lane + s * block.stride;
      const float at[3] = {cell.middle[0] + (s & 1 ? quarter : -quarter) + u[s][0],
                           cell.middle[1] + (s & 2 ? quarter : -quarter) + u[s][1],
                           cell.middle[2] + (s & 4 ? quarter : -quarter) + u[s][2]};
      const Gap g = gap(collider, at);
      if (g.distance >= 0) {
        clear = std::min(clear, clearance(collider, at));
        continue;
      }
      if (!touches) {
        touches = true;
        values_at_points(state.nodes.v, nodes, v);
        std::fill_n(pushes, 8, Vec<4>{});
      }
      const std::int32_t p = block.point[lane];
      Touch touch{cell.lane, p, static_cast<std::uint8_t>(s), cell.collider, {}};
      while (held != held_end && comes_before(*held, touch)) ++held;
      if (held != held_end && !comes_before(touch, *held)) {
        touch = *held;
      } else {
        to_local(collider, at, touch.hold);
      }
      if (state.points.material_of(p) != material) {
        material = state.points.material_of(p);
        unit = unit_spring(body, material);
      }
      const float volume = block.volume[lane], velocity[3] = {v[s][0], v[s][1], v[s][2]};
      float push[3];
      contact_force(collider, g, {unit.stiffness * volume, unit.damping * volume}, at, velocity,
                    touch.hold, push);
      touching.push_back(touch);
      pushes[s] = Vec<4>{push[0], push[1], push[2], 0.0f};
      load.points += 1;
      double arm[3];
      for (int a = 0; a < 3; ++a) {
        load.force[a] -= push[a];
        arm[a] = static_cast<double>(at[a]) - collider.position[a];
      }
      for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, d = (a + 2) % 3;
        load.torque[a] -= arm[b] * push[d] - arm[d] * push[b];
      }
    }
    if (touches) {
      spread(block, cell.node, pushes, force);
    } else {
      const double nearer = approach(state, index, collider, dt);
      cell.clear = static_cast<std::uint8_t>(std::min<double>(kListLasts, clear / nearer));
    }
  }
  // A point that no longer touches forgets where it was held.
  contacts.touching[index] = std::move(touching);
}

}  // namespace tissue_sim
