#include "mpm/state_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "fragments/piece_sums.h"
#include "frame/checksum.h"
#include "frame/point_fields.h"
#include "frame/put_faces.h"
#include "frame/stability_limit.h"
#include "material/laws.h"
#include "math/bspline.h"
#include "mpm/surface/facet_in_world.h"
#include "mpm/tear/debris.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {

namespace {

/// Half the fastest rate at which viscosity slows a node [1/s]: of the masks of points in a cell
/// the worst gives 9.4 eta / (rho h^2). Viscous stress F S has F twice, outside and in dE/dt: it
/// grows with the square of the largest stretch, which is at most ||F||^2, and at most that of the
/// stiffening where J = 1. Squeezed tissue stiffens much more than it is stretched.
double damping(const Material& m, double cell_size, float stiffening, float stretch2) {
  const float grown = std::min(stiffening * stiffening, stretch2);
  return 5 * m.viscosity * grown / (m.density * cell_size * cell_size);
}

double stable_substep(const Material& m, double cell_size, double cfl, float stiffening,
                      float stretch2) {
  const double modulus = wave_modulus(m, stiffening);
  const double elastic = cfl * cell_size * std::sqrt(m.density / modulus);
  return viscous_substep(elastic, damping(m, cell_size, stiffening, stretch2));
}

}  // namespace

double fastest_damping(const MpmState& state, const Stiffening& stiffening) {
  double fastest = 0;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      fastest = std::max(
          fastest, damping(b.materials[m], b.cell_size, stiffening[i][m], stiffening[i].back()));
    }
  }
  return fastest;
}

Stiffening even_stiffening(const MpmState& state, float stiffening) {
  Stiffening all;
  for (const LatticeBody& b : state.bodies) all.emplace_back(b.materials.size() + 1, stiffening);
  return all;
}

// Stiffness, damping and mass of any motion are sums over points, and the condition is linear in
// each of them: what every point bears on its own, a mixture bears.
float stable_substep(const MpmState& state, const Stiffening& stiffening) {
  double dt = 1e9;
  for (std::size_t i = 0; i < state.bodies.size(); ++i) {
    const LatticeBody& b = state.bodies[i];
    for (std::size_t m = 0; m < b.materials.size(); ++m) {
      dt = std::min(dt, stable_substep(b.materials[m], b.cell_size, state.scene.cfl,
                                       stiffening[i][m], stiffening[i].back()));
    }
  }
  return static_cast<float>(dt);
}

bool may_be_ill_conditioned(const MpmState& state) {
  return (!state.bridge_ends.empty() && state.worst_stiffening >= kBridgeStiffening) ||
         (!state.debris.empty() && state.worst_stiffening >= kIllConditioned);
}

std::uint64_t checksum(const MpmState& state, const Pieces& pieces) {
  Checksum sum;
  for (int a = 0; a < 3; ++a) {
    sum.add(state.nodes.u[a]);
    sum.add(state.nodes.v[a]);
  }
  for (int a = 0; a < 3; ++a) {
    if (state.front.nodes.empty()) break;
    sum.add(state.front.d[a]);
    sum.add(state.front.rate[a]);
  }
  sum.add(state.points.bonds);
  sum.add(pieces.of_point);
  return sum.value();
}

Momentum momentum(const MpmState& state) {
  const Nodes& n = state.nodes;
  Momentum sum;
  Vec3 about_origin = Vec3::Zero();
  const auto add = [&](std::int32_t i, const Vec3& home) {
    const double mass = n.mass[i];
    const Vec3 x = home + Vec3(n.u[0][i], n.u[1][i], n.u[2][i]);
    const Vec3 p = mass * Vec3(n.v[0][i], n.v[1][i], n.v[2][i]);
    sum.mass += mass;
    sum.centre += mass * x;
    sum.linear += p;
    about_origin += x.cross(p);
  };
  for (const LatticeBody& b : state.bodies) {
    b.for_each_node([&](int node, int x, int y, int z) {
      const Vec3 home = b.node_position(x, y, z);
      add(node, home);
      const NodeFields::Split* split = state.fields->split(node);
      if (split == nullptr) return;
      for (const auto& field : split->fields) {
        if (field.node != node) add(field.node, home);
      }
    });
  }
  const Front& front = state.front;
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    const Vec3 d(front.d[0][i], front.d[1][i], front.d[2][i]);
    const Vec3 rate(front.rate[0][i], front.rate[1][i], front.rate[2][i]);
    about_origin += front.nodes[i].mass * d.cross(rate);
  }
  sum.centre /= sum.mass;
  sum.angular = about_origin - sum.centre.cross(sum.linear);
  return sum;
}

