#include "mls/contact.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "mls/node_contact.h"
#include "mls/stop_tool.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr int kListLasts = 8;              // substeps
constexpr double kListMargin = 0.5;        // how much nearer than predicted either may come [edges]
constexpr double kFasterThanListed = 1.5;  // than when it was listed

bool comes_before(const MlsTouch& a, const MlsTouch& b) {
  return std::tie(a.node, a.collider) < std::tie(b.node, b.collider);
}

/// Whether entry e of node i leads along the surface to a neighbour: not through a cut, where
/// blades of scissors lie that have yet to close.
bool is_along_surface(const MlsState& s, std::int32_t i, std::int32_t e) {
  return s.outer[i] != 0 && s.outer[s.pairs.other[e]] != 0 && s.pairs.crossed[e] == 0;
}

MlsStopNode stop_node(const MlsState& s, std::int32_t i) {
  return {{s.place[4 * i] + s.u[4 * i], s.place[4 * i + 1] + s.u[4 * i + 1],
           s.place[4 * i + 2] + s.u[4 * i + 2]},
          s.edge[i],
          s.contact_stiffness[i]};
}

/// Stops a collider in the triangles of neighbours at the surface that the node is a corner of.
void stop_beside(const MlsState& s, std::int32_t i, const Collider& collider, int c, const Gap& g,
                 const MlsStopNode& node, float dt, float kick, MlsStop& stop) {
  struct Neighbour {
    std::int32_t number;
    MlsStopNode node;
    bool may;  ///< lie so deep that the collider is stopped on the way there
  };
  std::array<Neighbour, 64> near;
  std::size_t count = 0;
  bool any = false;
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1] && count < near.size(); ++e) {
    if (!is_along_surface(s, i, e)) continue;
    near[count] = {s.pairs.other[e], stop_node(s, s.pairs.other[e]), false};
    near[count].may = may_be_stopped(g, node, near[count].node);
    any = near[count++].may || any;
  }
  for (std::size_t y = 0; y < count && any; ++y) {
    for (std::size_t z = y + 1; z < count; ++z) {
      if (!near[y].may && !near[z].may) continue;
      const float *const Y = &s.place[4 * near[y].number], *const Z = &s.place[4 * near[z].number];
      const float d[3] = {Z[0] - Y[0], Z[1] - Y[1], Z[2] - Y[2]};
      if (!makes_triangle(d, near[y].node.edge, near[z].node.edge)) continue;
      stop_beside_node(collider, c, g, node, &s.v[4 * i], near[y].node, near[z].node, dt, kick,
                       stop);
    }
  }
}

bool overlap(const Box& a, const Box& b) {
  return (a.min.array() <= b.max.array()).all() && (b.min.array() <= a.max.array()).all();
}

}  // namespace

bool is_list_due(MlsState& state) {
  const bool due = state.until_list == 0;
  state.until_list = due ? kListLasts - 1 : state.until_list - 1;
  return due;
}

void list_near(MlsState& state, int group, float dt) {
  const int first = group * kMlsGroup, last = std::min(state.count(), first + kMlsGroup);
  Box box;
  double speed2 = 0, edge = 0, depth = 0;
  const auto add = [&](std::int32_t node) {
    const Vec3 x = state.position(node);
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  };
  for (int i = first; i < last; ++i) {
    add(i);
    speed2 = std::max(speed2, state.velocity(i).squaredNorm());
    edge = std::max<double>(edge, state.edge[i]);
    depth = std::max<double>(depth, state.place[4 * i + 3]);
  }
  Box wide = box;
  wide.min.array() -= kStopReach * edge;
  wide.max.array() += kStopReach * edge;
  const bool stops =
      std::any_of(state.colliders.begin(), state.colliders.end(),
                  [&](const Collider& c) { return is_stopped(c) && overlap(wide, bounds(c)); });
  for (int i = first; i < last && stops; ++i) {
    for (std::int32_t e = state.pairs.begin[i]; e < state.pairs.begin[i + 1]; ++e) {
      if (is_along_surface(state, i, e)) add(state.pairs.other[e]);
    }
  }
  MlsGroupContact& contact = state.contact[group];
  contact.near.clear();
  for (std::size_t c = 0; c < state.colliders.size(); ++c) {
    const Collider& collider = state.colliders[c];
    const double margin =
        depth + kListMargin * edge +
        kListLasts * kFasterThanListed * dt * (std::sqrt(speed2) + speed(collider));
    Box reach = bounds(collider);
    reach.min.array() -= margin;
    reach.max.array() += margin;
    if (overlap(box, reach)) contact.near.push_back(static_cast<std::uint8_t>(c));
  }
  if (contact.near.empty()) {
    contact.touching.clear();
    contact.loads.clear();
  }
}

