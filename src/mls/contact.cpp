#include "mls/contact.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "mls/node_contact.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace {

constexpr int kListLasts = 8;              // substeps
constexpr double kListMargin = 0.5;        // how much nearer than predicted either may come [edges]
constexpr double kFasterThanListed = 1.5;  // than when it was listed

bool comes_before(const MlsTouch& a, const MlsTouch& b) {
  return std::tie(a.node, a.collider) < std::tie(b.node, b.collider);
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
  for (int i = first; i < last; ++i) {
    const Vec3 x = state.position(i);
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
    speed2 = std::max(speed2, state.velocity(i).squaredNorm());
    edge = std::max<double>(edge, state.edge[i]);
    depth = std::max<double>(depth, state.place[4 * i + 3]);
  }
  MlsGroupContact& contact = state.contact[group];
  contact.near.clear();
  for (std::size_t c = 0; c < state.colliders.size(); ++c) {
    const Collider& collider = state.colliders[c];
    const double margin =
        depth + kListMargin * edge +
        kListLasts * kFasterThanListed * dt * (std::sqrt(speed2) + speed(collider));
    Box wide = bounds(collider);
    wide.min.array() -= margin;
    wide.max.array() += margin;
    if (overlap(box, wide)) contact.near.push_back(static_cast<std::uint8_t>(c));
  }
  if (contact.near.empty()) {
    contact.touching.clear();
    contact.loads.clear();
  }
}

void add_contact(MlsState& state, int group, float* force) {
  MlsGroupContact& contact = state.contact[group];
  if (contact.near.empty()) return;
  contact.loads.assign(state.colliders.size(), {});
  std::vector<MlsTouch> touching;
  auto held = contact.touching.begin();
  const int first = group * kMlsGroup, last = std::min(state.count(), first + kMlsGroup);
  for (int i = first; i < last; ++i) {
    const float x[3] = {state.place[4 * i] + state.u[4 * i],
                        state.place[4 * i + 1] + state.u[4 * i + 1],
                        state.place[4 * i + 2] + state.u[4 * i + 2]};
    for (const std::uint8_t c : contact.near) {
      const Collider& collider = state.colliders[c];
      // The flats of a blade push where it has cut.
      const bool blade = collider.kind == Collider::kBlade;
      if (blade && state.outer[i] == 0) continue;
      Gap g = gap(collider, x);
      const float distance = g.distance;
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
      contact_force(collider, g, spring, x, &state.v[4 * i], touch.hold, push);
      touching.push_back(touch);
      ColliderLoad& load = contact.loads[c];
      load.push(collider, x, push, 1);
      load.count_inside(collider, distance);
      for (int a = 0; a < 3; ++a) force[4 * (i - first) + a] += push[a];
    }
  }
  contact.touching = std::move(touching);  // who no longer touches forgets where it was held
}

}  // namespace tissue_sim
