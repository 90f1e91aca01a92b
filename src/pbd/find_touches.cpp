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

/// Cells of lattices that triangles' boxes overlap, sorted: of a fine lattice, or where a box has
/// more than kMostCells there, as of tissue that nothing holds in shape, of one as coarse as it
/// takes.
class Cells {
 public:
  Cells(double size) : levels_(1, Level{size, {}}) {}
  void add(const Vec3& low, const Vec3& high, std::int32_t triangle) {
    if (!low.allFinite() || !high.allFinite()) return;
    std::size_t level = 0;
    while (levels_[level].cells(low, high) > kMostCells) {
      if (++level == levels_.size()) levels_.push_back({2 * levels_.back().size, {}});
    }
    levels_[level].add(low, high, triangle);
  }
  void sort() {
    for (Level& level : levels_) std::sort(level.entries.begin(), level.entries.end());
  }
  template <class F>
  void each_at(const Vec3& x, const F& of) const {
    if (!x.allFinite()) return;
    for (const Level& level : levels_) {
      if (level.entries.empty()) continue;
      const std::uint64_t wanted = key(level.cell(x.x()), level.cell(x.y()), level.cell(x.z()));
      auto at = std::lower_bound(level.entries.begin(), level.entries.end(),
                                 std::make_pair(wanted, std::int32_t{-1}));
      for (; at != level.entries.end() && at->first == wanted; ++at) of(at->second);
    }
  }

 private:
  static constexpr double kMostCells = 216;
  static std::uint64_t key(std::int64_t i, std::int64_t j, std::int64_t k) {
    const auto part = [](std::int64_t v) { return static_cast<std::uint64_t>(v) & 0x1fffff; };
    return part(i) << 42 | part(j) << 21 | part(k);
  }
  struct Level {
    double size;  ///< of a cell [m]
    std::vector<std::pair<std::uint64_t, std::int32_t>> entries;

    std::int64_t cell(double x) const {
      return static_cast<std::int64_t>(std::floor(std::max(-1e15, std::min(1e15, x / size))));
    }
    double cells(const Vec3& low, const Vec3& high) const {
      double product = 1;
      for (int a = 0; a < 3; ++a)
        product *= 1.0 + static_cast<double>(cell(high[a]) - cell(low[a]));
      return product;
    }
    void add(const Vec3& low, const Vec3& high, std::int32_t triangle) {
      for (std::int64_t i = cell(low.x()); i <= cell(high.x()); ++i) {
        for (std::int64_t j = cell(low.y()); j <= cell(high.y()); ++j) {
          for (std::int64_t k = cell(low.z()); k <= cell(high.z()); ++k) {
            entries.emplace_back(key(i, j, k), triangle);
          }
        }
      }
    }
  };
  std::vector<Level> levels_;
};

/// A place above a triangle: its height, and the shares of the corners b and c in what is below.
struct Above {
  double height, b, c;
  double beside() const { return std::max({0.0, -b, -c, b + c - 1}); }
};

Above above(const Vec3& x, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 e = b - a, f = c - a, r = x - a, n = e.cross(f);
  const double n2 = n.squaredNorm() + 1e-300;
  return {r.dot(n) / std::sqrt(n2), r.cross(f).dot(n) / n2, e.cross(r).dot(n) / n2};
}

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
  Cells cells(2 * s.mean_edge);
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    if (is_crumb(s.triangles[t][0])) continue;
    Vec3 low = Vec3::Constant(1e300), high = -low;
    for (const std::int32_t i : s.triangles[t]) {
      low = low.cwiseMin(v.position(i));
      high = high.cwiseMax(v.position(i));
    }
    cells.add(low - Vec3::Constant(reach), high + Vec3::Constant(reach),
              static_cast<std::int32_t>(t));
  }
  cells.sort();
  for (int i = 0; i < v.size(); ++i) {
    if (v.surface[i] == 0 || is_crumb(i)) continue;
    const Vec3 x = v.position(i), own = normal[i].stableNormalized();
    struct Found {
      std::int32_t piece, triangle;
      double off;
      Above at;
    };
    std::vector<Found> found;  // the nearest triangle of each other piece
    cells.each_at(x, [&](std::int32_t k) {
      const Triangle& t = s.triangles[k];
      const std::int32_t piece = s.component[t[0]];
      if (piece == s.component[i]) return;
      const Vec3 a = v.position(t[0]), b = v.position(t[1]), c = v.position(t[2]);
      const Above at = above(x, a, b, c);
      if (at.height > reach || at.height < -kDeepest * s.mean_edge || at.beside() > 0.3) return;
      if (is_sliver(a, b, c, s.mean_edge)) return;
      // What does not face it is the far side, or a wall that the vertex would stumble over.
      if ((b - a).cross(c - a).stableNormalized().dot(own) > kFacing) return;
      const double off = std::fabs(at.height) + at.beside() * s.mean_edge;
      const auto known = std::find_if(found.begin(), found.end(),
                                      [piece](const Found& f) { return f.piece == piece; });
      if (known == found.end()) {
        found.push_back({piece, k, off, at});
      } else if (off < known->off) {
        *known = {piece, k, off, at};
      }
    });
    for (const Found& f : found) {
      const Triangle& t = s.triangles[f.triangle];
      double rest = 0;
      if (v.body[i] == v.body[t[0]]) {
        const Above at =
            above(v.reference[i], v.reference[t[0]], v.reference[t[1]], v.reference[t[2]]);
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
