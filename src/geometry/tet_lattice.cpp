// Tetrahedra of the body-centred cubic lattice: points at the corners and centres of cubes; each
// edge of the face between two centres makes a tetrahedron with them.
#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "geometry/ray_tree.h"
#include "geometry/tet_mesh.h"
#include "scene/scene_text.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

void add_positive(TetMesh& mesh, int a, int b, int c, int d) {
  mesh.tetrahedra.push_back({a, b, c, d});
  if (volume(mesh, static_cast<int>(mesh.tetrahedra.size()) - 1) < 0) {
    std::swap(mesh.tetrahedra.back()[2], mesh.tetrahedra.back()[3]);
  }
}

/// Cubes in a box: corners first, then centres.
struct Cubes {
  std::array<int, 3> n;
  int corner(int x, int y, int z) const { return (z * (n[1] + 1) + y) * (n[0] + 1) + x; }
  int corners() const { return (n[0] + 1) * (n[1] + 1) * (n[2] + 1); }
  int centre(int x, int y, int z) const { return corners() + (z * n[1] + y) * n[0] + x; }
  int points() const { return corners() + n[0] * n[1] * n[2]; }

  /// Calls f(corners of the face in turn, centre below, centre above) for each face; -1 for a
  /// centre outside.
  template <class F>
  void for_faces(const F& f) const {
    for (int axis = 0; axis < 3; ++axis) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      std::array<int, 3> i;
      for (i[axis] = 0; i[axis] <= n[axis]; ++i[axis]) {
        for (i[u] = 0; i[u] < n[u]; ++i[u]) {
          for (i[v] = 0; i[v] < n[v]; ++i[v]) {
            std::array<int, 4> ring;
            for (int k = 0; k < 4; ++k) {
              std::array<int, 3> c = i;
              c[u] += k == 1 || k == 2 ? 1 : 0;
              c[v] += k >= 2 ? 1 : 0;
              ring[k] = corner(c[0], c[1], c[2]);
            }
            std::array<int, 3> below = i;
            --below[axis];
            f(ring, i[axis] > 0 ? centre(below[0], below[1], below[2]) : -1,
              i[axis] < n[axis] ? centre(i[0], i[1], i[2]) : -1, i[0] + i[1] + i[2]);
          }
        }
      }
    }
  }
  std::vector<Vec3> places(const Vec3& origin, const Vec3& cube) const {
    std::vector<Vec3> x(points());
    for (int k = 0; k <= n[2]; ++k) {
      for (int j = 0; j <= n[1]; ++j) {
        for (int i = 0; i <= n[0]; ++i) {
          x[corner(i, j, k)] = origin + cube.cwiseProduct(Vec3(i, j, k));
          if (i < n[0] && j < n[1] && k < n[2]) {
            x[centre(i, j, k)] = origin + cube.cwiseProduct(Vec3(i + 0.5, j + 0.5, k + 0.5));
          }
        }
      }
    }
    return x;
  }
};

/// Moves lattice points onto the surface and cuts tetrahedra there.
class Stuffing {
 public:
  Stuffing(const TriangleMesh& surface, double edge) : tree_(surface), edge_(edge) {
    Box box;
    for (const Vec3& v : surface.vertices) {
      box.min = box.min.cwiseMin(v);
      box.max = box.max.cwiseMax(v);
    }
    const Vec3 origin = box.min - Vec3(0.51, 0.53, 0.57) * edge;
    for (int a = 0; a < 3; ++a) {
      const double cubes = std::ceil((box.max[a] + 0.51 * edge - origin[a]) / edge);
      if (!(cubes < 1000)) {
        throw std::invalid_argument(
            "is more than 1000 cells of cell_size long: make cell_size larger");
      }
      cubes_.n[a] = static_cast<int>(cubes);
    }
    const double points = 2.0 * cubes_.n[0] * cubes_.n[1] * cubes_.n[2];
    if (!(points <= std::min(5e7, static_cast<double>(work_limits().max_points)))) {
      throw TooLarge("takes " + text(points) +
                     " points of a lattice, too many: make cell_size larger");
    }
    mesh_.vertices = cubes_.places(origin, Vec3::Constant(edge));
    sign_.resize(mesh_.vertices.size());
    const Vec3 direction = Vec3(0.8711, 0.3917, 0.2963).normalized();
    for (std::size_t i = 0; i < sign_.size(); ++i) {
      if (i % 256 == 0) stop_if_asked();
      sign_[i] = tree_.winding(mesh_.vertices[i], direction) > 0 ? 1 : -1;
    }
  }

