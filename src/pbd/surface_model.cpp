// The surface model: vertices of a triangle mesh, held together by its edges (distance), the angles
// at them (bending) and pairs of vertices across the inside (internal shape-preserving).
//
// Their stiffness follows from Young's modulus E:
//   internal: E A / d, the column of area A between the two vertices, d apart. Squeezed between two
//     plates a slab resists with E.
//   edge: E t (A1 + A2) / L^2, the spring of a membrane of triangles A1 and A2 (Van Gelder 1998) as
//     thick, t, as half the body is deep below it. Pulled along, a slab resists with E.
//   bending: 3 D L^2 / (A1 + A2) with the stiffness D = E t^3 / (12 (1 - nu^2)) of a plate as thick
//     as the edge is long, or as an even triangle's edge of the lower one's height where that is
//     less (Grinspun et al. 2003); no stiffer than a step resolves.
#include <algorithm>
#include <cmath>
#include <map>
#include <unordered_set>

#include "cutting/blade_sweep.h"
#include "geometry/surface.h"
#include "pbd/internal_links.h"
#include "pbd/model.h"
#include "pbd/pbd_pieces.h"
#include "pbd/surface_volume.h"

namespace tissue_sim {
namespace pbd {
namespace {

double area_of(const State& s, const Triangle& t) {
  const auto& x = s.vertices.reference;
  return 0.5 * (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm();
}

std::uint64_t pair_key(std::int32_t a, std::int32_t b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
         static_cast<std::uint32_t>(std::max(a, b));
}

/// Colours of constraints by what they join, to be given to those made anew.
template <class Kind>
class OldColours {
 public:
  void take(ConstraintSet<Kind>& set) {
    for (int c = 0; c < set.size(); ++c) colours_.emplace_back(set.vertices[c], set.colour[c]);
    std::stable_sort(colours_.begin(), colours_.end(),
                     [](const Coloured& a, const Coloured& b) { return a.first < b.first; });
    set.vertices.clear();
    set.numbers.clear();
    set.colour.clear();
  }
  void restore(ConstraintSet<Kind>& set) const {
    auto at = colours_.begin();
    for (int c = 0; c < set.size(); ++c) {
      const auto& wanted = set.vertices[c];
      // Most come in the order of before.
      if (at == colours_.end() || at->first != wanted) {
        at = std::lower_bound(colours_.begin(), colours_.end(), wanted,
                              [](const Coloured& a, const auto& v) { return a.first < v; });
      }
      if (at != colours_.end() && at->first == wanted) set.colour[c] = (at++)->second;
    }
  }

 private:
  using Coloured = std::pair<typename ConstraintSet<Kind>::Vertices, std::int16_t>;
  std::vector<Coloured> colours_;
};

struct MeshEdge {
  std::int32_t a, b;         ///< a < b
  std::int32_t left, right;  ///< vertices opposite, -1 for none
  int count;                 ///< of triangles
  double area, least_area;   ///< of them, and of the smallest [m^2]
};

/// By a, then b.
std::vector<MeshEdge> mesh_edges(const State& s) {
  struct Half {
    std::int32_t b, opposite;
    double area;
  };
  // Those of a vertex lie side by side, each in the order of the triangles.
  std::vector<std::int32_t> end(s.vertices.size() + 1, 0);
  const auto low = [](const Triangle& t, int i) { return std::min(t[i], t[(i + 1) % 3]); };
  for (const Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) ++end[low(t, i) + 1];
  }
  for (int v = 0; v < s.vertices.size(); ++v) end[v + 1] += end[v];
  std::vector<Half> halves(3 * s.triangles.size());
  for (const Triangle& t : s.triangles) {
    const double area = area_of(s, t);
    for (int i = 0; i < 3; ++i) {
      halves[end[low(t, i)]++] = {std::max(t[i], t[(i + 1) % 3]), t[(i + 2) % 3], area};
    }
  }
  std::vector<MeshEdge> edges;
  edges.reserve(halves.size() / 2);
  std::int32_t first = 0;
  for (int a = 0; a < s.vertices.size(); first = end[a++]) {
    std::stable_sort(halves.begin() + first, halves.begin() + end[a],
                     [](const Half& p, const Half& q) { return p.b < q.b; });
    for (std::int32_t h = first; h < end[a]; ++h) {
      const Half& half = halves[h];
      if (h == first || edges.back().b != half.b) {
        edges.push_back({a, half.b, half.opposite, -1, 1, half.area, half.area});
        continue;
      }
      MeshEdge& edge = edges.back();
      if (++edge.count == 2) edge.right = half.opposite;
      edge.area += half.area;
      edge.least_area = std::min(edge.least_area, half.area);
    }
  }
  return edges;
}

void add_link(State& s, std::int32_t a, std::int32_t b, double stiffness) {
  if (!(stiffness > 0)) return;
  const double length = (s.vertices.reference[a] - s.vertices.reference[b]).norm();
  s.links.add({a, b}, {static_cast<float>(length), static_cast<float>(1 / stiffness)});
}

/// Two triangles at a wound that lie on one another, as where its wall ran along the skin, are a
/// flake without thickness: nothing there resists bending, and which way round they lie, a sign,
/// would turn by rounding [rad]. What a mesh came with stays.
constexpr float kFolded = 3.0f;

/// What an edge gives; a compliance of 0: none.
struct EdgeNumbers {
  double stiffness = 0;  ///< of the link [N/m]
  std::array<float, Bending::kNumbers> bend = {};
};

/// Angle at rest and compliance.
std::array<float, Bending::kNumbers> bend_of(const State& s, const MeshEdge& e, double stiffness) {
  if (!(stiffness > 0)) return {};
  const std::array<std::int32_t, 4> at = {e.left, e.right, e.a, e.b};
  Vertex<float> v[4];
  const Vec3& origin = s.vertices.reference[e.a];
  for (int i = 0; i < 4; ++i) {
    const Vec3 x = s.vertices.reference[at[i]] - origin;
    v[i] = {static_cast<float>(x.x()), static_cast<float>(x.y()), static_cast<float>(x.z()),
            static_cast<float>(1 / s.vertices.mass[at[i]])};
  }
  const auto parts = Bending::parts(v);
  const float angle = parts.angle;
  if (std::fabs(angle) > kFolded && (s.stroke[e.a] >= 0 || s.stroke[e.b] >= 0)) return {};
  Vector<float> g[4];
  Bending::gradients(v, parts, g);
  const double h = 1 / (s.scene.frame_rate * s.scene.pbd.steps);
  const double resolved = Bending::kMostOfStep / (h * h * Bending::mobility(v, g));
  return {angle, static_cast<float>(1 / std::min(stiffness, resolved))};
}

/// Of each vertex beside a wound: the blade's normal there, or the way along the surface where that
/// is not known, towards the triangles that the vertex has.
std::map<int, Vec3> own_sides(const State& s, const TriangleMesh& mesh,
                              const std::vector<Vec3>& normals) {
  std::map<int, Vec3> side;
  for (const auto& t : mesh.triangles) {
    const Vec3 sum = mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]];
    for (const int v : t) {
      if (s.stroke[v] >= 0)
        side.try_emplace(v, Vec3::Zero()).first->second += sum - 3 * mesh.vertices[v];
    }
  }
  for (auto& [v, way] : side) {
    const Vec3& blade = s.blade_normal[v];
    way -= way.dot(normals[v]) * normals[v];
    way = blade.isZero() ? Vec3(way.stableNormalized()) : way.dot(blade) < 0 ? Vec3(-blade) : blade;
  }
  return side;
}

/// How rays must lean, against the normal alone they may run into the wound that they begin at.
std::vector<Vec3> away_from_wounds(const std::map<int, Vec3>& sides,
                                   const std::vector<Vec3>& normals,
                                   const std::vector<int>& starts) {
  constexpr double kLean = 0.2;
  std::vector<Vec3> lean;
  for (const int v : starts) {
    const auto at = sides.find(v);
    if (at == sides.end()) {
      lean.push_back(Vec3::Zero());
    } else {
      lean.push_back(std::max(0.0, kLean + normals[v].dot(at->second)) * at->second);
    }
  }
  return lean;
}

/// Whether a link leaves each of its ends towards that one's own side of the wound there.
bool stays_on_its_side(const TriangleMesh& mesh, const std::map<int, Vec3>& sides,
                       const InternalLink& link) {
  const Vec3 way = mesh.vertices[link.to] - mesh.vertices[link.from];
  const auto from = sides.find(link.from), to = sides.find(link.to);
  return (from == sides.end() || from->second.dot(way) > 0) &&
         (to == sides.end() || to->second.dot(way) < 0);
}

}  // namespace

