// Cuts of tetrahedra. The links that a blade breaks lead from centre to centre of neighbours, as
// bonds lead from point to point: whatever the path, partial, hooked, crossing, in pieces, each
// link is broken or not. Faces whose link is broken part; vertices come apart into the groups of
// tetrahedra around them that still hang together. Vertices of parted faces first move onto the
// blade's surface, in reference space, as far as the tetrahedra around them bear it.
#include <algorithm>
#include <cmath>
#include <map>

#include "math/union_find.h"
#include "pbd/cut.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// No tetrahedron shrinks to less than this share of what it was before vertices moved, ...
constexpr double kLeastVolume = 0.3;
/// ... and 6 V / L^3, 0.71 of a regular one, stays above this.
constexpr double kLeastQuality = 0.06;

Vec3 centre(const State& s, const std::vector<Vec3>& x, std::int32_t t) {
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < 4; ++i) sum += s.centres[t][i] * place_before(s, x, s.tetrahedra[t][i]);
  return sum;
}

Vec3 reference_centre(const State& s, std::int32_t t) {
  Vec3 sum = Vec3::Zero();
  for (int i = 0; i < 4; ++i) {
    sum += s.centres[t][i] * s.vertices.reference[s.tetrahedra[t][i]];
  }
  return sum;
}

/// Shares of the corners in a place of reference space.
std::array<double, 4> shares(const State& s, std::int32_t t, const Vec3& place) {
  const Tetrahedron& c = s.tetrahedra[t];
  Eigen::Matrix3d q;
  for (int i = 0; i < 3; ++i)
    q.col(i) = s.vertices.reference[c[i + 1]] - s.vertices.reference[c[0]];
  const Vec3 w = q.inverse() * (place - s.vertices.reference[c[0]]);
  return {1 - w.sum(), w[0], w[1], w[2]};
}

Eigen::Matrix3d gradient(const State& s, std::int32_t t) {
  Eigen::Matrix3d p, q;
  const Tetrahedron& c = s.tetrahedra[t];
  for (int i = 0; i < 3; ++i) {
    p.col(i) = s.vertices.position(c[i + 1]) - s.vertices.position(c[0]);
    q.col(i) = s.vertices.reference[c[i + 1]] - s.vertices.reference[c[0]];
  }
  return p * q.inverse();
}

double six_volumes(const State& s, const Tetrahedron& c) {
  const auto& x = s.vertices.reference;
  return (x[c[1]] - x[c[0]]).cross(x[c[2]] - x[c[0]]).dot(x[c[3]] - x[c[0]]);
}

double quality(const State& s, const Tetrahedron& c) {
  double longest = 0;
  for (int i = 0; i < 4; ++i) {
    for (int j = i + 1; j < 4; ++j) {
      longest = std::max(longest, (s.vertices.reference[c[i]] - s.vertices.reference[c[j]]).norm());
    }
  }
  return six_volumes(s, c) / (longest * longest * longest);
}

/// What the blade left at a vertex, in reference space: the mean of where it met links, and their
/// normals.
struct Plane {
  Vec3 point = Vec3::Zero(), normal = Vec3::Zero();
  int count = 0;
};

struct Broken {
  int face;
  double place;
  Vec3 normal;
};

std::vector<std::int32_t> face_corners(const State& s, const InnerFace& f) {
  std::vector<std::int32_t> v;
  for (int i = 0; i < 4; ++i) {
    if (i != f.opposite[0]) v.push_back(s.tetrahedra[f.tetrahedron[0]][i]);
  }
  return v;
}

/// A tetrahedron whose links are all broken now would be a crumb beside the blade: it keeps one of
/// them, to what still hangs together where it can.
void keep_crumbs(State& s, std::vector<Broken>& broken) {
  std::vector<int> intact(s.tetrahedra.size(), 0);
  for (const InnerFace& f : s.faces) {
    for (const std::int32_t t : f.tetrahedron) intact[t] += f.is_cut ? 0 : 1;
  }
  std::map<std::int32_t, std::pair<int, int>> kept;  // of a crumb: its best neighbour's, and which
  for (std::size_t i = 0; i < broken.size(); ++i) {
    const auto [a, b] = s.faces[broken[i].face].tetrahedron;
    for (const auto& [t, other] : {std::make_pair(a, b), std::make_pair(b, a)}) {
      const std::pair<int, int> of = {intact[other], static_cast<int>(i)};
      if (intact[t] == 0) kept[t] = std::max(kept.try_emplace(t, of).first->second, of);
    }
  }
  for (const auto& [t, of] : kept) s.faces[broken[of.second].face].is_cut = false;
  broken.erase(std::remove_if(broken.begin(), broken.end(),
                              [&s](const Broken& b) { return !s.faces[b.face].is_cut; }),
               broken.end());
}

