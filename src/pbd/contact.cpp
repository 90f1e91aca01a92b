// Contact with the ground and with tools: a constraint for each vertex that lies in one, and for
// the place of each triangle that lies deepest in a tip or at a rim, which pass between vertices;
// inelastic, with Coulomb friction. What acts on the tool is what its multipliers say.
#include "pbd/contact.h"

#include <algorithm>

#include "pbd/pbd_state.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr int kContactsOfPart = 1024;

/// Where it is, which is all that is asked of most.
void put_place(const Vertices& v, int i, Corner& c) {
  const std::size_t at = 4 * static_cast<std::size_t>(i);
  std::copy_n(&v.x[at], 4, c.x);
  std::copy_n(&v.moved[at], 3, c.moved);
}

void put_motion(const Vertices& v, int i, Corner& c) {
  const std::size_t at = 4 * static_cast<std::size_t>(i);
  std::copy_n(&v.predicted[at], 3, c.predicted);
  std::copy_n(&v.v[at], 3, c.v);
}

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

/// What a tip does to a triangle, as to Vertices. Whether it pushed.
bool push_triangle(State& s, const AtTip& t, float h, ColliderLoad& load) {
  Vertices& v = s.vertices;
  const Collider& tip = s.colliders[t.collider];
  Corner corner[3];
  for (int k = 0; k < 3; ++k) put_place(v, t.corner[k], corner[k]);
  TipPlace found;
  ContactPush push;
  if (!find_in_tip(tip, corner, s.mean_edge, found)) return false;
  for (int k = 0; k < 3; ++k) put_motion(v, t.corner[k], corner[k]);
  if (!push_out_of_tip(tip, found, h, corner, push)) return false;
  for (int k = 0; k < 3; ++k) {
    std::copy_n(corner[k].moved, 3, &v.moved[4 * static_cast<std::size_t>(t.corner[k])]);
    if (found.share[k] > 0) s.pushed[t.corner[k]] = 1;
  }
  for (int a = 0; a < 3; ++a) {
    load.force[a] += push.force[a];
    load.torque[a] += push.torque[a];
  }
  return true;
}

}  // namespace

std::vector<TipSweep> sweeps_of_tips(const std::vector<Collider>& begin,
                                     const std::vector<Collider>& end) {
  std::vector<TipSweep> sweeps;
  for (std::size_t c = 0; c < begin.size(); ++c) {
    if (!is_tip(begin[c])) continue;
    const Box from = bounds(begin[c]), to = bounds(end[c]);
    sweeps.emplace_back();
    for (int a = 0; a < 3; ++a) {
      sweeps.back().low[a] = std::min(from.min[a], to.min[a]);
      sweeps.back().high[a] = std::max(from.max[a], to.max[a]);
    }
    sweeps.back().begin = begin[c];
    sweeps.back().end = end[c];
    sweeps.back().collider = static_cast<std::int32_t>(c);
  }
  return sweeps;
}

void find_at_tips(State& s, const std::vector<TipSweep>& tips, double duration) {
  constexpr int kTrianglesOfPart = 4096;
  s.at_tips.clear();
  const auto triangles = static_cast<int>(s.triangles.size());
  std::vector<std::vector<AtTip>> found((triangles + kTrianglesOfPart - 1) / kTrianglesOfPart);
  for (const TipSweep& tip : tips) {
    s.cpu.for_each(static_cast<int>(found.size()), [&](int part) {
      found[part].clear();
      const int end = std::min(triangles, (part + 1) * kTrianglesOfPart);
      for (int i = part * kTrianglesOfPart; i < end; ++i) {
        Corner corner[3];
        for (int k = 0; k < 3; ++k) {
          put_place(s.vertices, s.triangles[i][k], corner[k]);
          put_motion(s.vertices, s.triangles[i][k], corner[k]);
        }
        if (!may_meet(tip, corner, s.mean_edge, duration)) continue;
        found[part].push_back({s.triangles[i], tip.collider});
      }
    });
    for (const auto& of_part : found) {
      s.at_tips.insert(s.at_tips.end(), of_part.begin(), of_part.end());
    }
  }
}

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
  for (int round = 0; round < kTipRounds; ++round) {
    bool any = false;
    for (const AtTip& t : s.at_tips) {
      if (!push_triangle(s, t, h, loads[t.collider])) continue;
      any = true;
      if (round == 0) loads[t.collider].points += 1;
    }
    if (!any) break;
  }
}

}  // namespace pbd
}  // namespace tissue_sim
