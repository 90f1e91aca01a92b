// The bodies that are measured on the CPU.
#pragma once

#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "cut_scenes.h"

namespace tissue_sim {

/// What a row measures.
struct Case {
  int points;
  Law law = Law::kFixedCorotated;
  bool ground = false;
  bool scalpel = false;         ///< it is cut in each iteration, and nothing else is measured
  std::vector<Vec3> cuts = {};  ///< normals of planes through the middle
  double viscosity = 0;
  int threads = 0;
  bool tears = false;  ///< looks for tears as often as a frame would, and finds none
  int anchors = 0;     ///< regions that hold it
  int materials = 1;   ///< spread through it in balls
  bool both_laws = false;
  bool ring = false;  ///< a slanting ring that fills a tenth of its box, not a cube
  MpmBoundary boundary = MpmBoundary::kLattice;  ///< what most figures were measured with
};

/// Fills the body with balls, four or five along each edge, of `count` materials in turn.
inline void add_materials(const Case& c, double edge, Scene& scene) {
  const int along = 2 * static_cast<int>(std::cbrt(c.materials)) + 1;
  for (int i = 1; i < c.materials; ++i) {
    Material m = scene.materials[0];
    m.name += std::to_string(i);
    m.young_modulus *= 1 + 0.1 * i;
    m.density *= 1 + 0.02 * i;
    if (c.both_laws && i % 2 == 1) m.law = Law::kNeoHookean;
    scene.materials.push_back(m);
  }
  for (int i = 0; i < along * along * along; ++i) {
    Inclusion ball;
    ball.material = scene.materials[i % c.materials].name;
    ball.region.kind = Region::Kind::kBall;
    ball.region.center =
        edge / along * Vec3(i % along + 0.5, i / along % along + 0.5, i / along / along + 0.5);
    ball.region.radius = 0.55 * edge / along;
    scene.bodies[0].inclusions.push_back(ball);
  }
}

/// Writes a ring of radius 1 and thickness 0.24 around the z axis; returns its path.
inline std::string ring_mesh() {
  const std::string path = "/tmp/tissue_sim_benchmark_" + std::to_string(getpid()) + ".obj";
  std::ofstream file(path);
  constexpr int kAround = 96, kAcross = 32;
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const double a = 2 * M_PI * i / kAround, b = 2 * M_PI * j / kAcross;
      const double r = 1 + 0.24 * std::cos(b);
      file << "v " << r * std::cos(a) << " " << r * std::sin(a) << " " << 0.24 * std::sin(b)
           << "\n";
    }
  }
  for (int i = 0; i < kAround; ++i) {
    for (int j = 0; j < kAcross; ++j) {
      const int k = (i + 1) % kAround, l = (j + 1) % kAcross;
      file << "f " << i * kAcross + j + 1 << " " << k * kAcross + j + 1 << " "
           << k * kAcross + l + 1 << "\nf " << i * kAcross + j + 1 << " " << k * kAcross + l + 1
           << " " << i * kAcross + l + 1 << "\n";
    }
  }
  return path;
}

/// A body of about so many points, eight a cell, sheared, twisted and shaken.
inline std::unique_ptr<MpmTissue> deformed_body(const Case& c) {
  const double h = 0.003;
  const double edge = std::round(std::cbrt(c.points / 8.0)) * h;
  Scene scene = free_box(Vec3::Constant(edge), h);
  scene.threads = c.threads;
  scene.ground.enabled = c.ground;
  scene.mpm.boundary = c.boundary;
  Material m;
  m.name = "cube";
  m.law = c.law;
  m.viscosity = c.viscosity;
  m.tear_stretch = c.tears ? 50 : 0;
  scene.materials.push_back(m);
  Body& body = scene.bodies[0];
  body.material = "cube";
  for (int i = 0; i < c.anchors; ++i) {
    Region held;
    held.kind = Region::Kind::kBall;
    held.center = edge * Vec3(i % 10 / 9.0, i / 10 / 9.0, 0);
    held.radius = 1.5 * h;
    body.anchors.push_back(held);
  }
  if (c.materials > 1) add_materials(c, edge, scene);
  if (c.ring) {
    body.shape = Shape::kMesh;
    body.mesh = ring_mesh();
    body.scale = edge / std::cbrt(2 * M_PI * M_PI * 0.24 * 0.24);  // of the same volume
    body.pose.orientation = Quat(Eigen::AngleAxisd(0.7, Vec3(1, 1, 0).normalized()));
  }
  if (c.scalpel) {
    Tool scalpel;
    scalpel.name = "scalpel";
    scalpel.type = ToolType::kScalpel;
    scalpel.blade_length = 0.2;
    scene.tools.push_back(scalpel);
  }
  auto tissue = std::make_unique<MpmTissue>(scene);
  deform(tissue->state());
  if (c.ring) std::remove(body.mesh.c_str());
  for (const Vec3& normal : c.cuts) {
    // Off the cells' faces, so that there are cells on both sides.
    cut_now(*tissue, plane_cut(Vec3::Constant(0.5 * edge + 0.02 * h), normal));
  }
  shake(tissue->state(), 1, 0.01 * h);
  return tissue;
}

}  // namespace tissue_sim
