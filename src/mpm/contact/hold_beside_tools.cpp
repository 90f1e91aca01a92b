#include <Eigen/LU>

#include "mpm/contact/contact_inertia.h"
#include "mpm/contact/touching_tissue.h"

namespace tissue_sim {
namespace {

constexpr int kSweeps = 8;  // over rows that have nodes in common

InertialNode* inertial_node(TouchingTissue& state, std::int32_t node) {
  const std::int32_t i = state.inertial_index[node];
  return i < 0 ? nullptr : &state.contacts.inertia.nodes[i];
}

/// (M + B)^-1 M of a node: of an impulse over its mass to its velocity.
Eigen::Matrix3f yields(TouchingTissue& state, std::int32_t node) {
  Eigen::Matrix3f share = Eigen::Matrix3f::Identity();
  if (const InertialNode* n = inertial_node(state, node)) {
    const float(&s)[6] = n->share;
    Eigen::Matrix3f resists;
    resists << s[0], s[3], s[5], s[3], s[1], s[4], s[5], s[4], s[2];
    share -= resists;
  }
  return share;
}

}  // namespace

void calm_swings(TouchingTissue& state, int i, float dt) {
  const FaceGroup& g = state.anchors.groups[i];
  Nodes& nodes = state.nodes;
  for (int r = g.first; r < g.first + g.count; ++r) {
    const FaceRow& row = state.anchors.rows[r];
    if (!is_swing(row)) continue;
    const std::int32_t node = row.node[0];
    for (int a = 0; a < 3; ++a) {
      const float lost = kSwingLoss * nodes.v[a][node];
      nodes.v[a][node] -= lost;
      nodes.u[a][node] -= dt * lost;
    }
  }
}

bool is_beside_tools(const TouchingTissue& state, int i) {
  if (state.contacts.inertia.nodes.empty()) return false;
  const FaceGroup& g = state.anchors.groups[i];
  for (int r = g.first; r < g.first + g.count; ++r) {
    const FaceRow& row = state.anchors.rows[r];
    for (int k = 0; k < kRowNodes; ++k) {
      if (row.share[k] != 0 && state.inertial_index[row.node[k]] >= 0) return true;
    }
  }
  return false;
}

void hold_beside_tools(TouchingTissue& state, int index, float dt, const RigidMotion* before,
                       const RigidMotion* after) {
  AnchorFaces& faces = state.anchors;
  Nodes& nodes = state.nodes;
  const FaceGroup& g = faces.groups[index];
  for (int sweep = 0; sweep < (g.count == 1 ? 1 : kSweeps); ++sweep) {
    for (int i = g.first; i < g.first + g.count; ++i) {
      const FaceRow& r = faces.rows[i];
      Eigen::Vector3f target = Eigen::Vector3f::Zero(), shift = target, u = target, v = target;
      if (after != nullptr) {
        const Vec3 to = after[r.anchor].displacement(r.place);
        target = to.cast<float>();
        shift = ((to - before[r.anchor].displacement(r.place)) / dt).cast<float>();
      }
      Eigen::Matrix3f share[kRowNodes], mobility = Eigen::Matrix3f::Zero();
      for (int k = 0; k < kRowNodes; ++k) {
        for (int a = 0; a < 3; ++a) {
          v[a] += r.weight[k] * nodes.v[a][r.node[k]];
          u[a] += r.weight[k] * nodes.u[a][r.node[k]];
        }
        if (r.share[k] == 0) continue;
        share[k] = r.share[k] * yields(state, r.node[k]);
        mobility += r.weight[k] * share[k];
      }
      const Eigen::Vector3f off = target - shift * dt - (u - dt * v);  // before the substep
      const Eigen::Vector3f impulse = mobility.inverse() * (shift - v + face_drift(dt) / dt * off);
      if (!impulse.allFinite()) continue;
      for (int a = 0; a < 3; ++a) faces.impulse[i][a] += impulse[a];
      for (int k = 0; k < kRowNodes; ++k) {
        if (r.share[k] == 0) continue;
        const Eigen::Vector3f dv = share[k] * impulse;
        InertialNode* const n = inertial_node(state, r.node[k]);
        for (int a = 0; a < 3; ++a) {
          nodes.v[a][r.node[k]] += dv[a];
          nodes.u[a][r.node[k]] += dt * dv[a];
          if (n != nullptr) n->impulse[a] += n->mass * dv[a] - r.weight[k] * impulse[a];
        }
      }
    }
  }
}

}  // namespace tissue_sim
