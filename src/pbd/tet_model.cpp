// The tetrahedral model: a material, or strain with distance and bending, the paper's baseline.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "geometry/tet_mesh.h"
#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {

namespace {

/// Flat quadrangles of the boundary that are split along both diagonals: hexahedra in five
/// tetrahedra each, of which neighbours were not mirrored, hang together at corners alone.
int mismatched_faces(const TetMesh& mesh, const std::vector<std::array<int, 3>>& triangles) {
  std::map<std::pair<int, int>, std::vector<int>> opposite;  // of each edge
  for (const auto& t : triangles) {
    for (int i = 0; i < 3; ++i) {
      const int a = t[i], c = t[(i + 1) % 3];
      opposite[{std::min(a, c), std::max(a, c)}].push_back(t[(i + 2) % 3]);
    }
  }
  std::map<std::array<int, 4>, std::set<std::pair<int, int>>> diagonals;
  for (const auto& [edge, across] : opposite) {
    const Vec3 &a = mesh.vertices[edge.first], e = mesh.vertices[edge.second] - a;
    for (std::size_t i = 0; i < across.size(); ++i) {
      for (std::size_t j = i + 1; j < across.size(); ++j) {
        if (across[i] == across[j]) continue;
        const Vec3 n = e.cross(mesh.vertices[across[i]] - a),
                   m = e.cross(mesh.vertices[across[j]] - a);
        if (n.dot(m) > -0.99 * n.norm() * m.norm()) continue;  // no quadrangle, or a bent one
        std::array<int, 4> corners = {edge.first, edge.second, across[i], across[j]};
        std::sort(corners.begin(), corners.end());
        diagonals[corners].insert(edge);
      }
    }
  }
  return static_cast<int>(std::count_if(diagonals.begin(), diagonals.end(),
                                        [](const auto& d) { return d.second.size() > 1; }));
}

}  // namespace

void add_tet_body(State& s, int b, std::vector<std::string>* notes) {
  const TetMesh mesh = load_tets(s.scene.bodies[b], s.scene.cell_size, notes);
  const std::vector<int> order = morton_order(mesh.vertices);
  std::vector<int> index(order.size());
  for (const int v : order) index[v] = add_vertex(s, mesh.vertices[v], b);
  std::vector<Vec3> centres;
  for (const auto& t : mesh.tetrahedra) {
    Vec3 c = Vec3::Zero();
    for (const int v : t) c += 0.25 * mesh.vertices[v];
    centres.push_back(c);
  }
  for (const int k : morton_order(centres)) {
    const auto& t = mesh.tetrahedra[k];
    s.tetrahedra.push_back({index[t[0]], index[t[1]], index[t[2]], index[t[3]]});
  }
  const std::vector<std::array<int, 3>> skin = boundary(mesh);
  const int mismatched = mismatched_faces(mesh, skin);
  if (mismatched > 0 && notes != nullptr) {
    notes->push_back("body '" + s.scene.bodies[b].name + "': its tetrahedra do not match at " +
                     std::to_string(mismatched) + (mismatched == 1 ? " face" : " faces") +
                     " of hexahedra, each split along one diagonal on one side and along the other "
                     "on the other: they hang together at corners alone there, and a cut along "
                     "such a face breaks nothing; mirror every other hexahedron");
  }
  for (const auto& t : skin) {
    s.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
    s.cut.push_back(0);
    for (const int v : t) s.vertices.surface[index[v]] = 1;
  }
  s.volume_of_body.push_back(volume(mesh));
}

void make_tet_constraints(State& s) {
  const auto& x = s.vertices.reference;
  const PbdOptions& pbd = s.scene.pbd;
  const bool is_material = pbd.elasticity == PbdElasticity::kMaterial;
  const bool again = s.elastics.size() + s.strains.size() > 0;
  if (again) {  // after a cut: the same tetrahedra, of which some have other vertices
    const auto follow = [&s](auto& set) {
      for (int t = 0; t < set.size(); ++t) {
        if (set.vertices[t] != s.tetrahedra[t]) set.colour[t] = -1;
        set.vertices[t] = s.tetrahedra[t];
      }
    };
    follow(s.elastics);
    follow(s.strains);
  }
  for (std::size_t i = 0; i < s.tetrahedra.size(); ++i) {
    const Tetrahedron& t = s.tetrahedra[i];
    Eigen::Matrix3d q;
    Vec3 centre = 0.25 * x[t[0]];
    for (int k = 0; k < 3; ++k) {
      q.col(k) = x[t[k + 1]] - x[t[0]];
      centre += 0.25 * x[t[k + 1]];
    }
    const Eigen::Matrix3d inverse = q.inverse();
    const auto fill = [&inverse](auto& number) {
      for (int r = 0; r < 3; ++r) {
        for (int c = 0; c < 3; ++c) number[3 * r + c] = static_cast<float>(inverse(r, c));
      }
    };
    if (!is_material) {
      std::array<float, Strain::kNumbers> number;
      fill(number);
      number[9] = static_cast<float>(pbd.stretch);
      number[10] = static_cast<float>(pbd.shear);
      if (again) {
        s.strains.numbers[i] = number;
      } else {
        s.strains.add(t, number);
      }
      continue;
    }
    const Material& m = material_at(s.scene, s.scene.bodies[s.vertices.body[t[0]]], centre);
    const double volume = q.determinant() / 6;
    // Of small strains the two are worth mu |dev e|^2 + K / 2 (tr e)^2.
    const double mu = lame_mu(m), bulk = lame_lambda(m) + 2 * mu / 3;
    std::array<float, Elastic::kNumbers> number;
    fill(number);
    number[9] = static_cast<float>(1 / (mu * volume));
    number[10] = static_cast<float>(1 / (bulk * volume));
    if (again) {
      s.elastics.numbers[i] = number;
    } else {
      s.elastics.add(t, number);
    }
  }
}

}  // namespace pbd
}  // namespace tissue_sim
