#include "pbd/find_touches.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "math/union_find.h"
#include "pbd/model.h"
#include "pbd/touch_cells.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Cosine of the angle between a vertex's normal and that of what it may touch, at most.
constexpr double kFacing = -0.25;

/// What lies deeper came from elsewhere [mean edges].
constexpr double kDeepest = 0.5;
/// Beside a triangle another one is there, but for so much [shares of its sides].
constexpr double kBeside = 0.3;
/// So deep vertices may lie, that rounding pushes nothing that rests [mean edges].
constexpr double kSlack = 1e-3;

/// Share of an overlap that a frame takes back: all at once would shake what lies in scraps.
constexpr double kRecovery = 0.1;

/// So far ahead each triangle looks, whatever moves how fast, and no farther than [mean edges].
constexpr double kLeastReach = 0.3, kMostReach = 2.5;
/// What goes no farther in the frame is looked up apart from the rest [mean edges]: else all would
/// be looked for as far around as the fastest comes from.
constexpr double kSlow = 0.1;
/// Cells of vertices: a prism overlaps eight to twelve [mean edges].
constexpr double kCell = 2;

/// Vertices of a piece that touches others, at least: crumbs, slivers for the most part, shook.
constexpr int kLeastPiece = 60;

/// What lies above a triangle is in the box where it looks, but for rounding [mean edges].
constexpr double kRounding = 1e-2;

constexpr int kTrianglesOfPart = 256, kVerticesOfPart = 1024;

/// Whether a triangle is so thin that single precision hardly knows its normal.
bool is_sliver(const Vec3& a, const Vec3& b, const Vec3& c, double mean_edge) {
  const double longest2 =
      std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  return (b - a).cross(c - a).norm() < 0.1 * mean_edge * std::sqrt(longest2);
}

/// A place above a triangle: its height, and the shares of the corners b and c in what is below.
struct Above {
  double height, b, c;
  double beside() const { return std::max(std::max(0.0, -b), std::max(-c, b + c - 1)); }
};

/// A triangle, with what is the same for all places above it.
struct TouchedTriangle {
  Vec3 a, up, to_b, to_c;  ///< a corner; height and shares grow along these

  TouchedTriangle(const Vec3& corner, const Vec3& b, const Vec3& c) : a(corner) {
    const Vec3 e = b - a, f = c - a, n = e.cross(f);
    const double n2 = n.squaredNorm() + 1e-300;
    up = n / std::sqrt(n2);
    to_b = f.cross(n) / n2;
    to_c = n.cross(e) / n2;
  }
  Above above(const Vec3& x) const {
    const Vec3 r = x - a;
    return {r.dot(up), r.dot(to_b), r.dot(to_c)};
  }
};

}  // namespace

