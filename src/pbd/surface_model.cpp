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

std::uint64_t pair_key(std::int32_t a, std::int32_t b) {
  return static_cast<std::uint64_t>(std::min(a, b)) << 32 |
         static_cast<std::uint32_t>(std::max(a, b));
}

/// Colours of constraints that were there before, to be given to those made anew: both in the order
/// of the last two of their vertices.
template <class Kind>
class OldColours {
 public:
  using Vertices = typename ConstraintSet<Kind>::Vertices;
  OldColours(std::vector<Vertices>& vertices, std::vector<std::int16_t>& colours) {
    vertices_.swap(vertices);
    colours_.swap(colours);
    end_ = vertices_.size();
  }
  /// Goes on with those from `begin` to `end`.
  void part(std::size_t begin, std::size_t end) {
    at_ = begin;
    end_ = end;
  }
  std::int16_t next(const Vertices& wanted) {
    const auto order = [](const Vertices& v) {
      return std::make_pair(v[Kind::kVertices - 2], v[Kind::kVertices - 1]);
    };
    while (at_ < end_ && order(vertices_[at_]) < order(wanted)) ++at_;
    return at_ < end_ && vertices_[at_] == wanted ? colours_[at_] : std::int16_t{-1};
  }
  std::size_t size() const { return vertices_.size(); }

 private:
  std::vector<Vertices> vertices_;
  std::vector<std::int16_t> colours_;
  std::size_t at_ = 0, end_ = 0;
};

void add_link(State& s, std::int32_t a, std::int32_t b, double stiffness) {
  if (!(stiffness > 0)) return;
  const double length = (s.vertices.reference[a] - s.vertices.reference[b]).norm();
  s.links.add({a, b}, {static_cast<float>(length), static_cast<float>(1 / stiffness)});
}

void make_links(State& s) {
  const auto edges_before = static_cast<std::size_t>(s.edge_count);
  OldColours<Distance> old(s.links.vertices, s.links.colour);
  s.links.numbers.clear();
  const PbdOptions& pbd = s.scene.pbd;
  const auto& x = s.vertices.reference;
  const Materials materials(s);
  const auto modulus = [&](std::int32_t a, std::int32_t b) {
    return materials.at(s.vertices.body[a], 0.5 * (x[a] + x[b])).young_modulus;
  };
  std::map<std::pair<std::int32_t, std::int32_t>, double> inner;  // volume around a tet's edge
  for (const Tetrahedron& t : s.tetrahedra) {
    const double volume =
        std::fabs((x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).dot(x[t[3]] - x[t[0]])) / 6;
    for (int i = 0; i < 4; ++i) {
      for (int j = i + 1; j < 4; ++j) inner[{std::min(t[i], t[j]), std::max(t[i], t[j])}] += volume;
    }
  }
  for (const auto& [e, volume] : inner) {
    const double l2 = (x[e.first] - x[e.second]).squaredNorm();
    add_link(s, e.first, e.second, pbd.edge * modulus(e.first, e.second) * volume / l2);
  }
  for (const SurfaceEdge& e : s.surface_edges.all()) {
    if (e.compliance >= 0) s.links.add({e.a, e.b}, {e.length, e.compliance});
  }
  s.edge_count = s.links.size();
  for (const InternalPair& p : s.internal) {
    add_link(s, p.a, p.b, pbd.internal * modulus(p.a, p.b) * p.area / (x[p.a] - x[p.b]).norm());
  }
  old.part(0, edges_before);
  for (int c = 0; c < s.links.size(); ++c) {
    if (c == s.edge_count) old.part(edges_before, old.size());
    s.links.colour[c] = old.next(s.links.vertices[c]);
  }
  std::fill(s.vertices.whole_links.begin(), s.vertices.whole_links.end(), 0);
  for (const auto& l : s.links.vertices) {
    for (const std::int32_t v : l) ++s.vertices.whole_links[v];
  }
}

void make_bends(State& s) {
  OldColours<Bending> old(s.bends.vertices, s.bends.colour);
  s.bends.numbers.clear();
  std::vector<float> w;  // what is resolved hangs on masses
  for (const double mass : s.vertices.mass) w.push_back(static_cast<float>(1 / mass));
  const double h = 1 / (s.scene.frame_rate * s.scene.pbd.steps);
  for (const SurfaceEdge& e : s.surface_edges.all()) {
    if (!(e.bending > 0)) continue;
    const float mobility = w[e.left] * e.squares[0] + w[e.right] * e.squares[1] +
                           w[e.a] * e.squares[2] + w[e.b] * e.squares[3];
    const double resolved = Bending::kMostOfStep / (h * h * mobility);
    const auto compliance = static_cast<float>(1 / std::min(e.bending, resolved));
    if (!(compliance > 0)) continue;
    s.bends.add({e.left, e.right, e.a, e.b}, {e.angle, compliance});
    s.bends.colour.back() = old.next(s.bends.vertices.back());
  }
}

/// A piece by itself: as rays see it, nothing else is there.
struct PieceMesh {
  TriangleMesh mesh;
  std::vector<int> starts;  ///< of mesh
  std::vector<int> vertex;  ///< of the state, of each of the mesh's
};