/// What a tear would leave of fewer tetrahedra than four cells of the lattice have hangs on to
/// where most of its faces are: a crack whose direction turns passes on both sides of such crumbs.
void keep_small(State& s, std::vector<Broken>& broken) {
  constexpr int kLeast = 48;
  for (bool again = true; again;) {
    again = false;
    UnionFind linked(static_cast<int>(s.tetrahedra.size()));
    for (const InnerFace& f : s.faces) {
      if (!f.is_cut) linked.join(f.tetrahedron[0], f.tetrahedron[1]);
    }
    std::map<std::int32_t, int> size;  // of each piece, where it is small
    for (int t = 0; t < static_cast<int>(s.tetrahedra.size()); ++t) ++size[linked.root(t)];
    std::map<std::int32_t, std::map<std::int32_t, int>> beside;  // faces to each other piece
    for (const Broken& b : broken) {
      const auto& [p, q] = s.faces[b.face].tetrahedron;
      const std::int32_t of_p = linked.root(p), of_q = linked.root(q);
      if (of_p == of_q) continue;
      if (size[of_p] < kLeast) ++beside[of_p][of_q];
      if (size[of_q] < kLeast) ++beside[of_q][of_p];
    }
    if (beside.empty()) return;
    const auto& [crumb, others] = *beside.begin();
    std::int32_t to = others.begin()->first;
    for (const auto& [other, count] : others) {
      if (std::make_pair(size[other] >= kLeast, count) >
          std::make_pair(size[to] >= kLeast, others.at(to)))
        to = other;
    }
    for (const Broken& b : broken) {
      InnerFace& f = s.faces[b.face];
      const std::int32_t of_p = linked.root(f.tetrahedron[0]), of_q = linked.root(f.tetrahedron[1]);
      if (std::minmax(of_p, of_q) == std::minmax(crumb, to)) f.is_cut = false;
    }
    broken.erase(std::remove_if(broken.begin(), broken.end(),
                                [&s](const Broken& b) { return !s.faces[b.face].is_cut; }),
                 broken.end());
    again = true;
  }
}

class TetCut {
 public:
  TetCut(State& s, const std::vector<Broken>& broken) : s_(s), broken_(broken) {
    around_.resize(s.vertices.size());
    for (std::size_t t = 0; t < s.tetrahedra.size(); ++t) {
      for (const std::int32_t v : s.tetrahedra[t])
        around_[v].push_back(static_cast<std::int32_t>(t));
    }
  }

  void move_onto_blade() {
    std::map<std::int32_t, Plane> planes;
    for (const Broken& b : broken_) {
      const InnerFace& f = s_.faces[b.face];
      const Vec3 c0 = reference_centre(s_, f.tetrahedron[0]);
      const Vec3 c1 = reference_centre(s_, f.tetrahedron[1]);
      const Eigen::Matrix3d g =
          0.5 * (gradient(s_, f.tetrahedron[0]) + gradient(s_, f.tetrahedron[1]));
      Vec3 n = (g.transpose() * b.normal).stableNormalized();
      if (n.isZero()) continue;
      for (const std::int32_t v : face_corners(s_, f)) {
        Plane& p = planes[v];
        p.normal += p.normal.dot(n) < 0 ? Vec3(-n) : n;
        p.point += c0 + b.place * (c1 - c0);
        ++p.count;
      }
    }
    for (const auto& [v, plane] : planes) {
      if (s_.vertices.anchored[v] == 0) move(v, plane);
    }
  }

  /// Gives each group of tetrahedra that hang together around a vertex one of its own.
  void part(std::vector<std::int32_t>& origin, CutReport& report) {
    std::map<std::int32_t, std::vector<int>> faces_at;  // that hold, of vertices beside the cut
    std::vector<std::uint8_t> is_beside(s_.vertices.size(), 0);
    std::set<std::int32_t> touched;
    for (const Broken& b : broken_) {
      const InnerFace& f = s_.faces[b.face];
      const std::vector<std::int32_t> corners = face_corners(s_, f);
      touched.insert(corners.begin(), corners.end());
      for (const std::int32_t v : corners) {
        ++s_.vertices.cut_links[v];
        is_beside[v] = 1;
      }
      open_.push_back({b.face, {corners[0], corners[1], corners[2]}});
    }
    for (std::size_t i = 0; i < s_.faces.size(); ++i) {
      const InnerFace& f = s_.faces[i];
      if (f.is_cut) continue;
      const Tetrahedron& t = s_.tetrahedra[f.tetrahedron[0]];
      for (int k = 0; k < 4; ++k) {
        if (k != f.opposite[0] && is_beside[t[k]] != 0) {
          faces_at[t[k]].push_back(static_cast<int>(i));
        }
      }
    }
    report.points_separated += static_cast<int>(touched.size());
    for (const std::int32_t v : touched) part_vertex(v, faces_at[v], origin);
    add_cut_triangles();
  }

