#include "pbd/internal_links.h"

#include <algorithm>

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

namespace {

/// Links that end at a vertex, while others near it have fewer.
constexpr int kMost = 3;
/// Of vertices around it, in which those are looked for.
constexpr int kRings = 20;

/// Looks for the next vertex with room for a link.
class Neighbours {
 public:
  explicit Neighbours(const TriangleMesh& mesh)
      : mesh_(mesh), around_(mesh.vertices.size()), seen_(mesh.vertices.size(), -1) {
    for (const auto& t : mesh.triangles) {
      for (int k = 0; k < 3; ++k) around_[t[k]].push_back(t[(k + 1) % 3]);
    }
  }
  /// Of the first ring of vertices around `centre` where any but `from` has fewer than kMost the
  /// one of these that is nearest to the place; `centre` where none has.
  int nearest_with_room(int from, int centre, const Vec3& place, const std::vector<int>& count) {
    ++round_;
    seen_[centre] = round_;
    std::vector<int> ring = {centre};
    int best = centre;
    for (int k = 0; k < kRings && best == centre && !ring.empty(); ++k) {
      std::vector<int> next;
      double least = 1e300;
      for (const int v : ring) {
        for (const int w : around_[v]) {
          if (seen_[w] == round_) continue;
          seen_[w] = round_;
          next.push_back(w);
          const double d = (mesh_.vertices[w] - place).squaredNorm();
          if (w == from || count[w] >= kMost || d >= least) continue;
          least = d;
          best = w;
        }
      }
      ring.swap(next);
    }
    return best;
  }

 private:
  const TriangleMesh& mesh_;
  std::vector<std::vector<int>> around_;
  std::vector<int> seen_;
  int round_ = 0;
};

}  // namespace

std::vector<InternalLink> find_internal_links(const TriangleMesh& mesh,
                                              const std::vector<int>& starts,
                                              const std::vector<Vec3>& lean, double least_depth) {
  const std::vector<Vec3> normals = vertex_normals(mesh);
  const RayTree tree(mesh);
  std::vector<InternalLink> links;
  // Where rays meet, as at the ends of an ellipsoid, one vertex would get forty links, each a
  // colour of its own: those around it take the rest.
  std::vector<int> count(mesh.vertices.size(), 0);
  Neighbours neighbours(mesh);
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const int v = starts[i];
    if (normals[v].isZero()) continue;
    const Vec3 way = lean.empty() ? Vec3(-normals[v]) : Vec3((lean[i] - normals[v]).normalized());
    const RayHit hit = tree.first_exit(mesh.vertices[v], way, v, least_depth);
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
    if (count[nearest] >= kMost) nearest = neighbours.nearest_with_room(v, nearest, place, count);
    ++count[nearest];
    links.push_back(
        {v, nearest, hit.along, tree.is_gap_between(mesh.vertices[v], mesh.vertices[nearest])});
  }
  return links;
}

}  // namespace pbd
}  // namespace tissue_sim