bool add_contact(MlsState& state, int group, float dt, float kick, float* force, MlsStop* stops) {
  MlsGroupContact& contact = state.contact[group];
  if (contact.near.empty()) return false;
  contact.loads.assign(state.colliders.size(), {});
  std::fill_n(stops, kMlsGroup, no_stop());
  std::vector<MlsTouch> touching;
  auto held = contact.touching.begin();
  const int first = group * kMlsGroup, last = std::min(state.count(), first + kMlsGroup);
  for (int i = first; i < last; ++i) {
    const MlsStopNode node = stop_node(state, i);
    const float *const x = node.x, *const v = &state.v[4 * i];
    for (const std::uint8_t c : contact.near) {
      const Collider& collider = state.colliders[c];
      // The flats of a blade push where it has cut.
      const bool blade = collider.kind == Collider::kBlade;
      if (blade && state.outer[i] == 0) continue;
      Gap g = gap(collider, x);
      const float distance = g.distance;
      if (is_stopped(collider) && state.outer[i] != 0 && g.distance < kStopReach * node.edge) {
        MlsStop& stop = stops[i - first];
        stop_at_node(collider, c, g, node, v, dt, kick, stop);
        stop_beside(state, i, collider, c, g, node, dt, kick, stop);
      }
      // Nodes of a fresh cut lie at any distance from the blade: it does not push them apart.
      if (!blade) g.distance -= state.place[4 * i + 3];
      if (g.distance >= 0) continue;
      MlsTouch touch{i, c, {}};
      while (held != contact.touching.end() && comes_before(*held, touch)) ++held;
      if (held != contact.touching.end() && !comes_before(touch, *held)) {
        touch = *held;
      } else {
        to_local(collider, x, touch.hold);
      }
      const ContactSpring spring = node_spring(state, i);
      float push[3];
      contact_force(collider, g, spring, x, v, touch.hold, push);
      touching.push_back(touch);
      bear_spring(spring.stiffness, state.mass[i], c, dt, kick, stops[i - first]);
      ColliderLoad& load = contact.loads[c];
      load.push(collider, x, push, 1);
      load.count_inside(collider, distance);
      for (int a = 0; a < 3; ++a) force[4 * (i - first) + a] += push[a];
    }
  }
  contact.touching = std::move(touching);  // who no longer touches forgets where it was held
  return std::any_of(stops, stops + kMlsGroup, [](const MlsStop& s) { return s.collider >= 0; });
}

void move_stopping(MlsState& state, int group, std::int32_t i, const MlsStop& stop, float kick,
                   const float* force, float* dv) {
  float push[3], gravity[3];
  for (int a = 0; a < 3; ++a) gravity[a] = static_cast<float>(state.scene.gravity[a]);
  move_stopping(stop, state.mass[i], force, gravity, kick, dv, push);
  state.contact[group].loads[stop.collider].push(state.colliders[stop.collider],
                                                 stop_node(state, i).x, push, 0);
}

}  // namespace tissue_sim