  TetMesh stuff() {
    std::vector<std::array<int, 4>> lattice;
    cubes_.for_faces([&](const std::array<int, 4>& ring, int below, int above, int) {
      if (below < 0 || above < 0) return;
      for (int k = 0; k < 4; ++k) {
        const std::array<int, 4> t = {below, above, ring[k], ring[(k + 1) % 4]};
        if (std::any_of(t.begin(), t.end(), [this](int v) { return sign_[v] > 0; })) {
          lattice.push_back(t);
        }
      }
    });
    // What reaches across a gap goes: it would join its sides.
    lattice.erase(std::remove_if(lattice.begin(), lattice.end(),
                                 [this](const auto& t) { return spans_gap(t); }),
                  lattice.end());
    for (const auto& t : lattice) {
      for (int i = 0; i < 4; ++i) {
        for (int j = i + 1; j < 4; ++j) find_cut(t[i], t[j]);
      }
    }
    warp();
    for (const auto& t : lattice) fill(t);
    return finish();
  }

 private:
  using Edge = std::pair<int, int>;
  static Edge edge_of(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

  bool spans_gap(const std::array<int, 4>& t) {
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) {
        if (sign_[t[i]] <= 0 || sign_[t[j]] <= 0) continue;
        const auto [at, is_new] = is_gap_.try_emplace(edge_of(t[i], t[j]), false);
        if (is_new) {
          at->second = tree_.is_gap_between(mesh_.vertices[at->first.first],
                                            mesh_.vertices[at->first.second]);
        }
        if (at->second) return true;
      }
    }
    return false;
  }

  void find_cut(int a, int b) {
    if (sign_[a] * sign_[b] >= 0 || cuts_.count(edge_of(a, b)) != 0) return;
    const int in = sign_[a] > 0 ? a : b, out = sign_[a] > 0 ? b : a;
    const Vec3 way = mesh_.vertices[out] - mesh_.vertices[in];
    const RayHit hit = tree_.first_exit(mesh_.vertices[in], way, -1, 0);
    // A sign that a grazing ray got wrong leaves an edge without a crossing: halfway it is then.
    const double at = hit.triangle >= 0 && hit.along <= 1 ? hit.along : 0.5;
    cuts_[edge_of(a, b)] = mesh_.vertices[in] + at * way;
  }

  /// Points that have a cut nearby move onto it: no tetrahedron gets thin.
  void warp() {
    std::map<int, std::vector<Edge>> of;
    for (const auto& [e, x] : cuts_) {
      of[e.first].push_back(e);
      of[e.second].push_back(e);
    }
    for (const auto& [v, edges] : of) {
      double least = 1e300;
      Vec3 to = Vec3::Zero();
      for (const Edge& e : edges) {
        const auto cut = cuts_.find(e);
        if (cut == cuts_.end()) continue;  // its other end has moved onto the surface
        const bool is_long = (e.first < cubes_.corners()) == (e.second < cubes_.corners());
        const double length = is_long ? edge_ : std::sqrt(0.75) * edge_;
        const double d = (cut->second - mesh_.vertices[v]).norm();
        if (d < (is_long ? 0.24999 : 0.41189) * length && d < least) {
          least = d;
          to = cut->second;
        }
      }
      if (least > 1e299) continue;
      mesh_.vertices[v] = to;
      sign_[v] = 0;
      for (const Edge& e : edges) cuts_.erase(e);
    }
  }

  int cut_vertex(int a, int b) {
    const Edge e = edge_of(a, b);
    const auto [at, is_new] =
        vertex_of_cut_.try_emplace(e, static_cast<int>(mesh_.vertices.size()));
    if (is_new) mesh_.vertices.push_back(cuts_.at(e));
    return at->second;
  }

  /// The inside part of a lattice tetrahedron. Of the two diagonals of a face with two inside
  /// corners both neighbours take that from the lower one.
  void fill(const std::array<int, 4>& t) {
    std::vector<int> in, on, out;
    for (const int v : t) (sign_[v] > 0 ? in : sign_[v] == 0 ? on : out).push_back(v);
    std::sort(in.begin(), in.end());
    if (in.empty()) return;
    if (out.empty()) return add_positive(mesh_, t[0], t[1], t[2], t[3]);
    if (in.size() == 1) {
      std::vector<int> far = on;
      for (const int o : out) far.push_back(cut_vertex(in[0], o));
      return add_positive(mesh_, in[0], far[0], far[1], far[2]);
    }
    if (in.size() == 2 && out.size() == 1) {  // a pyramid over the apex on[0]
      const int p = cut_vertex(in[0], out[0]), q = cut_vertex(in[1], out[0]);
      add_positive(mesh_, in[0], in[1], q, on[0]);
      return add_positive(mesh_, in[0], q, p, on[0]);
    }
    // Prisms: a triangle at either end, with the lower ends first.
    std::array<int, 3> low, high;
    if (in.size() == 2) {
      low = {in[0], cut_vertex(in[0], out[0]), cut_vertex(in[0], out[1])};
      high = {in[1], cut_vertex(in[1], out[0]), cut_vertex(in[1], out[1])};
      // Faces in[0], in[1] and cuts: diagonals from in[0].
      add_positive(mesh_, low[0], high[0], high[1], high[2]);
      add_positive(mesh_, low[0], low[1], high[1], high[2]);
      return add_positive(mesh_, low[0], low[1], low[2], high[2]);
    }
    low = {in[0], in[1], in[2]};
    for (int i = 0; i < 3; ++i) high[i] = cut_vertex(in[i], out[0]);
    add_positive(mesh_, low[0], high[0], high[1], high[2]);
    add_positive(mesh_, low[0], low[1], high[1], high[2]);
    add_positive(mesh_, low[0], low[1], low[2], high[2]);
  }

  TetMesh finish() {
    std::vector<std::array<int, 4>> kept;
    const double least = 1e-5 * edge_ * edge_ * edge_;
    for (std::size_t t = 0; t < mesh_.tetrahedra.size(); ++t) {
      if (volume(mesh_, static_cast<int>(t)) > least) kept.push_back(mesh_.tetrahedra[t]);
    }
    mesh_.tetrahedra.swap(kept);
    if (mesh_.tetrahedra.empty()) {
      throw std::invalid_argument("has no inside for cells of this size: make cell_size smaller");
    }
    std::vector<std::string> notes;
    check_tets(mesh_, notes);  // drops what lies outside
    return std::move(mesh_);
  }

  RayTree tree_;
  double edge_;
  Cubes cubes_;
  TetMesh mesh_;
  std::vector<int> sign_;  // 1 inside, 0 on the surface, -1 outside
  std::map<Edge, Vec3> cuts_;
  std::map<Edge, bool> is_gap_;
  std::map<Edge, int> vertex_of_cut_;
};

}  // namespace