namespace {

/// Displacement, velocity and displacement gradient of a point.
struct PointMotion {
  float u[3] = {}, v[3] = {}, F[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};

  PointMotion(const LatticeBody& body, const Points::Site& site, const NodeFields& fields,
              const Nodes& nodes) {
    const auto per_cell = static_cast<float>(1 / body.cell_size);
    const int s[3] = {site.x & 1, site.y & 1, site.z & 1};
    for (int k = 0; k < 27; ++k) {
      const int d[3] = {k % 3, k / 3 % 3, k / 9};
      const int node = fields.node(body, site, k);
      const float w[3] = {lattice_weight(s[0], d[0]), lattice_weight(s[1], d[1]),
                          lattice_weight(s[2], d[2])};
      const float slope[3] = {lattice_slope(s[0], d[0]) * w[1] * w[2] * per_cell,
                              w[0] * lattice_slope(s[1], d[1]) * w[2] * per_cell,
                              w[0] * w[1] * lattice_slope(s[2], d[2]) * per_cell};
      for (int a = 0; a < 3; ++a) {
        const float of_node = nodes.u[a][node];
        u[a] += w[0] * w[1] * w[2] * of_node;
        v[a] += w[0] * w[1] * w[2] * nodes.v[a][node];
        for (int b = 0; b < 3; ++b) F[3 * a + b] += slope[b] * of_node;
      }
    }
  }
};

/// Cauchy stress xx yy zz xy yz zx [Pa].
void cauchy_stress(const Material& m, const float (&F)[9], float* to) {
  const auto mu = static_cast<float>(lame_mu(m)), lambda = static_cast<float>(lame_lambda(m));
  float P[9], cof[9];
  if (m.law == Law::kNeoHookean) {
    stress<NeoHookean>(F, mu, lambda, P);
  } else {
    stress<FixedCorotated>(F, mu, lambda, P);
  }
  cofactor(F, cof);
  const float J = F[0] * cof[0] + F[1] * cof[1] + F[2] * cof[2];
  const auto at = [&](int i, int j) {
    return (P[3 * i] * F[3 * j] + P[3 * i + 1] * F[3 * j + 1] + P[3 * i + 2] * F[3 * j + 2]) / J;
  };
  for (int a = 0; a < 3; ++a) {
    to[a] = at(a, a);
    to[3 + a] = at(a, (a + 1) % 3);
  }
}

}  // namespace

bool held_place(const MpmState& state, std::int32_t point, Vec3& place) {
  if (state.points.free_volume_of(point) > 0) return false;
  const Points::Site& s = state.points.site[point];
  const LatticeBody& b = state.bodies[s.body];
  place = b.site_position(s.x, s.y, s.z);
  if (state.anchors.moves) place = state.anchors.place_of_held(b.body, s.body, place);
  return true;
}

void place_boundary(MpmState& s) {
  place_boundary(s, [&s](int i) {
    const BoundaryMesh::Vertex& v = s.boundary.vertices[i];
    Vec3 x = v.rest;
    const AxisWeights weights(v.place);
    for (int k = 0; k < 27; ++k) {
      const float w = weights.at(k);
      for (int a = 0; a < 3; ++a) x[a] += w * s.nodes.u[a][v.node[k]];
    }
    return floats(x);
  });
}

