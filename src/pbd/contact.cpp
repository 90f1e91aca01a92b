// Contact with the ground and with tools: a constraint for each vertex that lies in one, and for
// the place of each triangle that lies deepest in a tip, which passes between vertices that are
// drawn apart; inelastic, with Coulomb friction. What acts on the tool is what its multipliers say.
#include "pbd/contact.h"

#include <algorithm>

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

/// Shares of a triangle's corners in its place nearest to x (Ericson 2005, 5.1.5).
Vec3 nearest_shares(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& x) {
  const Vec3 e = b - a, f = c - a;
  const double d1 = e.dot(x - a), d2 = f.dot(x - a);
  if (d1 <= 0 && d2 <= 0) return Vec3(1, 0, 0);
  const double d3 = e.dot(x - b), d4 = f.dot(x - b);
  if (d3 >= 0 && d4 <= d3) return Vec3(0, 1, 0);
  const double d5 = e.dot(x - c), d6 = f.dot(x - c);
  if (d6 >= 0 && d5 <= d6) return Vec3(0, 0, 1);
  const double of_c = d1 * d4 - d3 * d2, of_b = d5 * d2 - d1 * d6, of_a = d3 * d6 - d5 * d4;
  if (of_c <= 0 && d1 >= 0 && d3 <= 0) return Vec3(1 - d1 / (d1 - d3), d1 / (d1 - d3), 0);
  if (of_b <= 0 && d2 >= 0 && d6 <= 0) return Vec3(1 - d2 / (d2 - d6), 0, d2 / (d2 - d6));
  if (of_a <= 0 && d4 >= d3 && d5 >= d6) {
    const double share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return Vec3(0, 1 - share, share);
  }
  const double sum = of_a + of_b + of_c;
  return Vec3(of_a, of_b, of_c) / sum;
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
  Vec3 axis = end + least * up, share = Vec3::Zero(), place = axis;
  for (int turn = 0; turn < 8; ++turn) {
    share = nearest_shares(x[0], x[1], x[2], axis);
    place = share[0] * x[0] + share[1] * x[1] + share[2] * x[2];
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
  double mobility = 0;
  float at[3], moved[3] = {}, predicted[3] = {}, velocity[3] = {};
  for (int k = 0; k < 3; ++k) {
    const std::size_t i = 4 * static_cast<std::size_t>(t[k]);
    mobility += share[k] * share[k] * v.x[i + 3];
    for (int a = 0; a < 3; ++a) {
      const auto part = static_cast<float>(share[k]);
      moved[a] += part * v.moved[i + a];
      predicted[a] += part * v.predicted[i + a];
      velocity[a] += part * v.v[i + a];
    }
  }
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
