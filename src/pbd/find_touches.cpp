#include "pbd/find_touches.h"

#include <algorithm>
#include <cmath>

#include "pbd/model.h"

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

/// Vertices of a piece that touches others, at least: crumbs, slivers for the most part, shook.
constexpr int kLeastPiece = 60;

/// Whether a triangle is so thin that single precision hardly knows its normal.
bool is_sliver(const Vec3& a, const Vec3& b, const Vec3& c, double mean_edge) {
  const double longest2 =
      std::max({(b - a).squaredNorm(), (c - a).squaredNorm(), (c - b).squaredNorm()});
  return (b - a).cross(c - a).norm() < 0.1 * mean_edge * std::sqrt(longest2);
}

/// Cells of lattices and the vertices in them: of a fine lattice, or for a box that has more than
/// kMostCells there, as of tissue that nothing holds in shape, of one as coarse as it takes.
class Cells {
 public:
  explicit Cells(double size) : size_(size) {}
  void add(std::int32_t vertex, const Vec3& x) {
    if (x.allFinite()) vertices_.emplace_back(vertex, x);
  }
  /// Vertices in the cells that a box overlaps.
  template <class F>
  void each_in(const Vec3& low, const Vec3& high, const F& of) {
    if (!low.allFinite() || !high.allFinite()) return;
    double size = size_;
    std::size_t level = 0;
    for (; cells(size, low, high) > kMostCells; size *= 2) ++level;
    while (levels_.size() <= level) levels_.emplace_back();
    if (levels_[level].slots.empty()) fill(size, levels_[level]);
    const Level& l = levels_[level];
    for (std::int64_t i = cell(size, low.x()); i <= cell(size, high.x()); ++i) {
      for (std::int64_t j = cell(size, low.y()); j <= cell(size, high.y()); ++j) {
        for (std::int64_t k = cell(size, low.z()); k <= cell(size, high.z()); ++k) {
          const std::uint64_t wanted = key(i, j, k);
          std::size_t at = l.slots[l.slot(wanted)];
          for (; at < l.entries.size() && l.entries[at].first == wanted; ++at) {
            of(l.entries[at].second);
          }
        }
      }
    }
  }

 private:
  static constexpr double kMostCells = 216;
  struct Level {
    std::vector<std::pair<std::uint64_t, std::int32_t>> entries;  ///< sorted by cell
    std::vector<std::size_t> slots;  ///< a hash table: a cell's first entry, or behind the last

    std::size_t slot(std::uint64_t wanted) const {
      const std::size_t mask = slots.size() - 1;
      std::size_t at = (wanted * 0x9e3779b97f4a7c15u >> 20) & mask;
      while (slots[at] < entries.size() && entries[slots[at]].first != wanted) at = (at + 1) & mask;
      return at;
    }
  };
  static std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1fffff; };
    return part(i) << 42 | part(j) << 21 | part(k);
  }
  static std::int64_t cell(double size, double x) {
    return static_cast<std::int64_t>(std::floor(std::max(-1e15, std::min(1e15, x / size))));
  }
  static double cells(double size, const Vec3& low, const Vec3& high) {
    double product = 1;
    for (int a = 0; a < 3; ++a)
      product *= 1.0 + static_cast<double>(cell(size, high[a]) - cell(size, low[a]));
    return product;
  }
  void fill(double size, Level& level) const {
    for (const auto& [v, x] : vertices_) {
      level.entries.emplace_back(key(cell(size, x.x()), cell(size, x.y()), cell(size, x.z())), v);
    }
    std::sort(level.entries.begin(), level.entries.end());
    std::size_t count = 16;
    while (count < 2 * level.entries.size()) count *= 2;
    level.slots.assign(count, level.entries.size());
    for (std::size_t e = 0; e < level.entries.size(); ++e) {
      const std::uint64_t own = level.entries[e].first;
      if (e == 0 || level.entries[e - 1].first != own) level.slots[level.slot(own)] = e;
    }
  }

  double size_;  ///< of the finest lattice's cells [m]
  std::vector<std::pair<std::int32_t, Vec3>> vertices_;
  std::vector<Level> levels_;
};

/// A place above a triangle: its height, and the shares of the corners b and c in what is below.
struct Above {
  double height, b, c;
  double beside() const { return std::max({0.0, -b, -c, b + c - 1}); }
};

/// A triangle, with what is the same for all places above it.
struct TouchedTriangle {
  Vec3 a, e, f, n;
  double n2, length;

  TouchedTriangle(const Vec3& corner, const Vec3& b, const Vec3& c)
      : a(corner),
        e(b - a),
        f(c - a),
        n(e.cross(f)),
        n2(n.squaredNorm() + 1e-300),
        length(std::sqrt(n2)) {}
  double height(const Vec3& x) const { return (x - a).dot(n) / length; }
  Above above(const Vec3& x) const {
    const Vec3 r = x - a;
    return {r.dot(n) / length, r.cross(f).dot(n) / n2, e.cross(r).dot(n) / n2};
  }
};

const Material& material_of(const State& s, int v) {
  return material_at(s.scene, s.scene.bodies[s.vertices.body[v]], s.vertices.reference[v]);
}

}  // namespace

