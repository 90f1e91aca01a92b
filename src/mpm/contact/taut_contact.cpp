#include "mpm/contact/taut_contact.h"

#include <algorithm>
#include <cmath>

#include "contact/contact_spring.h"
#include "mpm/contact/face_places.h"
#include "mpm/contact/facet_motion.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

constexpr float kStiffness = kSunkStiffness;  // of all springs together
constexpr float kDamping = kSunkDamping;
constexpr int kSteps = 3;       // towards the deepest place of an element
constexpr float kHalf = 0.25f;  // edge of an element [cells]

/// Radius of what is round about the tool where tissue meets it first [m].
float tip_radius(const Collider& c) {
  return c.kind == Collider::kPunch || c.kind == Collider::kPlate ? c.edge : c.radius;
}

/// A place in a cell: where it is, and how it moves along two axes of the reference space.
struct ElementPlace {
  float place[3], at[3];
  Gap gap;
  AxisWeights weights;
};

void find(const MpmState& state, const NearCell& cell, const CellNodes& nodes, float h,
          const Collider& collider, ElementPlace& e) {
  e.weights = AxisWeights(e.place);
  float u[3];
  displacement_at(state.nodes, nodes, has_whole_rows(nodes), e.weights, u);
  for (int a = 0; a < 3; ++a) e.at[a] = cell.middle[a] + h * e.place[a] + u[a];
  e.gap = gap(collider, e.at);
}

/// The deepest place of the element around `middle` across an axis.
ElementPlace deepest(const MpmState& state, const NearCell& cell, const CellNodes& nodes, float h,
                     const Collider& collider, const float (&middle)[3], int axis) {
  ElementPlace best;
  std::copy_n(middle, 3, best.place);
  find(state, cell, nodes, h, collider, best);
  const int axes[2] = {(axis + 1) % 3, (axis + 2) % 3};
  const float round = tip_radius(collider);
  ElementPlace now = best;
  for (int step = 0; step < kSteps; ++step) {
    float F[9], t[2][3], r[2] = {0, 0}, tt[3] = {0, 0, 0};
    deformation_gradient_at(state.nodes.u, nodes, h, now.place, F);
    for (int k = 0; k < 2; ++k) {
      for (int a = 0; a < 3; ++a) t[k][a] = h * F[3 * a + axes[k]];
    }
    // To the place of its tangential plane that is nearest to the middle of what is round there.
    const float off = std::max(0.0f, round + now.gap.distance);
    for (int a = 0; a < 3; ++a) {
      const float from_middle = off * now.gap.normal[a];
      r[0] -= t[0][a] * from_middle;
      r[1] -= t[1][a] * from_middle;
      tt[0] += t[0][a] * t[0][a];
      tt[1] += t[0][a] * t[1][a];
      tt[2] += t[1][a] * t[1][a];
    }
    const float det = tt[0] * tt[2] - tt[1] * tt[1];
    if (!(det > 1e-6f * tt[0] * tt[2])) break;
    const float to[2] = {(r[0] * tt[2] - r[1] * tt[1]) / det, (r[1] * tt[0] - r[0] * tt[1]) / det};
    float moved = 0;
    for (int k = 0; k < 2; ++k) {
      const float low = middle[axes[k]] - kHalf, high = middle[axes[k]] + kHalf;
      const float next = std::min(high, std::max(low, now.place[axes[k]] + to[k]));
      moved = std::max(moved, std::fabs(next - now.place[axes[k]]));
      now.place[axes[k]] = next;
    }
    if (moved < 1e-3f) break;
    find(state, cell, nodes, h, collider, now);
    if (now.gap.distance < best.gap.distance) best = now;
  }
  return best;
}

}  // namespace

float element_reach(const LatticeBody& body, const Block& block, const float* x, int cell) {
  const std::size_t lanes = block.lane_count();
  float most[3] = {0, 0, 0};
  for (int axis = 0; axis < 3; ++axis) {
    for (int s = 0; s < 8; ++s) {
      if ((s >> axis & 1) != 0) continue;
      const int a = cell + s * block.stride, b = cell + (s | 1 << axis) * block.stride;
      if (block.point[a] < 0 || block.point[b] < 0) continue;
      float d2 = 0;
      for (int c = 0; c < 3; ++c) {
        const float d = x[c * lanes + b] - x[c * lanes + a];
        d2 += d * d;
      }
      most[axis] = std::max(most[axis], d2);
    }
  }
  std::sort(most, most + 3);
  const float whole = 0.5f * static_cast<float>(body.cell_size);
  return 0.5f * std::max(whole * 1.4142136f, std::sqrt(most[1] + most[2]));
}

