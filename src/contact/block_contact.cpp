#include "contact/block_contact.h"

#include <algorithm>
#include <cmath>

#include "contact/facet_motion.h"
#include "cutting/bonds.h"

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
  return a.collider != b.collider ? a.collider < b.collider : a.lane < b.lane;
}

bool overlap(const Box& a, const Box& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

/// Weights at each of a cell's eight sub-positions.
struct SubWeights {
  AxisWeights of[8];
  SubWeights() {
    for (int s = 0; s < 8; ++s) {
      const float place[3] = {s & 1 ? 0.25f : -0.25f, s & 2 ? 0.25f : -0.25f,
                              s & 4 ? 0.25f : -0.25f};
      of[s] = AxisWeights(place);
    }
  }
};
const SubWeights kSubWeights;

}  // namespace

Box bounds(const Collider& c) {
  Box box;
  if (c.kind == Collider::kPlane) {
    box.min = Vec3::Constant(-1e6);
    box.max = Vec3(1e6, 1e6, c.position[2]);
    return box;
  }
  const float x0 = c.kind == Collider::kBlade ? -c.width : -c.radius;
  const float x1 = c.kind == Collider::kBlade ? 0 : c.radius;
  const float y = c.kind == Collider::kBlade ? 0.5f * c.thickness : c.radius;
  for (int i = 0; i < 8; ++i) {
    const float corner[3] = {i & 1 ? x1 : x0, i & 2 ? y : -y, i & 4 ? 0 : -c.length};
    float world[3];
    to_world(c, corner, world);
    const Vec3 w(world[0], world[1], world[2]);
    box.min = box.min.cwiseMin(w);
    box.max = box.max.cwiseMax(w);
  }
  return box;
}

void find_near_colliders(MpmState& state, const std::vector<Box>& reach, double duration) {
  Contacts& contacts = state.contacts;
  const int count = static_cast<int>(state.blocks.all.size());
  contacts.near.assign(count, {});
  contacts.touching.resize(count);
  state.cpu->for_each(count, [&](int i) {
    Box box = state.motion[i].box;
    const double margin = state.motion[i].speed * duration + 0.5 * state.scene.cell_size;
    box.min.array() -= margin;
    box.max.array() += margin;
    for (std::size_t c = 0; c < reach.size(); ++c) {
      if (overlap(box, reach[c])) contacts.near[i].push_back(static_cast<std::uint8_t>(c));
    }
    if (contacts.near[i].empty()) contacts.touching[i].clear();
  });
}

void list_contacts(MpmState& state) {
  Contacts& contacts = state.contacts;
  const std::vector<std::vector<Touch>> before = std::move(contacts.touching);
  contacts.touching.assign(state.blocks.all.size(), {});
  contacts.near.assign(state.blocks.all.size(), {});
  if (before.empty()) return;  // on a GPU
  std::vector<Touch> touches;
  for (std::size_t i = 0; i < state.blocks.all.size(); ++i) {
    const Blocks::Origin& origin = state.blocks.origin[i];
    touches.clear();
    for (int b = origin.begin; b < origin.end; ++b) {
      touches.insert(touches.end(), before[b].begin(), before[b].end());
    }
    if (touches.empty()) continue;
    std::sort(touches.begin(), touches.end(),
              [](const Touch& a, const Touch& b) { return a.point < b.point; });
    const Array<std::int32_t>& points = state.blocks.all[i]->point;
    for (std::size_t lane = 0; lane < points.size(); ++lane) {
      auto touch =
          std::lower_bound(touches.begin(), touches.end(), points[lane],
                           [](const Touch& t, std::int32_t point) { return t.point < point; });
      for (; touch != touches.end() && touch->point == points[lane]; ++touch) {
        contacts.touching[i].push_back(*touch);
        contacts.touching[i].back().lane = static_cast<std::int32_t>(lane);
      }
    }
    std::sort(contacts.touching[i].begin(), contacts.touching[i].end(), comes_before);
  }
}

void add_contact(MpmState& state, int index, float* force, std::vector<ColliderLoad>& loads) {
  Contacts& contacts = state.contacts;
  const std::vector<std::uint8_t>& near = contacts.near[index];
  if (near.empty()) return;
  const Block& block = *state.blocks.all[index];
  int material = std::max(0, block.material);
  ContactSpring unit = unit_spring(state.bodies[block.body], material);
  BlockScratch& scratch = state.scratch.local();
  const std::size_t lanes = block.lane_count();
  if (scratch.values.size() < 3 * lanes) scratch.values.resize(3 * lanes);
  if (scratch.lanes.size() < lanes) scratch.lanes.resize(lanes);
  float* x = scratch.values.data();
  state.kernels->positions(block, block_field(state, block), state.nodes.u, scratch, x);
  const std::vector<Touch>& before = contacts.touching[index];
  auto held = before.begin();
  std::vector<Touch> touching;
  for (const std::uint8_t c : near) {
    const Collider& collider = state.colliders[c];
    const Box box = bounds(collider);
    const float min[3] = {float(box.min[0]), float(box.min[1]), float(box.min[2])};
    const float max[3] = {float(box.max[0]), float(box.max[1]), float(box.max[2])};
    const int found = state.kernels->lanes_in_box(x, lanes, min, max, scratch.lanes.data());
    for (int f = 0; f < found; ++f) {
      const int lane = scratch.lanes[f];
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      if (collider.kind == Collider::kBlade && state.points.bonds[p] == kAllBonds) continue;
      const float at[3] = {x[lane], x[lanes + lane], x[2 * lanes + lane]};
      const Gap g = gap(collider, at);
      if (g.distance >= 0) continue;
      const int sub = lane / block.stride % 8,
                cell = lane / block.stride / 8 * block.plane + block.cell[lane % block.stride];
      const AxisWeights& weights = kSubWeights.of[sub];
      float v[3], push[3];
      value_at(CellField{state.nodes.v, CellNodes(block, cell)}, weights, v);
      Touch touch{lane, p, c, {}};
      while (held != before.end() && comes_before(*held, touch)) ++held;
      if (held != before.end() && !comes_before(touch, *held)) {
        touch = *held;
      } else {
        to_local(collider, at, touch.hold);
      }
      if (state.points.material_of(p) != material) {
        material = state.points.material_of(p);
        unit = unit_spring(state.bodies[block.body], material);
      }
      const float volume = block.volume[lane];
      contact_force(collider, g, {unit.stiffness * volume, unit.damping * volume}, at, v,
                    touch.hold, push);
      touching.push_back(touch);
      spread(block, cell, weights, push, force);
      ColliderLoad& load = loads[c];
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
  }
  // A point that no longer touches forgets where it was held.
  contacts.touching[index] = std::move(touching);
}

}  // namespace tissue_sim
