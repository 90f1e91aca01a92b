// What stops a tool where the springs of nodes give way: one law for the CPU and the GPU.
//
// No tool may come deeper than stop_depth() at a node or in a triangle of neighbours at the
// surface. A spring much stiffer than a substep bears holds it off where it lies deepest, and acts
// on the nodes by their shares w. It is taken implicitly, node by node: with b = w k dt^2 as added
// mass along its normal n, and v relative to the tool,
//   (m + sum b n n^T) (v' - v) = dt (f + sum w k (depth - dt n . v) n).
// So b takes energy and never gives any, and what is at rest does not feel it.
#pragma once

#include <cmath>

#include "compute/host_device.h"
#include "tools/collider.h"

namespace tissue_sim {

/// A node that may stop a tool.
struct MlsStopNode {
  float x[3];       ///< [m]
  float edge;       ///< distance to its neighbours [m]
  float stiffness;  ///< of the spring with which it touches anything [N/m]
};

/// What stops tools at a node.
struct MlsStop {
  float force[3];  ///< [N]
  float added[6];  ///< mass: xx yy zz xy yz zx [kg]
  int collider;    ///< the last of those that are stopped; -1: none
};
TISSUE_SIM_INLINE MlsStop no_stop() { return {{}, {}, -1}; }

/// How far apart neighbours are at most that stop a tool between them [edges].
inline constexpr float kStopReach = 4;

/// Through a plane nothing passes, and blades cut.
TISSUE_SIM_INLINE bool is_stopped(const Collider& c) {
  return c.kind != Collider::kPlane && c.kind != Collider::kBlade;
}

namespace mls_stop {

inline constexpr float kStiffer = 16;  // than the springs of nodes

TISSUE_SIM_INLINE float dot(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

TISSUE_SIM_INLINE float lesser(float a, float b) { return a < b ? a : b; }  // fminf() is a call

TISSUE_SIM_INLINE float half_thickness(const Collider& c) {
  return c.kind == Collider::kPlate ? 0.5f * c.thickness : c.radius;
}

/// Of a node with velocity v at a place x, `over` deeper than it may be, which acts on the node by
/// its share of a spring k.
TISSUE_SIM_INLINE void push(const Collider& c, int index, const Gap& g, float over, const float* x,
                            const float* v, float k, float dt, float kick, MlsStop& stop) {
  if (!(over > 0)) return;
  float vc[3];
  velocity_at(c, x, vc);
  const float vn = dot(v, g.normal) - dot(vc, g.normal);
  const float push = k * (over - dt * vn), b = k * dt * kick;
  if (!(push > 0)) return;
  for (int a = 0; a < 3; ++a) {
    stop.force[a] += push * g.normal[a];
    stop.added[a] += b * g.normal[a] * g.normal[a];
    stop.added[3 + a] += b * g.normal[a] * g.normal[(a + 1) % 3];
  }
  stop.collider = index;
}

/// Of the triangle 0, b, c: which shares of b and c make the place that is nearest to p.
TISSUE_SIM_INLINE void nearest_in_triangle(const float* b, const float* c, const float* p, float& s,
                                           float& t) {
  const float bb = dot(b, b), bc = dot(b, c), cc = dot(c, c), bp = dot(b, p), cp = dot(c, p);
  const float det = bb * cc - bc * bc;
  s = cc * bp - bc * cp, t = bb * cp - bc * bp;
  if (s >= 0 && t >= 0 && s + t <= det && det > 0) {
    s /= det, t /= det;
    return;
  }
  const auto clamped = [](float x, float y) { return !(x > 0) ? 0.0f : x < y ? x / y : 1.0f; };
  const float on_b = clamped(bp, bb), on_c = clamped(cp, cc),
              across = clamped(bb - bc - bp + cp, bb - 2 * bc + cc);  // from b to c
  const float side[3][2] = {{on_b, 0}, {0, on_c}, {1 - across, across}};
  float least = 1e30f;
  for (int k = 0; k < 3; ++k) {
    const float x = side[k][0], y = side[k][1];
    const float far = x * x * bb + 2 * x * y * bc + y * y * cc - 2 * (x * bp + y * cp);
    if (far < least) least = far, s = x, t = y;
  }
}

}  // namespace mls_stop

/// How deep a place may lie in a collider [m].
TISSUE_SIM_INLINE float stop_depth(const Collider& c, float edge) {
  constexpr float kDeep = 0.15f;  // of what is less: the tool, or what nodes see
  return kDeep * mls_stop::lesser(edge, mls_stop::half_thickness(c));
}

/// At a node with velocity v that is at `g`, in a substep of dt whose forces act for `kick` [s].
TISSUE_SIM_INLINE void stop_at_node(const Collider& c, int index, const Gap& g,
                                    const MlsStopNode& node, const float* v, float dt, float kick,
                                    MlsStop& stop) {
  mls_stop::push(c, index, g, -g.distance - stop_depth(c, node.edge), node.x, v,
                 mls_stop::kStiffer * node.stiffness, dt, kick, stop);
}

/// Whether a triangle of the node and this neighbour may stop the collider, because of the latter.
/// Colliders are convex: all of it lies above their tangential planes.
TISSUE_SIM_INLINE bool may_be_stopped(const Gap& at_node, const MlsStopNode& node,
                                      const MlsStopNode& other) {
  const float* const n = at_node.normal;
  const float above =
      at_node.distance + mls_stop::lesser(0, mls_stop::dot(n, other.x) - mls_stop::dot(n, node.x));
  return above < 0;
}

/// The same in the triangle with two neighbours, where the node is at `at_node`: the place that
/// lies deepest, by going back and forth between the triangle and the collider's inside.
TISSUE_SIM_INLINE void stop_beside_node(const Collider& c, int index, const Gap& at_node,
                                        const MlsStopNode& node, const float* v,
                                        const MlsStopNode& y, const MlsStopNode& z, float dt,
                                        float kick, MlsStop& stop) {
  constexpr int kRounds = 2;
  const float depth = stop_depth(c, (node.edge + y.edge + z.edge) / 3);
  float x[3] = {node.x[0], node.x[1], node.x[2]}, to_y[3], to_z[3], inner[3];
  for (int a = 0; a < 3; ++a) to_y[a] = y.x[a] - node.x[a], to_z[a] = z.x[a] - node.x[a];
  Gap g = at_node;
  float s = 0, t = 0;
  for (int round = 0;; ++round) {
    const float n_y = mls_stop::dot(g.normal, to_y), n_z = mls_stop::dot(g.normal, to_z);
    if (g.distance + mls_stop::lesser(0, mls_stop::lesser(n_y, n_z)) - s * n_y - t * n_z >= -depth)
      return;
    if (round == kRounds) break;
    const float in = g.distance + mls_stop::half_thickness(c);
    for (int a = 0; a < 3; ++a) inner[a] = s * to_y[a] + t * to_z[a] - in * g.normal[a];
    mls_stop::nearest_in_triangle(to_y, to_z, inner, s, t);
    if (round + 1 == kRounds && s + t >= 1) return;  // the others'
    for (int a = 0; a < 3; ++a) x[a] = node.x[a] + s * to_y[a] + t * to_z[a];
    g = gap(c, x);
  }
  const float k = mls_stop::kStiffer * (node.stiffness + y.stiffness + z.stiffness) / 3;
  mls_stop::push(c, index, g, -g.distance - depth, x, v, (1 - s - t) * k, dt, kick, stop);
}

/// Whether two neighbours of a node are near enough to make a triangle with it: `d` leads from one
/// to the other in reference space.
TISSUE_SIM_INLINE bool makes_triangle(const float* d, float edge, float other_edge) {
  constexpr float kNear = 1.5f;  // [edges]
  const float most = 0.5f * kNear * (edge + other_edge);
  return mls_stop::dot(d, d) < most * most;
}

/// Beside the spring of a node that is too light for it in such a substep.
TISSUE_SIM_INLINE void bear_spring(float stiffness, float mass, int index, float dt, float kick,
                                   MlsStop& stop) {
  const float b = stiffness * dt * kick - mass;
  if (!(b > 0)) return;
  for (int a = 0; a < 3; ++a) stop.added[a] += b;
  stop.collider = index;
}

/// Change of velocity of a node that stops a tool, and on which `force` and gravity act besides,
/// and what the tool pushes it with for that.
TISSUE_SIM_INLINE void move_stopping(const MlsStop& stop, float mass, const float* force,
                                     const float* gravity, float kick, float* dv, float* push) {
  const float xx = mass + stop.added[0], yy = mass + stop.added[1], zz = mass + stop.added[2],
              xy = stop.added[3], yz = stop.added[4], zx = stop.added[5];
  const float cxx = yy * zz - yz * yz, cxy = yz * zx - xy * zz, czx = xy * yz - yy * zx,
              cyy = xx * zz - zx * zx, cyz = xy * zx - xx * yz, czz = xx * yy - xy * xy;
  const float per_det = kick / (xx * cxx + xy * cxy + zx * czx);
  float f[3];
  for (int a = 0; a < 3; ++a) f[a] = force[a] + stop.force[a] + mass * gravity[a];
  dv[0] = per_det * (cxx * f[0] + cxy * f[1] + czx * f[2]);
  dv[1] = per_det * (cxy * f[0] + cyy * f[1] + cyz * f[2]);
  dv[2] = per_det * (czx * f[0] + cyz * f[1] + czz * f[2]);
  for (int a = 0; a < 3; ++a) push[a] = mass * (dv[a] / kick - gravity[a]) - force[a];
}

}  // namespace tissue_sim