void make_surface_constraints(State& s) {
  OldColours<Distance> links;
  OldColours<Bending> bends;
  s.cpu.both([&] { links.take(s.links); }, [&] { bends.take(s.bends); });
  const PbdOptions& pbd = s.scene.pbd;
  const bool tets = pbd.model == PbdModel::kTetrahedra;
  if (tets && pbd.elasticity == PbdElasticity::kMaterial) return;
  const auto& x = s.vertices.reference;
  std::map<std::pair<std::int32_t, std::int32_t>, double> inner;  // volume around a tet's edge
  for (const Tetrahedron& t : s.tetrahedra) {
    const double volume =
        std::fabs((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]])) / 6;
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) inner[{std::min(t[i], t[j]), std::max(t[i], t[j])}] += volume;
    }
  }
  const auto material = [&s, &x](std::int32_t a, std::int32_t b) -> const Material& {
    return material_at(s.scene, s.scene.bodies[s.vertices.body[a]], 0.5 * (x[a] + x[b]));
  };
  for (const auto& [e, volume] : inner) {
    const double l2 = (x[e.first] - x[e.second]).squaredNorm();
    add_link(s, e.first, e.second,
             pbd.edge * material(e.first, e.second).young_modulus * volume / l2);
  }
  const std::vector<MeshEdge> edges = mesh_edges(s);
  std::vector<EdgeNumbers> numbers(edges.size());
  const auto count_numbers = [&](const MeshEdge& e) {
    EdgeNumbers of;
    const double l2 = (x[e.a] - x[e.b]).squaredNorm();
    const Material& m = material(e.a, e.b);
    const double thick = tets ? 0 : 0.5 * (s.half_depth[e.a] + s.half_depth[e.b]);
    of.stiffness = pbd.edge * m.young_modulus * thick * e.area / l2;
    if (e.count != 2 || e.left == e.right) return of;  // a triangle and its back have no angle
    const double even = 2 / std::sqrt(3.0) * 2 * e.least_area / std::sqrt(l2);
    const double plate = m.young_modulus * std::pow(std::min(std::sqrt(l2), even), 3) /
                         (12 * (1 - m.poisson_ratio * m.poisson_ratio));
    of.bend = bend_of(s, e, pbd.bending * 3 * plate * l2 / e.area);
    return of;
  };
  constexpr int kEdgesOfPart = 1024;
  const int count = static_cast<int>(edges.size());
  s.cpu.for_each((count + kEdgesOfPart - 1) / kEdgesOfPart, [&](int part) {
    for (int i = part * kEdgesOfPart; i < std::min(count, (part + 1) * kEdgesOfPart); ++i) {
      numbers[i] = count_numbers(edges[i]);
    }
  });
  for (int i = 0; i < count; ++i) {
    const MeshEdge& e = edges[i];
    add_link(s, e.a, e.b, numbers[i].stiffness);
    if (numbers[i].bend[1] > 0) s.bends.add({e.left, e.right, e.a, e.b}, numbers[i].bend);
  }
  s.edge_count = s.links.size();
  for (const InternalPair& p : s.internal) {
    add_link(s, p.a, p.b,
             pbd.internal * material(p.a, p.b).young_modulus * p.area / (x[p.a] - x[p.b]).norm());
  }
  s.cpu.both([&] { links.restore(s.links); }, [&] { bends.restore(s.bends); });
  for (int i = 0; i < s.vertices.size(); ++i) s.vertices.whole_links[i] = 0;
  for (const auto& l : s.links.vertices) {
    for (const std::int32_t v : l) ++s.vertices.whole_links[v];
  }
}