void find_touches(State& s, double duration) {
  s.touches = {};
  UnionFind together(s.components);
  const auto name_groups = [&] {
    s.group.resize(s.components);
    for (std::int32_t c = 0; c < s.components; ++c) s.group[c] = together.root(c);
  };
  name_groups();
  if (s.components < 2) return;
  const Vertices& v = s.vertices;
  std::vector<int> vertices_of(s.components, 0);
  for (const std::int32_t c : s.component) ++vertices_of[c];
  const auto is_crumb = [&](std::int32_t i) { return vertices_of[s.component[i]] < kLeastPiece; };
  const auto each_of = [&](int number, int of_part, const auto& f) {  // f(i, part)
    s.cpu.for_each((number + of_part - 1) / of_part, [&](int part) {
      for (int i = part * of_part; i < std::min(number, (part + 1) * of_part); ++i) f(i, part);
    });
  };
  std::vector<Vec3> place(v.size());
  std::vector<float> way(v.size());  // of each vertex in the frame [m]
  each_of(v.size(), kVerticesOfPart, [&](int i, int) {
    place[i] = v.position(i);
    way[i] = static_cast<float>(duration * v.velocity(i).norm());
  });
  float farthest = 0;
  for (int i = 0; i < v.size(); ++i) {
    if (!is_crumb(i)) farthest = std::max(farthest, way[i]);
  }
  std::vector<Vec3> normal(v.size(), Vec3::Zero());
  for (const Triangle& t : s.triangles) {
    const Vec3 n = (place[t[1]] - place[t[0]]).cross(place[t[2]] - place[t[0]]);
    for (const std::int32_t i : t) normal[i] += n;
  }
  // How far above a triangle a vertex may be that comes to it on a way of its own.
  const auto reach = [&](const Triangle& t, double own) {
    const double both = std::max({way[t[0]], way[t[1]], way[t[2]]}) + own;
    return std::min(kMostReach * s.mean_edge, kLeastReach * s.mean_edge + both);
  };
  // Where a triangle looks for vertices: above it, beside it by a little, and in it, a prism.
  const auto looks = [&](const Triangle& t, double own) {
    const Vec3 &a = place[t[0]], &b = place[t[1]], &c = place[t[2]];
    const Vec3 middle = (a + b + c) / 3, up = (b - a).cross(c - a).stableNormalized();
    Box box;
    for (const Vec3& corner : {a, b, c}) {
      const Vec3 wide = middle + (1 + 3 * kBeside) * (corner - middle);
      for (const double height : {reach(t, own), -kDeepest * s.mean_edge}) {
        box.min = box.min.cwiseMin(wide + height * up);
        box.max = box.max.cwiseMax(wide + height * up);
      }
    }
    return box;
  };
  const int count = static_cast<int>(s.triangles.size());
  const int parts = (count + kTrianglesOfPart - 1) / kTrianglesOfPart;
  const auto each_triangle = [&](const auto& f) { each_of(count, kTrianglesOfPart, f); };
  std::vector<Box> seen(count);  // by each triangle, for the farthest way
  each_triangle([&](int k, int) { seen[k] = looks(s.triangles[k], farthest); });
  // Where each piece is, and where it looks: what lies in no other's box is left out.
  std::vector<Box> places(s.components), reached(s.components);
  for (int k = 0; k < count; ++k) {
    const Triangle& t = s.triangles[k];
    if (is_crumb(t[0])) continue;
    Box &own = places[s.component[t[0]]], &wide = reached[s.component[t[0]]];
    for (const std::int32_t i : t) {
      own.min = own.min.cwiseMin(place[i]);
      own.max = own.max.cwiseMax(place[i]);
    }
    wide.min = wide.min.cwiseMin(seen[k].min);
    wide.max = wide.max.cwiseMax(seen[k].max);
  }
  const auto overlap = [](const Box& p, const Box& q) {
    return (p.max - q.min).minCoeff() >= 0 && (q.max - p.min).minCoeff() >= 0;
  };
  std::vector<std::int32_t> large;
  for (std::int32_t c = 0; c < s.components; ++c) {
    if (places[c].min.x() <= places[c].max.x()) large.push_back(c);
  }
  // Of each piece, the others that see it, or that it sees.
  std::vector<std::vector<std::int32_t>> near(s.components);
  for (const std::int32_t a : large) {
    for (const std::int32_t b : large) {
      if (a == b) continue;
      if (overlap(reached[a], places[b]) || overlap(reached[b], places[a])) near[a].push_back(b);
    }
  }
  const auto meets_other = [&](std::int32_t piece, const Box& box, const std::vector<Box>& boxes) {
    return std::any_of(near[piece].begin(), near[piece].end(),
                       [&](std::int32_t c) { return overlap(box, boxes[c]); });
  };
  struct Kind {  // the slow, and what is faster
    TouchCells cells;
    float farthest;           ///< of their ways [m]
    std::vector<Box> places;  ///< of each piece's
  };
  const auto slow = static_cast<float>(kSlow * s.mean_edge);
  Kind kinds[] = {
      {TouchCells(kCell * s.mean_edge), std::min(slow, farthest), std::vector<Box>(s.components)},
      {TouchCells(kCell * s.mean_edge), farthest, std::vector<Box>(s.components)}};
  const int vertex_parts = (v.size() + kVerticesOfPart - 1) / kVerticesOfPart;
  std::vector<std::array<std::vector<TouchCells::Entry>, 2>> entries(vertex_parts);
  each_of(v.size(), kVerticesOfPart, [&](int i, int part) {
    const Vec3& x = place[i];
    if (v.surface[i] == 0 || is_crumb(i) || !x.allFinite()) return;
    if (!meets_other(s.component[i], {x, x}, reached)) return;
    entries[part][way[i] > slow].push_back(TouchCells::entry(i, s.component[i], x, normal[i]));
  });
  for (const auto& of_part : entries) {
    for (int kind = 0; kind < 2; ++kind) {
      kinds[kind].cells.add(of_part[kind]);
      for (const TouchCells::Entry& e : of_part[kind]) {
        Box& own = kinds[kind].places[e.piece];
        own.min = own.min.cwiseMin(Vec3(e.x[0], e.x[1], e.x[2]));
        own.max = own.max.cwiseMax(Vec3(e.x[0], e.x[1], e.x[2]));
      }
    }
  }
  // What a box has of the places of other pieces' vertices; empty where it has none.
  const auto shared = [&](std::int32_t piece, const Box& box, const std::vector<Box>& places_of) {
    Box all;
    for (const std::int32_t c : near[piece]) {
      const Vec3 low = box.min.cwiseMax(places_of[c].min),
                 high = box.max.cwiseMin(places_of[c].max);
      if (!((high - low).minCoeff() >= 0)) continue;
      all.min = all.min.cwiseMin(low);
      all.max = all.max.cwiseMax(high);
    }
    return all;
  };
  struct Candidate {
    std::int32_t triangle;
    int kind, level;
    Box box;  ///< where vertices are that it may see
  };
  const Vec3 slack = Vec3::Constant(kRounding * s.mean_edge);
  std::vector<std::vector<Candidate>> candidates(parts);
  each_triangle([&](int k, int part) {
    const Triangle& t = s.triangles[k];
    const std::int32_t piece = s.component[t[0]];
    if (is_crumb(t[0]) || !meets_other(piece, seen[k], places)) return;
    if (is_sliver(place[t[0]], place[t[1]], place[t[2]], s.mean_edge)) return;
    for (int kind = 0; kind < 2; ++kind) {
      const TouchCells& cells = kinds[kind].cells;
      if (cells.empty()) continue;
      const Box box = kind == 0 ? looks(t, kinds[0].farthest) : seen[k];
      const Box all = shared(piece, {box.min - slack, box.max + slack}, kinds[kind].places);
      if (!(all.min.x() <= all.max.x())) continue;
      const int level = cells.level_of(box.min, box.max);
      if (level >= 0) candidates[part].push_back({k, kind, level, all});
    }
  });
  for (const std::vector<Candidate>& of_part : candidates) {
    for (const Candidate& candidate : of_part) kinds[candidate.kind].cells.fill(candidate.level);
  }
  struct Found {
    std::int32_t vertex, piece, triangle;
    std::int32_t next;  ///< of the same vertex, and of another piece
    double off;
    Above at;
  };
  std::vector<std::vector<Found>> of_parts(parts);
  s.cpu.for_each(parts, [&](int part) {
    for (const Candidate& candidate : candidates[part]) {
      const Triangle& t = s.triangles[candidate.triangle];
      const std::int32_t piece = s.component[t[0]];
      std::optional<TouchedTriangle> plane;
      const Vec3 &low = candidate.box.min, &high = candidate.box.max;
      kinds[candidate.kind].cells.each_in(
          candidate.level, low, high, piece, [&](const TouchCells::Entry& e) {
            const Vec3 x(e.x[0], e.x[1], e.x[2]);
            if ((x - low).minCoeff() < 0 || (high - x).minCoeff() < 0) return;  // most
            if (!plane) plane.emplace(place[t[0]], place[t[1]], place[t[2]]);
            const Above at = plane->above(x);
            if (!(at.height < reach(t, way[e.vertex]) && at.height > -kDeepest * s.mean_edge))
              return;
            if (at.beside() > kBeside) return;
            // What does not face it is the far side, or a wall that the vertex would stumble over.
            if (plane->up.dot(Vec3(e.normal[0], e.normal[1], e.normal[2])) > kFacing) return;
            const double off = std::fabs(at.height) + at.beside() * s.mean_edge;
            of_parts[part].push_back({e.vertex, piece, candidate.triangle, -1, off, at});
          });
    }
  });
  // The nearest of each other piece.
  std::vector<Found> found;
  std::vector<std::int32_t> first(v.size(), -1);
  for (const std::vector<Found>& of_part : of_parts) {
    for (const Found& f : of_part) {
      std::int32_t* at = &first[f.vertex];
      while (*at >= 0 && found[*at].piece != f.piece) at = &found[*at].next;
      if (*at < 0) {
        *at = static_cast<std::int32_t>(found.size());
        found.push_back(f);
      } else if (f.off < found[*at].off) {
        const std::int32_t next = found[*at].next;
        found[*at] = f;
        found[*at].next = next;
      }
    }
  }
  const Materials materials(s);
  const auto friction_of = [&](std::int32_t i) {
    return materials.at(v.body[i], v.reference[i]).friction;
  };
  for (const Found& f : found) {
    const std::int32_t i = f.vertex;
    const Triangle& t = s.triangles[f.triangle];
    double rest = 0;
    if (v.body[i] == v.body[t[0]]) {
      const Above at = TouchedTriangle(v.reference[t[0]], v.reference[t[1]], v.reference[t[2]])
                           .above(v.reference[i]);
      if (at.beside() < 1 && std::fabs(at.height) < s.mean_edge) rest = std::min(0.0, at.height);
    }
    const double friction = std::sqrt(friction_of(i) * friction_of(t[0]));
    rest -= kSlack * s.mean_edge;
    if (f.at.height < rest) rest = f.at.height + kRecovery * (rest - f.at.height);
    s.touches.add({i, t[0], t[1], t[2]},
                  {static_cast<float>(rest), static_cast<float>(f.at.b), static_cast<float>(f.at.c),
                   static_cast<float>(friction)});
    if (f.at.height - rest < 0.1 * s.mean_edge) {
      together.join(s.component[i], f.piece);
    }
  }
  name_groups();
  s.touches.pack(v.size(), {}, 0);  // each frame anew
}

