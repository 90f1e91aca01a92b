#include "pbd/internal_links.h"

#include "geometry/ray_tree.h"

namespace tissue_sim {
namespace pbd {

std::vector<Vec3> vertex_normals(const TriangleMesh& mesh) {
  std::vector<Vec3> normals(mesh.vertices.size(), Vec3::Zero());
  for (const auto& t : mesh.triangles) {
    const Vec3 n = (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                       .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
    for (const int v : t) normals[v] += n;
  }
  for (Vec3& n : normals) n = n.stableNormalized();
  return normals;
}

std::vector<InternalLink> find_internal_links(const TriangleMesh& mesh,
                                              const std::vector<int>& starts,
                                              const std::vector<Vec3>& lean) {
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const RayTree tree(mesh);
  std::vector<InternalLink> links;
  // Where rays meet, as at the ends of an ellipsoid, one vertex would get forty links, each a
  // colour of its own: others of the triangle take the rest.
  constexpr int kMost = 6;
  std::vector<int> count(mesh.vertices.size(), 0);
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const int v = starts[i];
    if (normals[v].isZero()) continue;
    const Vec3 way = lean.empty() ? Vec3(-normals[v]) : Vec3((lean[i] - normals[v]).normalized());
    const RayHit hit = tree.first_exit(mesh.vertices[v], way, v, 0);
    if (hit.triangle < 0) continue;
    const Vec3 place = mesh.vertices[v] + hit.along * way;
    int nearest = -1;
    double least = 1e300;
    for (const int corner : mesh.triangles[hit.triangle]) {
      const double d = (mesh.vertices[corner] - place).squaredNorm();
      if (d < least) {
        least = d;
        nearest = corner;
      }
    }
    for (const int corner : mesh.triangles[hit.triangle]) {
      if (count[nearest] >= kMost && count[corner] < count[nearest]) nearest = corner;
    }
    ++count[nearest];
    links.push_back({v, nearest, hit.along});
  }
  return links;
}

}  // namespace pbd
}  // namespace tissue_sim