void push_surface(MpmState& s, Span<const float> impulses) {
  BoundaryMesh& mesh = s.boundary;
  find_support(s, mesh);
  BoundaryMesh::Support& by = mesh.support;
  constexpr int kGrain = 256;
  std::vector<std::array<float, 3>> push(mesh.vertices.size(), {0, 0, 0});
  s.cpu->for_each(
      static_cast<int>(push.size()),
      [&](int i) {
        for (std::int32_t e = by.corner_begin[i]; e < by.corner_begin[i + 1]; ++e) {
          const float* impulse = impulses.data() + std::size_t{3} * (by.corner[e] / 3);
          for (int a = 0; a < 3; ++a) push[i][a] += impulse[a];
        }
      },
      kGrain);
  pass_on(by, push);
  DistantNodes* const distant = s.edges.distant;
  if (distant != nullptr) distant->bring_motion(by.node);
  s.cpu->for_each(
      static_cast<int>(by.node.size()),
      [&](int n) {
        float sum[3] = {};
        for (std::int32_t e = by.begin[n]; e < by.begin[n + 1]; ++e) {
          for (int a = 0; a < 3; ++a) sum[a] += by.share[e] * push[by.vertex[e]][a];
        }
        const std::int32_t node = by.node[n];
        for (int a = 0; a < 3; ++a) s.nodes.v[a][node] += s.nodes.inv_mass[node] * sum[a];
      },
      kGrain);
  if (distant != nullptr) distant->send_velocities(by.node);
}

void add_point_fields(MpmState& state, const PointSelection& selection,
                      const std::vector<std::int32_t>& place, int count,
                      std::vector<std::uint8_t>& cloud) {
  add_fields(selection, place, count, *state.cpu, cloud, [&](int p) {
    const Points::Site& site = state.points.site[p];
    const LatticeBody& body = state.bodies[site.body];
    const Vec3 rest = body.site_position(site.x, site.y, site.z);
    PointMotion motion(body, site, *state.fields, state.nodes);
    Vec3 held;
    if (held_place(state, p, held)) {
      const Vec3 moved = held - rest;
      for (int a = 0; a < 3; ++a) motion.u[a] = static_cast<float>(moved[a]);
      if (!state.anchors.moves) std::fill_n(motion.v, 3, 0.0f);
    }
    PointFields of;
    for (int a = 0; a < 3; ++a) {
      of.rest[a] = static_cast<float>(rest[a]);
      of.u[a] = motion.u[a];
      of.v[a] = motion.v[a];
    }
    of.volume = state.points.volume[p];
    // What an anchor holds has no stress.
    if ((selection.fields & kStressTensor) != 0 && state.points.free_volume_of(p) > 0) {
      cauchy_stress(body.material_of(state.points, p), motion.F, of.stress);
    }
    return of;
  });
}

void measure_pieces(MpmState& state, Pieces& pieces) {
  const int count = static_cast<int>(state.blocks.all.size());
  std::vector<SumsByPiece> of_block(count);
  state.cpu->for_each(count, [&](int i) {
    const Block& block = *state.blocks.all[i];
    BlockScratch& scratch = state.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 6 * lanes) scratch.values.resize(6 * lanes);
    float *x = scratch.values.data(), *v = x + 3 * lanes;
    const BlockField field = block_field(state, block);
    state.kernels->positions(block, field, state.nodes.u, scratch, x);
    state.kernels->positions(block, at_rest(field), state.nodes.v, scratch, v);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (p < 0) continue;
      Vec3 place(x[lane], x[lanes + lane], x[2 * lanes + lane]);
      Vec3 velocity(v[lane], v[lanes + lane], v[2 * lanes + lane]);
      if (held_place(state, p, place) && !state.anchors.moves) velocity.setZero();
      of_block[i].of(pieces.of_point[p]).add(state.points.volume[p], place, velocity);
    }
  });
  set_motion(of_block, pieces);
}

}  // namespace tissue_sim