/// Whether a blade went between two vertices; not beside them, for they may lie on the wound.
static bool is_parted(const State& s, const InternalLink& link) {
  const Vec3 &a = s.vertices.reference[link.from], &b = s.vertices.reference[link.to];
  const Vec3 from = a + 0.02 * (b - a), to = b - 0.02 * (b - a);
  const MovingSegment segment = {from, to, from, to};
  for (const auto& w : s.wounds) {
    if (edge_passes<Vec3>(MovingSegment{w[0], w[1], w[2], w[3]}, segment)) return true;
  }
  return false;
}

int add_internal_links(State& s, int b, const std::vector<int>& starts) {
  // Within each piece: the walls of a wound lie on one another, and a ray would end where it
  // begins.
  UnionFind linked = joined(s);
  std::map<std::int32_t, std::pair<TriangleMesh, std::vector<int>>> pieces;
  for (const int v : starts) pieces[linked.root(v)].second.push_back(v);
  for (const auto& t : reference_surface(s, b).triangles) {
    const auto piece = pieces.find(linked.root(t[0]));
    if (piece != pieces.end()) piece->second.first.triangles.push_back(t);
  }
  const bool late = !s.cut_edges.empty();
  const double least = 0.1 * s.mean_edge;
  std::vector<InternalLink> found;
  for (auto& [root, piece] : pieces) {
    auto& [mesh, own] = piece;
    mesh.vertices = s.vertices.reference;
    const std::vector<Vec3> normals = vertex_normals(mesh);
    const std::map<int, Vec3> sides = own_sides(s, mesh, normals);
    for (const InternalLink& link :
         find_internal_links(mesh, own, away_from_wounds(sides, normals, own), late ? least : 0)) {
      if (!stays_on_its_side(mesh, sides, link)) continue;
      found.push_back(link);
    }
  }
  std::vector<double> area(s.vertices.size(), 0.0);
  std::vector<std::uint8_t> is_start(s.vertices.size(), 0);
  for (const int v : starts) is_start[v] = 1;
  std::unordered_set<std::uint64_t> edges;  // at starts
  for (const Triangle& t : s.triangles) {
    if (is_start[t[0]] + is_start[t[1]] + is_start[t[2]] == 0) continue;
    for (int i = 0; i < 3; ++i) {
      area[t[i]] += area_of(s, t) / 3;
      edges.insert(pair_key(t[i], t[(i + 1) % 3]));
    }
  }
  std::map<std::pair<std::int32_t, std::int32_t>, InternalPair> pairs;
  for (const InternalPair& p : s.internal) pairs.insert(pairs.end(), {{p.a, p.b}, p});
  for (const InternalLink& link : found) {
    s.half_depth[link.from] = 0.5 * link.length;
    if (link.through_gap || edges.count(pair_key(link.from, link.to)) != 0) continue;
    if (is_parted(s, link)) continue;
    // Lips of a wound lie on one another; what joins them there has no way to point.
    if ((s.vertices.reference[link.from] - s.vertices.reference[link.to]).norm() < least) continue;
    const std::int32_t low = std::min(link.from, link.to), high = std::max(link.from, link.to);
    InternalPair& pair =
        pairs.try_emplace({low, high}, InternalPair{low, high, 0, late}).first->second;
    pair.area += 0.5 * area[link.from];
  }
  s.internal.clear();
  for (const auto& [key, pair] : pairs) s.internal.push_back(pair);
  // Where no ray meets anything the body is taken to be as deep as it is on the mean.
  double depth = 0;
  int met = 0;
  for (const int v : starts) {
    depth += s.half_depth[v];
    met += s.half_depth[v] > 0 ? 1 : 0;
  }
  double mean = met > 0 ? depth / met : s.scene.cell_size;
  for (const int v : starts) {
    if (s.half_depth[v] <= 0) s.half_depth[v] = mean;
  }
  return static_cast<int>(starts.size()) - met;
}