/// Within each piece: the walls of a wound lie on one another, and a ray would end where it begins.
/// Those that have any of the `starts` in body `b`, by their lowest vertices.
std::vector<PieceMesh> pieces_of(const State& s, int b, const std::vector<int>& starts) {
  UnionFind linked = joined(s);
  const int count = s.vertices.size();
  std::vector<std::int32_t> piece_of(count, -1);  // of roots
  std::vector<std::uint8_t> is_used(count, 0);
  for (const int v : starts) piece_of[linked.root(v)] = 0;
  std::vector<PieceMesh> pieces;
  for (std::int32_t& piece : piece_of) {
    if (piece < 0) continue;
    piece = static_cast<std::int32_t>(pieces.size());
    pieces.emplace_back();
  }
  const auto piece_at = [&](std::int32_t v) {
    const std::int32_t piece = piece_of[linked.root(v)];
    return piece < 0 ? nullptr : &pieces[piece];
  };
  for (const Triangle& t : s.triangles) {
    if (s.vertices.body[t[0]] != b) continue;
    PieceMesh* piece = piece_at(t[0]);
    if (piece == nullptr) continue;
    piece->mesh.triangles.push_back(t);
    for (const std::int32_t v : t) is_used[v] = 1;
  }
  for (const int v : starts) is_used[v] = 1;
  std::vector<int> number(count, -1);
  for (int v = 0; v < count; ++v) {
    if (is_used[v] == 0) continue;
    PieceMesh& piece = *piece_at(v);
    number[v] = static_cast<int>(piece.vertex.size());
    piece.vertex.push_back(v);
    piece.mesh.vertices.push_back(s.vertices.reference[v]);
  }
  for (PieceMesh& piece : pieces) {
    for (auto& t : piece.mesh.triangles) {
      for (int& v : t) v = number[v];
    }
  }
  for (const int v : starts) piece_at(v)->starts.push_back(number[v]);
  return pieces;
}

/// Of each vertex beside a wound: the blade's normal there, or the way along the surface where that
/// is not known, towards the triangles that the vertex has.
std::map<int, Vec3> own_sides(const State& s, const PieceMesh& piece,
                              const std::vector<Vec3>& normals) {
  const TriangleMesh& mesh = piece.mesh;
  std::map<int, Vec3> side;
  for (const auto& t : mesh.triangles) {
    const Vec3 sum = mesh.vertices[t[0]] + mesh.vertices[t[1]] + mesh.vertices[t[2]];
    for (const int v : t) {
      if (s.stroke[piece.vertex[v]] >= 0)
        side.try_emplace(v, Vec3::Zero()).first->second += sum - 3 * mesh.vertices[v];
    }
  }
  for (auto& [v, way] : side) {
    const Vec3& blade = s.blade_normal[piece.vertex[v]];
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
  const PbdOptions& pbd = s.scene.pbd;
  if (pbd.model == PbdModel::kTetrahedra && pbd.elasticity == PbdElasticity::kMaterial) return;
  s.surface_edges.update(s);
  s.cpu.both([&] { make_links(s); }, [&] { make_bends(s); });
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
  const bool late = !s.cut_edges.empty();
  const double least = 0.1 * s.mean_edge;
  const std::vector<PieceMesh> pieces = pieces_of(s, b, starts);
  std::vector<std::vector<InternalLink>> found_in(pieces.size());
  s.cpu.for_each(static_cast<int>(pieces.size()), [&](int i) {
    const PieceMesh& piece = pieces[i];
    const std::vector<Vec3> normals = vertex_normals(piece.mesh);
    const std::map<int, Vec3> sides = own_sides(s, piece, normals);
    const std::vector<Vec3> lean = away_from_wounds(sides, normals, piece.starts);
    for (InternalLink link :
         find_internal_links(piece.mesh, piece.starts, lean, late ? least : 0)) {
      if (!stays_on_its_side(piece.mesh, sides, link)) continue;
      link.from = piece.vertex[link.from];
      link.to = piece.vertex[link.to];
      found_in[i].push_back(link);
    }
  });
  std::vector<InternalLink> found;
  for (const auto& of : found_in) found.insert(found.end(), of.begin(), of.end());
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
  using Ends = std::pair<std::int32_t, std::int32_t>;
  const auto is_before = [](const InternalPair& p, const Ends& e) { return Ends(p.a, p.b) < e; };
  std::map<Ends, InternalPair> fresh;
  for (const InternalLink& link : found) {
    s.half_depth[link.from] = 0.5 * link.length;
    if (link.through_gap || edges.count(pair_key(link.from, link.to)) != 0) continue;
    if (is_parted(s, link)) continue;
    // Lips of a wound lie on one another; what joins them there has no way to point.
    if ((s.vertices.reference[link.from] - s.vertices.reference[link.to]).norm() < least) continue;
    const std::int32_t low = std::min(link.from, link.to), high = std::max(link.from, link.to);
    const auto at =
        std::lower_bound(s.internal.begin(), s.internal.end(), Ends(low, high), is_before);
    const bool is_there = at != s.internal.end() && at->a == low && at->b == high;
    InternalPair& pair =
        is_there ? *at
                 : fresh.try_emplace({low, high}, InternalPair{low, high, 0, late}).first->second;
    pair.area += 0.5 * area[link.from];
  }
  const auto kept = static_cast<std::ptrdiff_t>(s.internal.size());
  for (const auto& [ends, pair] : fresh) s.internal.push_back(pair);
  std::inplace_merge(
      s.internal.begin(), s.internal.begin() + kept, s.internal.end(),
      [](const InternalPair& p, const InternalPair& q) { return Ends(p.a, p.b) < Ends(q.a, q.b); });
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

double area_of(const State& s, const Triangle& t) {
  const auto& x = s.vertices.reference;
  return 0.5 * (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]).norm();
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
  const Materials materials(s);
  for (int i = 0; i < v.size(); ++i) {
    const int b = v.body[i];
    v.volume[i] *= s.volume_of_body[b] / whole[b];
    v.mass[i] = v.volume[i] * materials.at(b, v.reference[i]).density;
  }
}

}  // namespace pbd
}  // namespace tissue_sim
