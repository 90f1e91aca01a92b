#include "mpm/contact/contact_inertia.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "mpm/contact/touching_tissue.h"
#include "mpm/surface/facet_motion.h"

namespace tissue_sim {
namespace {

constexpr float kNegligible = 1e-7f;  // weight of a node in a place

Eigen::Matrix3d matrix(const float (&m)[6]) {
  Eigen::Matrix3d M;
  M << m[0], m[3], m[5], m[3], m[1], m[4], m[5], m[4], m[2];
  return M;
}

void add_outer(float scale, const float (&n)[3], float (&m)[6]) {
  for (int a = 0; a < 3; ++a) {
    m[a] += scale * n[a] * n[a];
    m[3 + a] += scale * n[a] * n[(a + 1) % 3];
  }
}

void times(const float (&m)[6], const float (&v)[3], float (&to)[3]) {
  to[0] = m[0] * v[0] + m[3] * v[1] + m[5] * v[2];
  to[1] = m[3] * v[0] + m[1] * v[1] + m[4] * v[2];
  to[2] = m[5] * v[0] + m[4] * v[1] + m[2] * v[2];
}

/// What contact that begins brings to a node.
struct Begun {
  float inertia[6] = {}, momentum[3] = {};  ///< B, and B times the colliders' velocities
};

void work_out(InertialNode& n) {
  const Eigen::Matrix3d B = matrix(n.inertia);
  const Eigen::Matrix3d S = (B + n.mass * Eigen::Matrix3d::Identity()).inverse() * B;
  for (int a = 0; a < 3; ++a) {
    n.share[a] = static_cast<float>(S(a, a));
    n.share[3 + a] = static_cast<float>(S(a, (a + 1) % 3));
  }
}

/// Gives added masses that are new to a node, and part of its B, their share of its motion:
/// (M + B) v' = (M + B - dB) v + dB v_c.
void take_in(const Begun& begun, InertialNode& n, Nodes& nodes) {
  const float v[3] = {nodes.v[0][n.node], nodes.v[1][n.node], nodes.v[2][n.node]};
  float taken[3];
  times(begun.inertia, v, taken);
  const Eigen::Matrix3d A = matrix(n.inertia) + n.mass * Eigen::Matrix3d::Identity();
  const Vec3 change = A.inverse() * Vec3(begun.momentum[0] - taken[0], begun.momentum[1] - taken[1],
                                         begun.momentum[2] - taken[2]);
  for (int a = 0; a < 3; ++a) {
    const auto dv = static_cast<float>(change[a]);
    nodes.v[a][n.node] += dv;
    n.impulse[a] += n.mass * dv;
  }
}

void take_in_growth(InertialNode& n, const Collider& collider, Nodes& nodes) {
  float at[3], velocity[3];
  for (int a = 0; a < 3; ++a) at[a] = n.place[a] + nodes.u[a][n.node];
  velocity_at(collider, at, velocity);
  Begun grown;
  for (int k = 0; k < 6; ++k) grown.inertia[k] = n.grown * n.inertia[k];
  times(grown.inertia, velocity, grown.momentum);
  take_in(grown, n, nodes);
  n.grown = 0;
}

}  // namespace

void fit_inertia(TouchingTissue& state, float dt) {
  ContactInertia& inertia = state.contacts.inertia;
  constexpr float kRoom = 1.1f;  // substeps grow a little now and then
  if (dt <= inertia.dt && 2 * dt >= inertia.dt) return;
  const float ratio = inertia.dt > 0 ? kRoom * dt / inertia.dt : 0;
  for (InertialNode& n : inertia.nodes) {
    for (float& b : n.inertia) b *= ratio * ratio;
    n.changed = true;
    n.grown = std::max(0.0f, 1 - 1 / (ratio * ratio));
  }
  for (auto& touches : state.contacts.touching) {
    for (Touch& t : touches) t.inertia *= ratio * ratio;
  }
  inertia.dt = kRoom * dt;
}

void change_inertia(TouchingTissue& state) {
  ContactInertia& inertia = state.contacts.inertia;
  Nodes& nodes = state.nodes;
  std::vector<std::int32_t> changed;  // by number in inertia.nodes
  for (std::size_t i = 0; i < inertia.nodes.size(); ++i) {
    InertialNode& n = inertia.nodes[i];
    for (float& of : n.impulse) of = 0;
    if (n.grown > 0) take_in_growth(n, state.colliders[n.collider], nodes);
    for (int a = 0; a < 3; ++a) n.before[a] = nodes.v[a][n.node];
    if (n.changed) changed.push_back(static_cast<std::int32_t>(i));
  }
  if (changed.empty() &&
      std::all_of(state.contacts.changes.begin(), state.contacts.changes.end(),
                  [](const std::vector<InertiaChange>& of) { return of.empty(); })) {
    return;
  }
  std::vector<Begun> begun(inertia.nodes.size());
  for (std::size_t i = 0; i < state.contacts.changes.size(); ++i) {
    const Block& block = *state.blocks.all[i];
    const LatticeBody& body = state.bodies[block.body];
    for (const InertiaChange& change : state.contacts.changes[i]) {
      const CellNodes cell(block, change.node);
      const AxisWeights w(change.place);
      const int z0 = change.node / block.plane, y0 = change.node % block.plane / block.pitch;
      const int x0 = change.node % block.plane % block.pitch;
      float sum = 0;  // of the weights' sizes: 1 but where a place lies outside of its cell
      for (int k = 0; k < 27; ++k) {
        sum += std::fabs(w.of[k % 3] * w.of[3 + k / 3 % 3] * w.of[6 + k / 9]);
      }
      for (int k = 0; k < 27; ++k) {
        const float weight = std::fabs(w.of[k % 3] * w.of[3 + k / 3 % 3] * w.of[6 + k / 9]);
        const std::int32_t node = cell.row(k / 3 % 3, k / 9)[k % 3];
        if (weight < kNegligible || node < 0 || nodes.inv_mass[node] == 0) continue;
        std::int32_t& index = state.inertial_index[node];
        if (index < 0) {
          index = static_cast<std::int32_t>(inertia.nodes.size());
          InertialNode n{};
          n.node = node;
          n.mass = nodes.mass[node];
          const Vec3 X = body.node_position(block.cell_x(x0) + k % 3 - 1,
                                            block.y + y0 + k / 3 % 3 - 1, block.z + z0 + k / 9 - 1);
          for (int a = 0; a < 3; ++a) n.place[a] = static_cast<float>(X[a]);
          inertia.nodes.push_back(n);
          begun.emplace_back();
        }
        InertialNode& n = inertia.nodes[index];
        if (!n.changed) changed.push_back(index);
        n.changed = true;
        n.uses += change.sign > 0 ? 1 : -1;
        n.collider = change.collider;
        const float scale = change.sign * weight * sum * change.inertia;
        add_outer(scale, change.normal, n.inertia);
        if (!change.begins) continue;
        add_outer(scale, change.normal, begun[index].inertia);
        float along = 0;
        for (int a = 0; a < 3; ++a) along += change.normal[a] * change.velocity[a];
        for (int a = 0; a < 3; ++a) begun[index].momentum[a] += scale * along * change.normal[a];
      }
    }
  }
  for (const std::int32_t i : changed) {
    InertialNode& n = inertia.nodes[i];
    n.changed = false;
    if (n.uses == 0) std::fill_n(n.inertia, 6, 0.0f);
    work_out(n);
    const Begun& of = begun[i];
    if (of.inertia[0] + of.inertia[1] + of.inertia[2] > 0) take_in(of, n, nodes);
    for (int a = 0; a < 3; ++a) n.before[a] = nodes.v[a][n.node];
  }
}

void resist_acceleration(InertialNode& n, float keep, float dt, Nodes& nodes) {
  float change[3], resisted[3];
  for (int a = 0; a < 3; ++a) change[a] = nodes.v[a][n.node] - keep * n.before[a];
  times(n.share, change, resisted);
  for (int a = 0; a < 3; ++a) {
    nodes.v[a][n.node] -= resisted[a];
    nodes.u[a][n.node] -= dt * resisted[a];
    n.impulse[a] -= n.mass * resisted[a];
  }
}

void add_inertial_loads(const TouchingTissue& state, float kick, std::vector<ColliderLoad>& loads) {
  for (const InertialNode& n : state.contacts.inertia.nodes) {
    const Collider& c = state.colliders[n.collider];
    if (n.uses == 0 || c.tool < 0) continue;  // nobody asks what the ground bears
    double arm[3], force[3];
    for (int a = 0; a < 3; ++a) {
      force[a] = -static_cast<double>(n.impulse[a]) / kick;
      arm[a] = static_cast<double>(n.place[a]) + state.nodes.u[a][n.node] - c.position[a];
    }
    for (int a = 0; a < 3; ++a) {
      const int b = (a + 1) % 3, d = (a + 2) % 3;
      loads[n.collider].force[a] += force[a];
      loads[n.collider].torque[a] += arm[b] * force[d] - arm[d] * force[b];
    }
  }
}

void tidy_inertia(TouchingTissue& state, bool all) {
  ContactInertia& inertia = state.contacts.inertia;
  for (const InertialNode& n : inertia.nodes) state.inertial_index[n.node] = -1;
  if (all) {
    inertia.nodes.clear();
    for (auto& touches : state.contacts.touching) {
      for (Touch& t : touches) t.inertia = 0;
    }
  }
  const auto unused = [](const InertialNode& n) { return n.uses == 0; };
  inertia.nodes.erase(std::remove_if(inertia.nodes.begin(), inertia.nodes.end(), unused),
                      inertia.nodes.end());
  index_inertia(state);
}

void index_inertia(TouchingTissue& state) {
  state.inertial_index.resize(state.nodes.size(), -1);
  for (std::size_t i = 0; i < state.contacts.inertia.nodes.size(); ++i) {
    state.inertial_index[state.contacts.inertia.nodes[i].node] = static_cast<std::int32_t>(i);
  }
}

}  // namespace tissue_sim
