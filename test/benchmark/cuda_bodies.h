// The bodies that are measured on a GPU, and how they are compared with the CPU's.
#pragma once

#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "math/bspline.h"
#include "mpm/mpm_state.h"

namespace tissue_sim {

struct CubeSize {
  int points;   // as the benchmark is called
  int x, y, z;  // cells
};

inline Scene cube(const CubeSize& size, Law law) {
  Scene scene;
  scene.mpm.boundary = MpmBoundary::kLattice;  // but for what hold_at_faces() and fronts say
  scene.cell_size = 0.001;
  scene.ground.z = -1;
  scene.bodies.resize(1);
  Body& body = scene.bodies[0];
  body.size = 0.001 * Vec3(size.x, size.y, size.z);
  body.pose.position = 0.5 * body.size;
  Region below, above;
  below.z = 0.0011;
  above.kind = Region::Kind::kBox;
  above.min = Vec3(-1, -1, body.size[2] - 0.0011);
  above.max = Vec3(1, 1, 1);
  body.anchors = {below, above};
  scene.materials.resize(1);
  scene.materials[0].name = "test";
  scene.materials[0].law = law;
  body.material = "test";
  return scene;
}

/// An ellipsoid instead of the cube, of its volume, held at either end along z.
inline void make_organ(Scene& scene) {
  Body& body = scene.bodies[0];
  const Vec3 of_unit(1.6, 1.1, 0.75);
  const double scale = std::cbrt(body.size.prod() / (4.0 / 3 * M_PI * of_unit.prod()));
  body.shape = Shape::kEllipsoid;
  body.radii = scale * of_unit;
  body.pose.position = body.radii;
  body.anchors[0].z = 0.1 * body.radii[2];
  body.anchors[1].min[2] = 1.9 * body.radii[2];
}

/// Has the anchors hold it at their faces, which leave a cell's upper points free and its lower
/// ones not.
inline void hold_at_faces(Scene& scene) {
  scene.mpm.boundary = MpmBoundary::kSurface;
  Body& body = scene.bodies[0];
  body.anchors[0].z = 0.0017;
  body.anchors[1].min[2] = body.size[2] - 0.0017;
}

/// And two balls amid its sides, a fifth of its height in radius: at them rows have nodes in
/// common.
inline void hold_at_balls(Scene& scene) {
  Body& body = scene.bodies[0];
  for (const double y : {0.0, 1.0}) {
    Region ball;
    ball.kind = Region::Kind::kBall;
    ball.center = Vec3(0.5, y, 0.5).cwiseProduct(body.size);
    ball.radius = 0.2 * body.size[2];
    body.anchors.emplace_back(ball);
  }
}

/// The part of a height that is sheared and stretched: all of it, but where balls are held, which
/// keep their shape [m].
inline double deformed_height(const Body& body, double z) {
  if (body.anchors.size() < 3) return z;
  const Anchor& ball = body.anchors[2];
  const double reach = ball.radius + 2e-3, below = ball.center[2] - reach;
  return z - std::min(std::max(z - below, 0.0), 2 * reach);
}

/// Where these anchors are in the deformed body, and stay.
inline std::vector<AnchorMotion> stay_deformed(MpmState& state, double stretch) {
  const Body& body = state.scene.bodies[0];
  std::vector<AnchorMotion> motion;
  state.anchors.moves = true;
  for (std::size_t i = 0; i < body.anchors.size(); ++i) {
    const Anchor& a = body.anchors[i];
    const double z = i == 0 ? a.z : i == 1 ? a.min[2] : a.center[2];
    const double height = deformed_height(body, z) + 0.5 * state.scene.cell_size;
    const Vec3 moved = height * Vec3(0.3, 0, stretch);
    state.anchors.now[i].translation = moved;
    const Pose pose{body.anchors[i].origin() + moved, Quat::Identity()};
    motion.push_back({pose, pose});
  }
  find_held_nodes(state, state.anchors);
  return motion;
}

/// Stretch along z by this much and shear, and waves of some cells' length.
inline void deform(MpmState& state, double stretch) {
  const LatticeBody& b = state.bodies[0];
  const double h = b.cell_size;
  b.for_each_node([&](int node, int i, int j, int k) {
    const double x = i + 1, y = j + 1, z = k + 1;
    const double high = deformed_height(state.scene.bodies[0], z * h) / h;
    const double u[3] = {h * (0.3 * high + 0.1 * std::sin(0.4 * y)),
                         h * 0.1 * std::sin(0.5 * x + z),
                         h * (stretch * high + 0.1 * std::sin(0.3 * x))};
    for (int a = 0; a < 3; ++a) state.nodes.u[a][node] = static_cast<float>(u[a]);
  });
}

inline void add_probes(Scene& scene, std::vector<ToolMotion>& motions) {
  const Vec3 size = scene.bodies[0].size;
  scene.tools.resize(3);
  motions.resize(3);
  for (int i = 0; i < 3; ++i) {
    scene.tools[i].name = "probe" + std::to_string(i);
    // From the side: its tip one and a half millimetres deep in the face y = 0.
    ToolMotion& m = motions[i];
    m.present = true;
    m.begin.orientation = Quat::FromTwoVectors(Vec3::UnitZ(), Vec3::UnitY());
    m.begin.position = Vec3(0.25 * (i + 1) * size[0] + 0.15 * size[2], 0.0015, 0.5 * size[2]);
    m.end = m.begin;
  }
}

/// Largest ||F - R||, from the clouds' von Mises stress being no measure of it: on the host.
inline double largest_strain(const MpmState& s) {
  double largest = 0;
  const LatticeBody& b = s.bodies[0];
  for (int p = 0; p < s.points.size(); p += 1 + s.points.size() / 20000) {
    const Points::Site& site = s.points.site[p];
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    for (int k = 0; k < 27; ++k) {
      const int n = s.fields->node(b, site, k);
      const int i[3] = {k % 3, k / 3 % 3, k / 9}, t[3] = {site.x & 1, site.y & 1, site.z & 1};
      for (int a = 0; a < 3; ++a) {
        double w = 1 / b.cell_size;
        for (int c = 0; c < 3; ++c) {
          w *= c == a ? lattice_slope(t[c], i[c]) : lattice_weight(t[c], i[c]);
        }
        for (int c = 0; c < 3; ++c) F(c, a) += w * s.nodes.u[c][n];
      }
    }
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(F, Eigen::ComputeFullU | Eigen::ComputeFullV);
    largest = std::max(largest, (F - svd.matrixU() * svd.matrixV().transpose()).norm());
  }
  return largest;
}

/// A second material, viscosity, a limit at which it tears, and a scalpel beside it.
inline void add_options(Scene& scene, std::vector<ToolMotion>& motions) {
  Material other = scene.materials[0];
  other.name = "other";
  other.young_modulus *= 1.5;
  scene.materials.push_back(other);
  for (Material& m : scene.materials) {
    m.viscosity = 1;
    m.tear_stretch = 50;
  }
  const Vec3 size = scene.bodies[0].size;
  Inclusion ball;
  ball.material = other.name;
  ball.region.kind = Region::Kind::kBall;
  // Beside the cut: a facet of two materials is one on the CPU and two on the GPU.
  ball.region.center = Vec3(0.5, 0.22, 0.5).cwiseProduct(size);
  ball.region.radius = 0.15 * size[0];
  scene.bodies[0].inclusions.push_back(ball);
  scene.tools.emplace_back();
  scene.tools.back().name = "scalpel";
  scene.tools.back().type = ToolType::kScalpel;
  scene.tools.back().blade_length = 0.01;
  motions.emplace_back();
  ToolMotion& m = motions.back();
  m.present = true;
  m.begin.position = Vec3(size[0] + 0.15 * size[2] + 0.002, 0.5 * size[1], 0.5 * size[2]);
  m.end = m.begin;
}

/// By how much velocities of nodes differ, of all and of those with a thousandth of the heaviest
/// one's mass or more: nodes beside a cut have down to 1/64^3 of it, and whether a face touches
/// there is a matter of rounding.
struct Difference {
  double of_all = 0, of_heavy = 0, moved = 0;
};
/// Of the nodes of `a`; `b` may have more, for it numbers all of its box.
inline Difference difference(const MpmState& a, const MpmState& b) {
  Difference d;
  float heaviest = std::numeric_limits<float>::max();  // one over it
  for (const float one : a.nodes.inv_mass) {
    if (one > 0) heaviest = std::min(heaviest, one);
  }
  const auto compare = [&](int i, int j) {
    for (int c = 0; c < 3; ++c) {
      if (a.nodes.inv_mass[i] == 0) continue;
      const double off = std::fabs(a.nodes.v[c][i] - b.nodes.v[c][j]);
      d.of_all = std::max(d.of_all, off);
      if (a.nodes.inv_mass[i] < 1000 * heaviest) d.of_heavy = std::max(d.of_heavy, off);
      d.moved = std::max<double>(d.moved, std::fabs(a.nodes.v[c][i]));
    }
  };
  a.bodies[0].for_each_node(
      [&](int node, int x, int y, int z) { compare(node, b.bodies[0].node(x, y, z)); });
  const int split = lattice_node_count(a.bodies), other = lattice_node_count(b.bodies);
  for (int i = split; i < static_cast<int>(a.nodes.size()); ++i) compare(i, i - split + other);
  return d;
}

}  // namespace tissue_sim