void add_surface_body(State& s, int b, std::vector<std::string>* notes) {
  const Body& body = s.scene.bodies[b];
  SurfaceKind kind;
  TriangleMesh mesh = body.shape == Shape::kMesh ? load_surface(body, kind, notes)
                                                 : triangulate(body, s.scene.cell_size);
  std::vector<std::string> found;
  if (body.shape == Shape::kMesh) drop_specks(mesh, found);
  const std::vector<int> order = morton_order(mesh.vertices);
  std::vector<int> index(order.size());
  std::vector<int> starts;
  for (const int v : order) {
    index[v] = add_vertex(s, mesh.vertices[v], b);
    starts.push_back(index[v]);
    s.vertices.surface[index[v]] = 1;
  }
  for (const auto& t : mesh.triangles)
    s.triangles.push_back({index[t[0]], index[t[1]], index[t[2]]});
  s.cut.resize(s.triangles.size(), 0);
  const int missed = add_internal_links(s, b, starts);
  double volume = 0;
  int holes = 0, sheets = 0;
  for (const SurfacePart& part : surface_parts(mesh)) {
    if (!part.is_sheet()) {
      volume += part.volume;
      holes += part.holes;
      continue;
    }
    ++sheets;  // no inside: columns below the vertices
    for (const int t : part.triangles) {
      const auto& c = mesh.triangles[t];
      const double third = area_of(s, {index[c[0]], index[c[1]], index[c[2]]}) / 3;
      for (const int v : c) volume += third * s.half_depth[index[v]];
    }
  }
  if (holes > 0) {
    found.push_back("is weighed with " + std::to_string(holes) +
                    (holes == 1 ? " hole closed" : " holes closed") + " by a fan");
  }
  if (sheets > 0) {
    found.push_back("has " + std::to_string(sheets) + (sheets == 1 ? " sheet" : " sheets") +
                    " that enclose nothing, as thick as tissue is opposite, or as a cell");
  }
  for (const std::string& note : found) {
    if (notes != nullptr) notes->push_back("body '" + body.name + "': mesh " + note);
  }
  s.volume_of_body.push_back(volume);
  s.closed_body.push_back(kind.is_closed() ? 1 : 0);
  if (missed > 0 && notes != nullptr) {
    notes->push_back("body '" + body.name + "': " + std::to_string(missed) + " of " +
                     std::to_string(starts.size()) +
                     " vertices have no internal constraint: what is opposite is open");
  }
}