void find_touches(State& s, double duration) {
  s.touches = {};
  s.touching.assign(s.components, 0);
  if (s.components < 2) return;
  const Vertices& v = s.vertices;
  std::vector<int> vertices_of(s.components, 0);
  for (const std::int32_t c : s.component) ++vertices_of[c];
  const auto is_crumb = [&](std::int32_t i) { return vertices_of[s.component[i]] < kLeastPiece; };
  double fastest = 0;
  std::vector<Vec3> normal(v.size(), Vec3::Zero());
  for (int i = 0; i < v.size(); ++i) fastest = std::max(fastest, v.velocity(i).norm());
  for (const Triangle& t : s.triangles) {
    const Vec3 a = v.position(t[0]);
    const Vec3 n = (v.position(t[1]) - a).cross(v.position(t[2]) - a);
    for (const std::int32_t i : t) normal[i] += n;
  }
  const double reach = std::min(2.0, 0.3 + 2 * fastest * duration / s.mean_edge) * s.mean_edge;
  // Where each piece may touch another: what lies in no other's box is left out.
  const auto reaches = [&](const Triangle& t) {
    const Vec3 a = v.position(t[0]), b = v.position(t[1]), c = v.position(t[2]);
    return std::max(reach, kDeepest * s.mean_edge) +
           2 * kBeside * ((b - a).norm() + (c - a).norm());
  };
  std::vector<Box> places(s.components), reached(s.components);
  for (const Triangle& t : s.triangles) {
    if (is_crumb(t[0])) continue;
    const Vec3 far = Vec3::Constant(reaches(t));
    Box &place = places[s.component[t[0]]], &wide = reached[s.component[t[0]]];
    for (const std::int32_t i : t) {
      const Vec3 x = v.position(i);
      place.min = place.min.cwiseMin(x);
      place.max = place.max.cwiseMax(x);
      wide.min = wide.min.cwiseMin(x - far);
      wide.max = wide.max.cwiseMax(x + far);
    }
  }
  std::vector<std::int32_t> large;
  for (std::int32_t c = 0; c < s.components; ++c) {
    if (places[c].min.x() <= places[c].max.x()) large.push_back(c);
  }
  const auto meets_other = [&](std::int32_t piece, const Vec3& low, const Vec3& high,
                               const std::vector<Box>& boxes) {
    return std::any_of(large.begin(), large.end(), [&](std::int32_t c) {
      return c != piece && (high - boxes[c].min).minCoeff() >= 0 &&
             (boxes[c].max - low).minCoeff() >= 0;
    });
  };
  Cells cells(2 * s.mean_edge);
  for (int i = 0; i < v.size(); ++i) {
    const Vec3 x = v.position(i);
    if (v.surface[i] != 0 && !is_crumb(i) && meets_other(s.component[i], x, x, reached)) {
      cells.add(i, x);
    }
  }
  struct Found {
    std::int32_t piece, triangle;
    double off;
    Above at;
  };
  std::vector<std::vector<Found>> found_of(v.size());  // the nearest of each other piece
  for (std::size_t k = 0; k < s.triangles.size(); ++k) {
    const Triangle& t = s.triangles[k];
    if (is_crumb(t[0])) continue;
    const std::int32_t piece = s.component[t[0]];
    const TouchedTriangle plane(v.position(t[0]), v.position(t[1]), v.position(t[2]));
    Vec3 low = Vec3::Constant(1e300), high = -low;
    for (const std::int32_t i : t) {
      low = low.cwiseMin(v.position(i));
      high = high.cwiseMax(v.position(i));
    }
    const Vec3 far = Vec3::Constant(reaches(t));
    if (!meets_other(piece, low - far, high + far, places)) continue;
    if (is_sliver(v.position(t[0]), v.position(t[1]), v.position(t[2]), s.mean_edge)) continue;
    const Vec3 facing = plane.n.stableNormalized();
    cells.each_in(low - Vec3::Constant(reach), high + Vec3::Constant(reach), [&](std::int32_t i) {
      if (s.component[i] == piece) return;
      const Vec3 x = v.position(i);
      const double height = plane.height(x);
      if (height > reach || height < -kDeepest * s.mean_edge) return;
      const Above at = plane.above(x);
      if (at.beside() > kBeside) return;
      // What does not face it is the far side, or a wall that the vertex would stumble over.
      if (facing.dot(normal[i].stableNormalized()) > kFacing) return;
      const double off = std::fabs(at.height) + at.beside() * s.mean_edge;
      std::vector<Found>& found = found_of[i];
      const auto known = std::find_if(found.begin(), found.end(),
                                      [piece](const Found& f) { return f.piece == piece; });
      const Found own = {piece, static_cast<std::int32_t>(k), off, at};
      if (known == found.end()) {
        found.push_back(own);
      } else if (off < known->off) {
        *known = own;
      }
    });
  }
  for (int i = 0; i < v.size(); ++i) {
    const std::vector<Found>& found = found_of[i];
    for (const Found& f : found) {
      const Triangle& t = s.triangles[f.triangle];
      double rest = 0;
      if (v.body[i] == v.body[t[0]]) {
        const Above at = TouchedTriangle(v.reference[t[0]], v.reference[t[1]], v.reference[t[2]])
                             .above(v.reference[i]);
        if (at.beside() < 1 && std::fabs(at.height) < s.mean_edge) rest = std::min(0.0, at.height);
      }
      const double friction = std::sqrt(material_of(s, i).friction * material_of(s, t[0]).friction);
      rest -= kSlack * s.mean_edge;
      if (f.at.height < rest) rest = f.at.height + kRecovery * (rest - f.at.height);
      s.touches.add({i, t[0], t[1], t[2]},
                    {static_cast<float>(rest), static_cast<float>(f.at.b),
                     static_cast<float>(f.at.c), static_cast<float>(friction)});
      if (f.at.height - rest < 0.1 * s.mean_edge) {
        s.touching[s.component[i]] = s.touching[f.piece] = 1;
      }
    }
  }
  s.touches.pack(v.size(), {}, 0);  // each frame anew
}

}  // namespace pbd
}  // namespace tissue_sim