std::uint8_t taut_reach(const Collider& collider, const LatticeBody& body, float reach) {
  if (collider.kind == Collider::kPlane || collider.kind == Collider::kBlade) return 0;
  const float h = static_cast<float>(body.cell_size), r = tip_radius(collider);
  // A middle at the tool's surface, the tip over the rim; with some margin until the next list.
  const float sunk = std::max(0.0f, r - 0.8f * kMaySink * h);
  if (!(reach * reach > r * r - sunk * sunk && reach > 1.5f * kWholeReach * h)) return 0;
  return static_cast<std::uint8_t>(std::min(255.0f, std::ceil(16 * reach / h)));
}

void find_sunk(const MpmState& state, const Block& block, const NearCell& cell,
               const Collider& collider, std::vector<SunkPlace>& sunk) {
  const LatticeBody& body = state.bodies[block.body];
  const auto h = static_cast<float>(body.cell_size);
  const CellNodes nodes(block, cell.node);
  for (int s = 0; s < 8; ++s) {
    const int lane = cell.lane + s * block.stride;
    const std::int32_t p = block.point[lane];
    if (p < 0 || state.points.bonds[p] == kAllBonds) continue;
    if (!(block.volume[lane] > 0)) continue;  // an anchor has it
    unsigned axes = 0;                        // one element for both sides of a sheet a point thick
    for (int k = 0; k < kBondCount; ++k) {
      if ((state.points.bonds[p] >> k & 1) == 0) axes |= 1u << (k < 3 ? 2 - k : k - 3);
    }
    for (int axis = 0; axis < 3; ++axis) {
      if ((axes >> axis & 1) == 0) continue;
      float middle[3];
      for (int a = 0; a < 3; ++a) middle[a] = (s >> a & 1) != 0 ? kHalf : -kHalf;
      const ElementPlace e = deepest(state, cell, nodes, h, collider, middle, axis);
      const float deep = -e.gap.distance - kMaySink * h;
      if (!(deep > 0)) continue;
      SunkPlace place{cell.node, cell.collider, {}, deep, {}, e.weights};
      std::copy_n(e.at, 3, place.at);
      std::copy_n(e.gap.normal, 3, place.normal);
      sunk.push_back(place);
    }
  }
}

void push_sunk(const MpmState& state, const Block& block, const std::vector<SunkPlace>& sunk,
               float dt, float* force, std::vector<ColliderLoad>& loads) {
  const Nodes& of = state.nodes;
  const auto for_each_node = [&](const SunkPlace& place, const auto& f) {
    for (int k = 0; k < 27; ++k) {
      const int at = place.node + k / 9 * block.plane + k / 3 % 3 * block.pitch + k % 3;
      f(at,
        place.weights.of[k % 3] * place.weights.of[3 + k / 3 % 3] * place.weights.of[6 + k / 9]);
    }
  };
  // No motion is stiffened by more than the largest k_i sum_j |w_i M^-1 w_j| (Gershgorin).
  std::vector<float> all(block.node.size(), 0.0f);
  for (const SunkPlace& place : sunk) {
    for_each_node(place, [&](int at, float w) { all[at] += w; });
  }
  for (const SunkPlace& place : sunk) {
    const Collider& collider = state.colliders[place.collider];
    float v[3] = {0, 0, 0}, of_collider[3], vn = 0, moves = 0;
    for_each_node(place, [&](int at, float w) {
      const std::int32_t node = block.node[at];
      for (int a = 0; a < 3; ++a) v[a] += w * of.v[a][node];
      moves += w * all[at] * of.inv_mass[node];
    });
    if (!(moves > 0)) continue;
    velocity_at(collider, place.at, of_collider);
    for (int a = 0; a < 3; ++a) vn += (v[a] - of_collider[a]) * place.normal[a];
    const float k = kStiffness / (moves * dt * dt);
    const float c = 2 * kDamping * std::sqrt(kStiffness) / (moves * dt);
    const float push = std::max(0.0f, k * place.deep - c * vn);
    float on[3];
    double arm[3];
    ColliderLoad& load = loads[place.collider];
    for (int a = 0; a < 3; ++a) {
      on[a] = push * place.normal[a];
      load.force[a] -= on[a];
      arm[a] = static_cast<double>(place.at[a]) - collider.position[a];
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      load.torque[a] -= arm[b] * on[d] - arm[d] * on[b];
    }
    spread(block, place.node, place.weights, on, force);
  }
}

}  // namespace tissue_sim
