// Contact of triangles with tools, where these have sunk in between vertices: a mesh that is drawn
// over a tip must not let it through, however far its vertices are apart by then.
#include <algorithm>
#include <array>
#include <cmath>

#include "pbd/pbd_state.h"
#include "tools/frame_colliders.h"

namespace tissue_sim {
namespace pbd {
namespace {

constexpr double kMaySink = 0.125;  // of the mean edge of the surface
constexpr int kSearchSteps = 4;     // towards the deepest place of a triangle

struct SunkPlace {
  float share[3];  // of the corners
  float at[3];
  Gap gap;
};

SunkPlace place_in(const Collider& collider, const float* const (&corner)[3],
                   const float (&share)[3]) {
  SunkPlace p;
  for (int k = 0; k < 3; ++k) p.share[k] = share[k];
  for (int a = 0; a < 3; ++a) {
    p.at[a] = share[0] * corner[0][a] + share[1] * corner[1][a] + share[2] * corner[2][a];
  }
  p.gap = gap(collider, p.at);
  return p;
}

/// The nearest place of a triangle to a point (Ericson 2004, section 5.1.5), by shares.
void nearest_shares(const float* const (&corner)[3], const float (&to)[3], float (&share)[3]) {
  float ab[3], ac[3], ap[3];
  for (int a = 0; a < 3; ++a) {
    ab[a] = corner[1][a] - corner[0][a];
    ac[a] = corner[2][a] - corner[0][a];
    ap[a] = to[a] - corner[0][a];
  }
  const auto dot = [](const float* p, const float* q) {
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
  };
  const float bb = dot(ab, ab), bc = dot(ab, ac), cc = dot(ac, ac), pb = dot(ap, ab),
              pc = dot(ap, ac), det = bb * cc - bc * bc;
  const auto set = [&share](float v, float w) { share[0] = 1 - v - w, share[1] = v, share[2] = w; };
  if (det > 1e-12f * bb * cc) {
    const float v = (cc * pb - bc * pc) / det, w = (bb * pc - bc * pb) / det;
    if (v >= 0 && w >= 0 && v + w <= 1) return set(v, w);
  }
  float best = 1e30f;
  for (int k = 0; k < 3; ++k) {  // else on an edge
    const float *p = corner[k], *q = corner[(k + 1) % 3];
    float way = 0, length = 0;
    for (int a = 0; a < 3; ++a) {
      way += (to[a] - p[a]) * (q[a] - p[a]);
      length += (q[a] - p[a]) * (q[a] - p[a]);
    }
    const float t = length > 0 ? std::min(1.0f, std::max(0.0f, way / length)) : 0;
    float d2 = 0;
    for (int a = 0; a < 3; ++a) {
      const float d = p[a] + t * (q[a] - p[a]) - to[a];
      d2 += d * d;
    }
    if (d2 >= best) continue;
    best = d2;
    share[k] = 1 - t, share[(k + 1) % 3] = t, share[(k + 2) % 3] = 0;
  }
}

SunkPlace deepest(const Collider& collider, const float* const (&corner)[3]) {
  const float third = 1.0f / 3;
  SunkPlace best = place_in(collider, corner, {third, third, third}), now = best;
  const bool is_edged = collider.kind == Collider::kPunch || collider.kind == Collider::kPlate;
  const float round = is_edged ? collider.edge : collider.radius;
  for (int step = 0; step < kSearchSteps; ++step) {
    // The middle of what is round about the tool there, and the triangle's place nearest to it.
    float to[3], share[3];
    for (int a = 0; a < 3; ++a) {
      to[a] = now.at[a] - std::max(0.0f, now.gap.distance + round) * now.gap.normal[a];
    }
    nearest_shares(corner, to, share);
    now = place_in(collider, corner, share);
    if (!(now.gap.distance < best.gap.distance)) break;
    best = now;
  }
  return best;
}

}  // namespace

void list_near_triangles(State& s, const std::vector<Box>& reach, double time) {
  s.near_triangles.clear();
  const Vertices& v = s.vertices;
  std::vector<Box> boxes;
  for (std::size_t c = 1; c < reach.size(); ++c) {  // the first is the ground
    if ((reach[c].min.array() <= reach[c].max.array()).all()) boxes.push_back(reach[c]);
  }
  if (boxes.empty()) return;
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    Box box;
    double fastest2 = 0;
    for (const std::int32_t i : s.triangles[t]) {
      const Vec3 x = v.position(i);
      box.min = box.min.cwiseMin(x);
      box.max = box.max.cwiseMax(x);
      fastest2 = std::max(fastest2, v.velocity(i).squaredNorm());
    }
    const double margin = 1.5 * std::sqrt(fastest2) * time + 0.5 * s.mean_edge;
    for (const Box& r : boxes) {
      if ((box.min.array() - margin > r.max.array()).any() ||
          (box.max.array() + margin < r.min.array()).any()) {
        continue;
      }
      s.near_triangles.push_back(static_cast<std::int32_t>(t));
      break;
    }
  }
}

void project_triangles(State& s, float h, std::vector<ColliderLoad>& loads) {
  if (s.near_triangles.empty()) return;
  const auto may = static_cast<float>(kMaySink * s.mean_edge);
  std::vector<Box> boxes;
  for (const Collider& c : s.colliders) boxes.push_back(bounds(c));
  Vertices& v = s.vertices;
  for (const std::int32_t t : s.near_triangles) {  // in order: few touch
    const Triangle& vertex = s.triangles[t];
    float* x[3];
    for (int k = 0; k < 3; ++k) x[k] = &v.x[4 * vertex[k]];
    const float* const corner[3] = {x[0], x[1], x[2]};
    for (std::size_t c = 0; c < s.colliders.size(); ++c) {
      const Collider& collider = s.colliders[c];
      if (collider.kind == Collider::kPlane || collider.kind == Collider::kBlade) continue;
      bool is_near = true;
      for (int a = 0; a < 3 && is_near; ++a) {
        const auto [low, high] = std::minmax({x[0][a], x[1][a], x[2][a]});
        is_near = low <= boxes[c].max[a] && high >= boxes[c].min[a];
      }
      if (!is_near) continue;
      const SunkPlace p = deepest(collider, corner);
      const float deep = -p.gap.distance - may;
      if (!(deep > 0)) continue;
      float moves = 0;  // w^2 / m; the fourth number of a place is 1 / m
      for (int k = 0; k < 3; ++k) moves += p.share[k] * p.share[k] * x[k][3];
      if (!(moves > 0)) continue;
      double arm[3], on[3];
      for (int a = 0; a < 3; ++a) {
        arm[a] = static_cast<double>(p.at[a]) - collider.position[a];
        on[a] = 0;
      }
      for (int k = 0; k < 3; ++k) {
        if (x[k][3] == 0) continue;
        const float step = deep * p.share[k] * x[k][3] / moves;
        const double weight = v.mass[vertex[k]] / (static_cast<double>(h) * h);
        for (int a = 0; a < 3; ++a) {
          const float was = x[k][a];
          x[k][a] += step * p.gap.normal[a];
          on[a] += weight * (x[k][a] - was);  // as it was rounded
        }
        if (step > 0) s.pushed[vertex[k]] = 1;
      }
      for (int a = 0; a < 3; ++a) {
        const int b = (a + 1) % 3, d = (a + 2) % 3;
        loads[c].force[a] -= on[a];
        loads[c].torque[a] -= arm[b] * on[d] - arm[d] * on[b];
      }
    }
  }
}

}  // namespace pbd
}  // namespace tissue_sim
