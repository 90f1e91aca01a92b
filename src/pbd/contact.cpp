// Contact with the ground and with tools: a constraint for each vertex that lies in one, inelastic,
// with Coulomb friction; what acts on the tool is what its multipliers say.
#include "pbd/contact.h"

#include "pbd/pbd_state.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kContactsOfPart = 1024;

struct Contacts {
  const Collider* colliders;
  const Box* boxes;
  int count;
  float h;
  const float* x;
  float* moved;
  const float *predicted, *v;
  const std::vector<double>& mass;
  std::uint8_t* pushed;

  void project(int i, ColliderLoad* loads) const {
    if (x[4 * i + 3] == 0) return;
    RoundedPlace place = place_of(x + 4 * i, moved + 4 * i);
    const float* at = place.at;
    for (int c = 0; c < count; ++c) {
      const Collider& collider = colliders[c];
      if (collider.kind == Collider::kPlane) {
        if (at[2] >= collider.position[2]) continue;
      } else {
        const Box& box = boxes[c];
        if (at[0] < box.min.x() || at[0] > box.max.x() || at[1] < box.min.y() ||
            at[1] > box.max.y() || at[2] < box.min.z() || at[2] > box.max.z()) {
          continue;
        }
      }
      const Gap g = gap_of(collider, place);
      if (!(g.distance < 0)) continue;
      push(i, collider, g, at, loads[c]);
      pushed[i] = 1;
      place = place_of(x + 4 * i, moved + 4 * i);
    }
  }

  void push(int i, const Collider& collider, const Gap& g, const float* at,
            ColliderLoad& load) const {
    const ContactPush push = push_out(collider, g, h, mass[i], predicted + 4 * i, v + 4 * i, at,
                                      x[4 * i + 3], moved + 4 * i);
    for (int a = 0; a < 3; ++a) {
      load.force[a] += push.force[a];
      load.torque[a] += push.torque[a];
    }
    load.points += 1;
    load.count_inside(collider, push.distance);
  }
};

}  // namespace

void project_contacts(State& s, float h, std::vector<ColliderLoad>& loads) {
  const int count = static_cast<int>(s.colliders.size());
  if (count == 0) return;
  std::vector<Box> boxes;
  for (const Collider& c : s.colliders) boxes.push_back(bounds(c));
  const Contacts contacts{s.colliders.data(),
                          boxes.data(),
                          count,
                          h,
                          s.vertices.x.data(),
                          s.vertices.moved.data(),
                          s.vertices.predicted.data(),
                          s.vertices.v.data(),
                          s.vertices.mass,
                          s.pushed.data()};
  const int n = s.vertices.size(), parts = (n + kContactsOfPart - 1) / kContactsOfPart;
  std::vector<ColliderLoad> of_parts(static_cast<std::size_t>(parts) * count);
  s.cpu.for_each(parts, [&](int part) {
    const int end = std::min(n, (part + 1) * kContactsOfPart);
    for (int i = part * kContactsOfPart; i < end; ++i) {
      contacts.project(i, &of_parts[static_cast<std::size_t>(part) * count]);
    }
  });
  for (int part = 0; part < parts; ++part) {
    for (int c = 0; c < count; ++c) {
      loads[c].add(of_parts[static_cast<std::size_t>(part) * count + c]);
    }
  }
}

}  // namespace pbd
}  // namespace tissue_sim
