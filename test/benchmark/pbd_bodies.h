// What the rows of position-based dynamics project.
#pragma once

#include <algorithm>
#include <random>
#include <vector>

#include "pbd/model.h"
#include "tissue_sim/simulation.h"

namespace tissue_sim {

/// Vertices as a file might have them, in no order, brought into that of the package.
inline std::vector<int> add_shuffled(pbd::State& s, const std::vector<Vec3>& places) {
  std::vector<int> shuffled(places.size());
  for (std::size_t i = 0; i < places.size(); ++i) shuffled[i] = static_cast<int>(i);
  std::shuffle(shuffled.begin(), shuffled.end(), std::mt19937(1));
  std::vector<Vec3> file;
  for (const int i : shuffled) file.push_back(places[i]);
  std::vector<int> index(places.size());
  for (const int k : pbd::morton_order(file)) {
    index[shuffled[k]] = pbd::add_vertex(s, file[k], 0);
    s.vertices.mass.back() = 1e-6;
  }
  return index;
}

/// Moves all vertices aside a little: no constraint is met.
inline void disturb(pbd::State& s) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> aside(-2e-4f, 2e-4f);
  for (int i = 0; i < s.vertices.size(); ++i) {
    for (int a = 0; a < 3; ++a) s.vertices.x[4 * i + a] += aside(random);
  }
}

/// A lattice of some n^3 vertices, each joined to seven others, about 7 n^3 links.
inline void add_links_of_lattice(pbd::State& s, int n) {
  std::vector<Vec3> places;
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) places.push_back(0.001 * Vec3(i, j, k));
    }
  }
  const std::vector<int> index = add_shuffled(s, places);
  const auto at = [&](int i, int j, int k) { return index[(k * n + j) * n + i]; };
  constexpr int kTo[7][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 0},
                             {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
  std::vector<std::array<std::int32_t, 2>> pairs;
  for (int k = 0; k < n; ++k) {
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) {
        for (const auto& d : kTo) {
          if (i + d[0] >= n || j + d[1] >= n || k + d[2] >= n) continue;
          const int a = at(i, j, k), b = at(i + d[0], j + d[1], k + d[2]);
          pairs.push_back({std::min(a, b), std::max(a, b)});
        }
      }
    }
  }
  std::sort(pairs.begin(), pairs.end());
  for (const auto& p : pairs) {
    const double length = (s.vertices.reference[p[0]] - s.vertices.reference[p[1]]).norm();
    s.links.add(p, {static_cast<float>(length), 0.01f});
  }
  pbd::pack(s);
  disturb(s);
}

/// A cube of 5 cm of tetrahedra without other constraints.
inline Scene tetrahedra_alone(PbdElasticity elasticity, double edge) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.cell_size = edge;
  scene.pbd.model = PbdModel::kTetrahedra;
  scene.pbd.elasticity = elasticity;
  scene.pbd.edge = scene.pbd.bending = 0;
  scene.bodies.resize(1);
  scene.bodies[0].size = Vec3(0.05, 0.05, 0.05);
  return scene;
}

}  // namespace tissue_sim