 private:
  /// Along the outer surface where the vertex is on it; not at all at its edges and corners.
  void move(std::int32_t v, const Plane& plane) {
    const Vec3 n = plane.normal.stableNormalized();
    Vec3& x = s_.vertices.reference[v];
    const double off = n.dot(plane.point / plane.count - x);
    Vec3 way = off * n;
    if (s_.vertices.surface[v] != 0) {
      Vec3 outer = Vec3::Zero();
      std::vector<Vec3> normals;
      for (const Triangle& t : s_.triangles) {
        if (t[0] != v && t[1] != v && t[2] != v) continue;
        const auto& r = s_.vertices.reference;
        normals.push_back((r[t[1]] - r[t[0]]).cross(r[t[2]] - r[t[0]]));
        outer += normals.back();
      }
      outer = outer.stableNormalized();
      for (const Vec3& m : normals) {
        if (m.stableNormalized().dot(outer) < 0.9) return;
      }
      const Vec3 along = n - n.dot(outer) * outer;
      const double share = n.dot(along);
      if (share < 0.25) return;
      way = off / share * along;
    }
    Eigen::Matrix3d g = Eigen::Matrix3d::Zero();
    std::vector<double> least;
    for (const std::int32_t t : around_[v]) {
      g += gradient(s_, t) / static_cast<double>(around_[v].size());
      least.push_back(kLeastVolume * six_volumes(s_, s_.tetrahedra[t]));
    }
    const Vec3 from = x;
    std::vector<Vec3> centres;
    for (const std::int32_t t : around_[v]) centres.push_back(reference_centre(s_, t));
    for (double share = 1; share > 0.2; share *= 0.7) {
      x = from + share * way;
      bool good = true;
      for (std::size_t i = 0; i < least.size() && good; ++i) {
        const Tetrahedron& c = s_.tetrahedra[around_[v][i]];
        good = six_volumes(s_, c) >= least[i] && quality(s_, c) >= kLeastQuality;
      }
      if (good) {
        const Vec3 moved = g * (x - from);
        for (int a = 0; a < 3; ++a) s_.vertices.x[4 * v + a] += static_cast<float>(moved[a]);
        for (std::size_t i = 0; i < centres.size(); ++i) {
          s_.centres[around_[v][i]] = shares(s_, around_[v][i], centres[i]);
        }
        return;
      }
    }
    x = from;
  }

  void part_vertex(std::int32_t v, const std::vector<int>& faces,
                   std::vector<std::int32_t>& origin) {
    const std::vector<std::int32_t>& tets = around_[v];
    std::map<std::int32_t, std::int32_t> group;
    for (const std::int32_t t : tets) group[t] = t;
    for (bool again = true; again;) {
      again = false;
      for (const int i : faces) {
        std::int32_t &a = group[s_.faces[i].tetrahedron[0]], &b = group[s_.faces[i].tetrahedron[1]];
        if (a == b) continue;
        a = b = std::min(a, b);
        again = true;
      }
    }
    std::map<std::int32_t, std::int32_t> vertex;  // of each group; the lowest keeps v
    for (const std::int32_t t : tets) {
      const auto [at, is_new] = vertex.try_emplace(group[t], v);
      if (is_new && vertex.size() > 1) at->second = copy_vertex(s_, v, origin);
      if (at->second == v) continue;
      for (std::int32_t& c : s_.tetrahedra[t]) c = c == v ? at->second : c;
    }
    if (vertex.size() < 2) return;
    for (std::size_t i = 0; i < s_.triangles.size(); ++i) rename(s_.triangles[i], v, tets, vertex);
  }

  /// A triangle of the outer surface belongs to the tetrahedron around v that has all its corners.
  void rename(Triangle& triangle, std::int32_t v, const std::vector<std::int32_t>& tets,
              const std::map<std::int32_t, std::int32_t>& vertex) {
    if (std::find(triangle.begin(), triangle.end(), v) == triangle.end()) return;
    for (const std::int32_t t : tets) {
      for (const auto& [group, w] : vertex) {
        const Tetrahedron& c = s_.tetrahedra[t];
        int found = 0;
        for (const std::int32_t corner : triangle) {
          found += std::find(c.begin(), c.end(), corner == v ? w : corner) != c.end() ? 1 : 0;
        }
        if (found < 3) continue;
        for (std::int32_t& corner : triangle) corner = corner == v ? w : corner;
        return;
      }
    }
  }

