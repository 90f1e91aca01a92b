// Contact with the ground and with tools: a constraint for each vertex that lies in one, and for
// the place of each triangle that lies deepest in a tip, which passes between vertices that are
// drawn apart; inelastic, with Coulomb friction. What acts on the tool is what its multipliers say.
#include "pbd/contact.h"

#include <algorithm>

#include "geometry/nearest_surface.h"
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

/// So deep a triangle may lie in a tip before it is pushed, beside its corners: a mesh that fits
/// the tip does, for its triangles are chords [m].
float chord(float edge, float radius) { return fminf(edge * edge / (8 * radius), 0.25f * radius); }

/// Shares of a triangle's corners in a place on it.
Vec3 shares_of(const Vec3& place, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  const double n2 = n.squaredNorm() + 1e-300;
  const double of_b = (place - a).cross(c - a).dot(n) / n2;
  const double of_c = (b - a).cross(place - a).dot(n) / n2;
  return Vec3(1 - of_b - of_c, of_b, of_c).cwiseMax(0).cwiseMin(1);
}

/// Pushes the place of a triangle that lies deepest in a tip out of it, as push_out() a vertex.
void push_triangle(State& s, const Triangle& t, const Collider& tip, float h, ColliderLoad& load) {
  Vertices& v = s.vertices;
  Vec3 x[3];
  for (int k = 0; k < 3; ++k) x[k] = v.position(t[k]);
  // The tip's axis and the triangle: each other's nearest place in turn.
  const Vec3 end(tip.position[0], tip.position[1], tip.position[2]);
  const Vec3 up = -Vec3(tip.rotation[2], tip.rotation[5], tip.rotation[8]);
  const double least = tip.radius, most = std::max(tip.radius, tip.length);
  Vec3 axis = end + least * up, place = axis;
  for (int turn = 0; turn < 8; ++turn) {
    place = on_triangle(axis, x[0], x[1], x[2]);
    const Vec3 next = end + std::min(most, std::max(least, (place - end).dot(up))) * up;
    if ((next - axis).norm() < 1e-3 * least) break;
    axis = next;
  }
  const Vec3 off = place - axis;
  const double distance = off.norm();
  const double allowed = chord(static_cast<float>(s.mean_edge), tip.radius);
  Gap g;
  g.distance = static_cast<float>(distance - tip.radius + allowed);
  if (!(g.distance < 0) || !(distance > 0)) return;
  // From within it meets what it has pierced: that is for vertices to get off.
  if ((x[1] - x[0]).cross(x[2] - x[0]).dot(off) > 0) return;
  const Vec3 share = shares_of(place, x[0], x[1], x[2]);
  double mobility = 0, farthest = 0;  // no vertex goes farther than the place, as in Touch
  float at[3], moved[3] = {}, predicted[3] = {}, velocity[3] = {};
  for (int k = 0; k < 3; ++k) {
    const std::size_t i = 4 * static_cast<std::size_t>(t[k]);
    mobility += share[k] * share[k] * v.x[i + 3];
    farthest = std::max(farthest, share[k] * v.x[i + 3]);
    for (int a = 0; a < 3; ++a) {
      const auto part = static_cast<float>(share[k]);
      moved[a] += part * v.moved[i + a];
      predicted[a] += part * v.predicted[i + a];
      velocity[a] += part * v.v[i + a];
    }
  }
  mobility = std::max(mobility, farthest);
  if (!(mobility > 0)) return;
  for (int a = 0; a < 3; ++a) {
    at[a] = static_cast<float>(place[a]);
    g.normal[a] = static_cast<float>(off[a] / distance);
  }
  const float before[3] = {moved[0], moved[1], moved[2]};
  const ContactPush push = push_out(tip, g, h, 1 / mobility, predicted, velocity, at,
                                    static_cast<float>(mobility), moved);
  for (int k = 0; k < 3; ++k) {
    const std::size_t i = 4 * static_cast<std::size_t>(t[k]);
    const auto by = static_cast<float>(share[k] * v.x[i + 3] / mobility);
    for (int a = 0; a < 3; ++a) v.moved[i + a] += by * (moved[a] - before[a]);
    if (share[k] > 0) s.pushed[t[k]] = 1;
  }
  for (int a = 0; a < 3; ++a) {
    load.force[a] += push.force[a];
    load.torque[a] += push.torque[a];
  }
  load.points += 1;
}

bool is_tip(const Collider& c) { return c.kind == Collider::kCapsule; }

}  // namespace

void find_at_tips(State& s, const std::vector<Collider>& begin, const std::vector<Collider>& end,
                  double duration) {
  s.at_tips.clear();
  Vertices& v = s.vertices;
  for (std::size_t c = 0; c < begin.size(); ++c) {
    if (!is_tip(begin[c])) continue;
    const Box from = bounds(begin[c]), to = bounds(end[c]);
    const Vec3 low = from.min.cwiseMin(to.min), high = from.max.cwiseMax(to.max);
    for (std::size_t k = 0; k < s.triangles.size(); ++k) {
      Box box;
      double fastest = 0;
      for (const std::int32_t i : s.triangles[k]) {
        const Vec3 x = v.position(i);
        box.min = box.min.cwiseMin(x);
        box.max = box.max.cwiseMax(x);
        fastest = std::max(fastest, v.velocity(i).squaredNorm());
      }
      const double far = s.mean_edge + 2 * std::sqrt(fastest) * duration;
      if ((low - box.max).maxCoeff() > far || (box.min - high).maxCoeff() > far) continue;
      s.at_tips.push_back({static_cast<std::int32_t>(k), static_cast<std::int32_t>(c)});
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
  for (const auto& [triangle, c] : s.at_tips) {
    push_triangle(s, s.triangles[triangle], s.colliders[c], h, loads[c]);
  }
}

}  // namespace pbd
}  // namespace tissue_sim