double searches_of(const State& s, double struck, double duration) {
  struct Piece {
    Box box;
    double fastest = 0;
    int vertices = 0;
  };
  std::vector<Piece> pieces(s.components);
  for (int i = 0; i < s.vertices.size(); ++i) {
    Piece& piece = pieces[s.component[i]];
    const Vec3 x = s.vertices.position(i);
    piece.box.min = piece.box.min.cwiseMin(x);
    piece.box.max = piece.box.max.cwiseMax(x);
    piece.fastest = std::max(piece.fastest, s.vertices.velocity(i).norm());
    ++piece.vertices;
  }
  std::vector<Piece> large;
  for (Piece& piece : pieces) {
    if (piece.vertices < kLeastPiece) continue;
    piece.fastest =
        std::max(piece.fastest, 3 * struck);  // a third of an edge: it is not looked ahead
    const Vec3 far = Vec3::Constant(piece.fastest * duration + s.mean_edge);
    piece.box.min -= far;
    piece.box.max += far;
    large.push_back(piece);
  }
  double fastest = 0;
  for (std::size_t a = 0; a < large.size(); ++a) {
    for (std::size_t b = 0; b < a; ++b) {
      const Box &p = large[a].box, &q = large[b].box;
      if ((p.max - q.min).minCoeff() < 0 || (q.max - p.min).minCoeff() < 0) continue;
      fastest = std::max({fastest, large[a].fastest, large[b].fastest});
    }
  }
  return std::max(1.0, std::ceil(fastest * duration / s.mean_edge));
}

}  // namespace pbd
}  // namespace tissue_sim