void share_out_mass(State& s) {
  Vertices& v = s.vertices;
  std::fill(v.volume.begin(), v.volume.end(), 0.0);
  for (const Tetrahedron& t : s.tetrahedra) {
    const auto& x = v.reference;
    const double sixth =
        std::fabs((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]])) / 6;
    for (const std::int32_t i : t) v.volume[i] += sixth / 4;
  }
  if (s.tetrahedra.empty()) {
    for (const Triangle& t : s.triangles) {
      const double third = area_of(s, t) / 3;
      for (const std::int32_t i : t) v.volume[i] += third * s.half_depth[i];
    }
  }
  std::vector<double> whole(s.scene.bodies.size(), 0.0), count = whole;
  for (int i = 0; i < v.size(); ++i) {
    whole[v.body[i]] += v.volume[i];
    count[v.body[i]] += 1;
  }
  // Next to nothing would fly at the least push, and single precision holds no such ratios.
  constexpr double kLeastShare = 1e-3;
  for (int i = 0; s.tetrahedra.empty() && i < v.size(); ++i) {
    const double least = kLeastShare * whole[v.body[i]] / count[v.body[i]];
    if (v.volume[i] < least) v.volume[i] = least;
  }
  std::fill(whole.begin(), whole.end(), 0.0);
  for (int i = 0; i < v.size(); ++i) whole[v.body[i]] += v.volume[i];
  for (int i = 0; i < v.size(); ++i) {
    const int b = v.body[i];
    v.volume[i] *= s.volume_of_body[b] / whole[b];
    v.mass[i] = v.volume[i] * material_at(s.scene, s.scene.bodies[b], v.reference[i]).density;
  }
}

}  // namespace pbd
}  // namespace tissue_sim