  void add_cut_triangles() {
    constexpr int kFace[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};
    for (const auto& [index, corners] : open_) {
      const InnerFace& f = s_.faces[index];
      for (int side = 0; side < 2; ++side) {
        const Tetrahedron& c = s_.tetrahedra[f.tetrahedron[side]];
        const int* k = kFace[f.opposite[side]];
        s_.triangles.push_back({c[k[0]], c[k[1]], c[k[2]]});
        s_.cut.push_back(1);
        for (const std::int32_t v : s_.triangles.back()) s_.vertices.surface[v] = 1;
      }
    }
  }

  State& s_;
  const std::vector<Broken>& broken_;
  std::vector<std::vector<std::int32_t>> around_;  // tetrahedra of each vertex
  std::vector<std::pair<int, Triangle>> open_;
};

/// `smooth` as cut_tetrahedra() has it.
bool part(State& s, std::vector<Broken>& broken, bool smooth, std::vector<std::int32_t>& origin,
          CutReport& report) {
  keep_crumbs(s, broken);
  if (broken.empty()) return false;
  report.bonds_broken += static_cast<std::int64_t>(broken.size());
  TetCut cut(s, broken);
  if (smooth) cut.move_onto_blade();
  cut.part(origin, report);
  return true;
}

}  // namespace

void find_faces(State& s) {
  std::map<std::array<std::int32_t, 3>, std::pair<std::int32_t, std::int8_t>> first;
  for (std::size_t t = 0; t < s.tetrahedra.size(); ++t) {
    for (std::int8_t k = 0; k < 4; ++k) {
      std::array<std::int32_t, 3> key;
      for (int i = 0, j = 0; i < 4; ++i) {
        if (i != k) key[j++] = s.tetrahedra[t][i];
      }
      std::sort(key.begin(), key.end());
      const auto [at, is_new] = first.try_emplace(key, static_cast<std::int32_t>(t), k);
      if (!is_new) {
        s.faces.push_back(
            {{at->second.first, static_cast<std::int32_t>(t)}, {at->second.second, k}, false});
      }
    }
  }
}

bool part_faces(State& s, const std::vector<std::int32_t>& faces, std::vector<std::int32_t>& origin,
                CutReport& report) {
  s.centres.resize(s.tetrahedra.size(), {0.25, 0.25, 0.25, 0.25});
  std::vector<Broken> broken;
  for (const std::int32_t i : faces) {
    s.faces[i].is_cut = true;
    broken.push_back({i, 0.5, Vec3::Zero()});
  }
  keep_small(s, broken);
  return part(s, broken, false, origin, report);
}

bool cut_tetrahedra(State& s, const BladePath& path, const std::vector<Vec3>& before, bool smooth,
                    std::vector<std::int32_t>& origin, CutReport& report) {
  if (s.faces.empty()) find_faces(s);
  s.centres.resize(s.tetrahedra.size(), {0.25, 0.25, 0.25, 0.25});
  const int count = static_cast<int>(s.tetrahedra.size());
  std::vector<Vec3> from(count), to(count);
  for (int t = 0; t < count; ++t) {
    from[t] = centre(s, before, t);
    to[t] = centre(s, {}, t);
  }
  std::vector<Broken> broken;
  for (const SweepPart& part : sweep_parts(path)) {
    stop_if_asked();
    for (std::size_t i = 0; i < s.faces.size(); ++i) {
      InnerFace& f = s.faces[i];
      if (f.is_cut) continue;
      const std::int32_t a = f.tetrahedron[0], b = f.tetrahedron[1];
      const MovingSegment whole = {from[a], from[b], to[a], to[b]};
      bool aside = false;
      for (int k = 0; k < 3 && !aside; ++k) {
        aside =
            sweep::largest(whole, k) < part.box.min[k] || sweep::least(whole, k) > part.box.max[k];
      }
      if (aside) continue;
      const MovingSegment link = whole.during(part.begin, part.end);
      for (const SweptEdge& edge : part.edges) {
        Meeting meeting;
        if (stays_aside(edge, link) || !edge_passes<Vec3>(edge, link, &meeting)) continue;
        f.is_cut = true;
        broken.push_back({static_cast<int>(i), meeting.place, meeting.normal});
        break;
      }
    }
  }
  return part(s, broken, smooth, origin, report);
}

}  // namespace pbd
}  // namespace tissue_sim