TetMesh tetrahedralize_box(const Vec3& size, double edge) {
  Cubes cubes;
  Vec3 cube;
  const double points = 2 * (size / edge).prod();
  if (!(points <= std::min(5e7, static_cast<double>(work_limits().max_points)))) {
    throw TooLarge("a box of " + text(size) + " m takes " + text(points) +
                   " vertices, too many: raise cell_size");
  }
  for (int a = 0; a < 3; ++a) {
    cubes.n[a] = std::max(1, static_cast<int>(std::lround(size[a] / edge)));
    cube[a] = size[a] / cubes.n[a];
  }
  TetMesh mesh;
  mesh.vertices = cubes.places(-0.5 * size, cube);
  cubes.for_faces([&](const std::array<int, 4>& ring, int below, int above, int parity) {
    if (below >= 0 && above >= 0) {
      for (int k = 0; k < 4; ++k) add_positive(mesh, below, above, ring[k], ring[(k + 1) % 4]);
      return;
    }
    const int centre = below >= 0 ? below : above, k = parity % 2;
    add_positive(mesh, centre, ring[k], ring[k + 1], ring[k + 2]);
    add_positive(mesh, centre, ring[k], ring[k + 2], ring[(k + 3) % 4]);
  });
  return mesh;
}

TetMesh stuff_surface(const TriangleMesh& surface, double edge) {
  return Stuffing(surface, edge).stuff();
}

}  // namespace tissue_sim
