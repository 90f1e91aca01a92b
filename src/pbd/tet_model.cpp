// The tetrahedral model: a material, or strain with distance and bending, the paper's baseline.
#include <cmath>
#include <map>

#include "geometry/tet_mesh.h"
#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {

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
  for (const auto& t : boundary(mesh)) {
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
