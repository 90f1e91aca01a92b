#include <algorithm>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <stdexcept>

#include "geometry/surface.h"
#include "geometry/tet_mesh.h"

namespace tissue_sim {
namespace {

using Edge = std::pair<int, int>;
using EdgeTriangles = std::map<Edge, std::vector<int>>;

Edge edge_of(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

EdgeTriangles edges_of(const TriangleMesh& mesh) {
  EdgeTriangles edges;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& c = mesh.triangles[t];
    for (int i = 0; i < 3; ++i) edges[edge_of(c[i], c[(i + 1) % 3])].push_back(static_cast<int>(t));
  }
  return edges;
}

/// Whether triangle c runs along the edge from its lower vertex to its higher one.
bool runs_up(const std::array<int, 3>& c, const Edge& e) {
  for (int i = 0; i < 3; ++i) {
    if (c[i] == e.first && c[(i + 1) % 3] == e.second) return true;
  }
  return false;
}

std::string count(int n, const char* one, const char* many) {
  return std::to_string(n) + " " + (n == 1 ? one : many);
}

void drop_triangles(TriangleMesh& mesh, std::vector<std::string>& notes) {
  std::set<std::array<int, 3>> seen;
  std::vector<std::array<int, 3>> kept;
  int flat = 0, twice = 0;
  for (const auto& t : mesh.triangles) {
    const Vec3 e1 = mesh.vertices[t[1]] - mesh.vertices[t[0]];
    const Vec3 e2 = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    if (!(e1.cross(e2).norm() > 1e-9 * std::max(e1.squaredNorm(), e2.squaredNorm()))) {
      ++flat;
      continue;
    }
    std::array<int, 3> sorted = t;
    std::sort(sorted.begin(), sorted.end());
    if (!seen.insert(sorted).second) {
      ++twice;
      continue;
    }
    kept.push_back(t);
  }
  mesh.triangles.swap(kept);
  if (flat > 0)
    notes.push_back("left out " + count(flat, "triangle", "triangles") + " without area");
  if (twice > 0) {
    notes.push_back("left out " + count(twice, "triangle", "triangles") + " given twice");
  }
  std::vector<int> index(mesh.vertices.size(), -1);
  std::vector<Vec3> used;
  for (auto& t : mesh.triangles) {
    for (int& v : t) {
      if (index[v] < 0) {
        index[v] = static_cast<int>(used.size());
        used.push_back(mesh.vertices[v]);
      }
      v = index[v];
    }
  }
  const int unused = static_cast<int>(mesh.vertices.size() - used.size());
  if (unused > 0) {
    notes.push_back("left out " + count(unused, "vertex", "vertices") + " that no triangle has");
  }
  mesh.vertices.swap(used);
}

/// Turns triangles so that those that share an edge by two face the same way, then regions
/// outwards.
int turn_triangles(TriangleMesh& mesh, const EdgeTriangles& edges) {
  const int n = static_cast<int>(mesh.triangles.size());
  std::vector<int> region(n, -1);
  std::vector<bool> turned(n, false);
  std::vector<int> order;
  int turns = 0;
  for (int start = 0; start < n; ++start) {
    if (region[start] >= 0) continue;
    order.assign(1, start);
    region[start] = start;
    for (std::size_t k = 0; k < order.size(); ++k) {
      const int t = order[k];
      const auto c = mesh.triangles[t];
      for (int i = 0; i < 3; ++i) {
        const Edge e = edge_of(c[i], c[(i + 1) % 3]);
        const std::vector<int>& both = edges.at(e);
        if (both.size() != 2) continue;
        const int other = both[0] == t ? both[1] : both[0];
        if (region[other] >= 0) continue;
        region[other] = start;
        if (runs_up(mesh.triangles[other], e) == runs_up(c, e)) {
          std::swap(mesh.triangles[other][1], mesh.triangles[other][2]);
          turned[other] = true;
        }
        order.push_back(other);
      }
    }
    Vec3 centre = Vec3::Zero();
    for (const int t : order) centre += mesh.vertices[mesh.triangles[t][0]] / order.size();
    double volume = 0;
    for (const int t : order) {
      const auto& c = mesh.triangles[t];
      volume += (mesh.vertices[c[0]] - centre)
                    .dot((mesh.vertices[c[1]] - centre).cross(mesh.vertices[c[2]] - centre));
    }
    const bool inwards = volume < 0;
    for (const int t : order) {
      if (inwards) {
        std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
        turned[t] = !turned[t];
      }
      turns += turned[t] ? 1 : 0;
    }
  }
  return turns;
}

int part_count(const TriangleMesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](int i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  int parts = static_cast<int>(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    for (const int v : {t[1], t[2]}) {
      const int a = root(t[0]), b = root(v);
      if (a == b) continue;
      parent[b] = a;
      --parts;
    }
  }
  return parts;
}

}  // namespace

SurfaceKind tidy_surface(TriangleMesh& mesh, std::vector<std::string>& notes) {
  drop_triangles(mesh, notes);
  if (mesh.triangles.empty()) throw std::invalid_argument("has no triangle with an area");
  const EdgeTriangles edges = edges_of(mesh);
  SurfaceKind kind;
  for (const auto& [e, of] : edges) {
    kind.open_edges += of.size() == 1 ? 1 : 0;
    kind.crowded_edges += of.size() > 2 ? 1 : 0;
  }
  const int turned = turn_triangles(mesh, edges);
  if (turned > 0) {
    const bool all = turned == static_cast<int>(mesh.triangles.size());
    notes.push_back(all ? "was inside out and is turned around"
                        : "had " + count(turned, "triangle", "triangles") +
                              " that faced the wrong way, now turned");
  }
  kind.parts = part_count(mesh);
  if (kind.open_edges > 0) {
    notes.push_back("is open: " + count(kind.open_edges, "edge has", "edges have") +
                    " one triangle only");
  }
  if (kind.crowded_edges > 0) {
    notes.push_back("is no manifold: " + count(kind.crowded_edges, "edge has", "edges have") +
                    " more than two triangles, which get no bending constraint");
  }
  if (kind.parts > 1) notes.push_back("is in " + std::to_string(kind.parts) + " parts");
  return kind;
}

TriangleMesh load_surface(const Body& body, SurfaceKind& kind, std::vector<std::string>* notes) {
  const std::string prefix = "body '" + body.name + "': ";
  std::string what = "mesh " + body.mesh;
  try {
    const std::string path = std::filesystem::absolute(resolve_path(body.mesh, "mesh")).string();
    what = "mesh " + path;
    if (is_tet_file(path)) {
      throw std::invalid_argument(what +
                                  " is of a volume, which method pbd takes with model: tetrahedra, "
                                  "mls as nodes, and mpm by its surface: set one of them, or give "
                                  "an STL, OBJ, PLY or OFF file");
    }
    TriangleMesh mesh = read_mesh(path);
    std::vector<std::string> found;
    check_size(what, mesh.vertices, body, found);
    try {
      kind = tidy_surface(mesh, found);
    } catch (const std::invalid_argument& e) {
      throw std::invalid_argument(what + " " + e.what());
    }
    const Eigen::Matrix3d rotation = body.pose.orientation.normalized().toRotationMatrix();
    for (Vec3& v : mesh.vertices) v = rotation * (body.scale * v) + body.pose.position;
    for (const std::string& note : found) {
      if (notes != nullptr) notes->push_back(prefix + what + " " + note);
    }
    return mesh;
  } catch (const std::invalid_argument& e) {
    const std::string text = e.what();
    throw std::invalid_argument(text.rfind(prefix, 0) == 0 ? text : prefix + text);
  }
}

}  // namespace tissue_sim
