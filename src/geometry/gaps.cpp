#include "geometry/gaps.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "geometry/ray_tree.h"
#include "math/union_find.h"

namespace tissue_sim {
namespace {

constexpr int kLines = 4;         // along each axis of a cube
constexpr double kFacing = -0.3;  // cosine between normals of faces that look at each other
constexpr double kOff = 0.013;    // of a cube: lines run off the middles, where meshes have edges

using Cube = std::array<int, 3>;

std::int64_t key_of(const Cube& c) {
  constexpr std::int64_t kShift = 4;  // neighbours of the first are asked for, too
  return ((c[2] + kShift) << 42) + ((c[1] + kShift) << 21) + (c[0] + kShift);
}

constexpr std::int64_t kStep[3] = {1, std::int64_t{1} << 21, std::int64_t{1} << 42};

struct Plane {
  Vec3 normal = Vec3::Zero();  // unit; zero of a triangle without area
  double at = 0;
};

/// A line along an axis passes a face: inwards +1, outwards -1.
struct Pass {
  double at;  // along the axis [m]
  int step;
  std::int32_t triangle;
};

/// What lies in one cube. Its samples are where its lines meet: number 16 k + 4 j + i.
struct CubeParts {
  std::vector<Pass> passes[3]
                          [kLines * kLines];  // of lines along x by (j, k), y by (i, k), z (i, j)
  std::array<std::int16_t, 64> part;          // of each sample, -1 in the void
  std::array<std::int16_t, 16> low, high;     // of lines along x where they enter and leave
  std::array<std::int8_t, 64> winding;        // of each sample
  double first[3], last[3];                   // samples along each axis [m]
  std::vector<double> volume;                 // of each part [m^3]
  int own = -1;                               // the largest part
};

/// The triangles that reach into a cube, and what their normals lie between.
struct Bin {
  std::vector<std::int32_t> triangles;
  Vec3 low = Vec3::Constant(2), high = Vec3::Constant(-2);
  bool has_facing = false;
};

class Gaps {
 public:
  Gaps(const TriangleMesh& mesh, Lattice& lattice)
      : mesh_(mesh), lattice_(lattice), edge_(lattice.cell_size / 2) {}

  void find() {
    bin_triangles();
    const std::vector<std::array<std::int32_t, 3>> asked = neighbours_to_ask();
    if (asked.empty()) return;
    const RayTree tree(mesh_);
    std::vector<std::int32_t> cubes;
    for (const auto& a : asked) {
      cubes.push_back(a[0]);
      cubes.push_back(a[1]);
    }
    std::sort(cubes.begin(), cubes.end());
    cubes.erase(std::unique(cubes.begin(), cubes.end()), cubes.end());
    std::vector<CubeParts> parts(cubes.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, cubes.size(), 16),
                      [&](const tbb::blocked_range<std::size_t>& range) {
                        for (std::size_t i = range.begin(); i < range.end(); ++i) {
                          take_apart(tree, cube_of(cubes[i]), parts[i]);
                        }
                      });
    const auto parts_of = [&](std::int32_t site) -> CubeParts& {
      return parts[std::lower_bound(cubes.begin(), cubes.end(), site) - cubes.begin()];
    };
    std::vector<Handover> handovers;
    for (const auto& [p, q, axis] : asked) {
      CubeParts &a = parts_of(p), &b = parts_of(q);
      if (a.own < 0 || b.own < 0) continue;  // thinner than lines see: left as it is
      const auto count = static_cast<std::int32_t>(a.volume.size());
      UnionFind joined(a.volume.size() + b.volume.size());
      for_each_join(a, b, axis, [&](int i, int j) { joined.join(i, count + j); });
      if (joined.root(a.own) == joined.root(count + b.own)) continue;
      lattice_.gaps.push_back(gap_between(p, axis));
      for (int i = 0; i < count; ++i) {
        if (i != a.own && joined.root(i) == joined.root(count + b.own)) {
          handovers.push_back({p, q, i});
        }
      }
      for (int j = 0; j < static_cast<int>(b.volume.size()); ++j) {
        if (j != b.own && joined.root(count + j) == joined.root(a.own)) {
          handovers.push_back({q, p, j});
        }
      }
    }
    for (const Handover& h : handovers) hand_over(h, parts_of(h.from));
  }

 private:
  struct Handover {
    std::int32_t from, to;
    int part;
  };

  Cube cube_of(std::int32_t site) const {
    const Lattice::Site& s = lattice_.sites[site];
    return {s.x, s.y, s.z};
  }

  void bin_triangles() {
    const double r = edge_ / 2;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& c = mesh_.triangles[t];
      const Vec3 &a = mesh_.vertices[c[0]], &b = mesh_.vertices[c[1]], &d = mesh_.vertices[c[2]];
      Plane plane;
      plane.normal = (b - a).cross(d - a).stableNormalized();
      plane.at = plane.normal.dot(a);
      planes_.push_back(plane);
      const Vec3 low = (a.cwiseMin(b).cwiseMin(d) - lattice_.origin) / edge_,
                 high = (a.cwiseMax(b).cwiseMax(d) - lattice_.origin) / edge_;
      Cube first, last;
      for (int k = 0; k < 3; ++k) {
        first[k] = static_cast<int>(std::floor(low[k] - 1e-6));
        last[k] = static_cast<int>(std::floor(high[k] + 1e-6));
      }
      const double reach = r * 1.0001 * plane.normal.cwiseAbs().sum();
      for (int z = first[2]; z <= last[2]; ++z) {
        for (int y = first[1]; y <= last[1]; ++y) {
          for (int x = first[0]; x <= last[0]; ++x) {
            const Vec3 middle = lattice_.origin + edge_ * Vec3(x + 0.5, y + 0.5, z + 0.5);
            if (std::abs(plane.normal.dot(middle) - plane.at) > reach) continue;
            Bin& bin = bins_[key_of({x, y, z})];
            bin.triangles.push_back(static_cast<std::int32_t>(t));
            bin.low = bin.low.cwiseMin(plane.normal);
            bin.high = bin.high.cwiseMax(plane.normal);
          }
        }
      }
    }
  }

  const Bin& bin_of(const Cube& c) const { return bin_at(key_of(c)); }
  const Bin& bin_at(std::int64_t key) const {
    static const Bin none;
    const auto at = bins_.find(key);
    return at == bins_.end() ? none : at->second;
  }

  /// Whether a corner of triangle t lies before the face of triangle s.
  bool is_before(std::int32_t t, std::int32_t s) const {
    const Plane& plane = planes_[s];
    double most = -1e300;
    for (const int v : mesh_.triangles[t]) {
      most = std::max(most, plane.normal.dot(mesh_.vertices[v]) - plane.at);
    }
    return most > 1e-9 * edge_;
  }

  bool has_facing(const Bin& a, const Bin& b) const {
    // |s - t|^2 = 2 - 2 s . t: faces can look at each other only where normals lie far apart.
    const Vec3 wide = a.high.cwiseMax(b.high) - a.low.cwiseMin(b.low);
    if (!(wide.squaredNorm() > 2 - 2 * kFacing - 1e-6)) return false;
    for (const std::int32_t s : a.triangles) {
      for (const std::int32_t t : b.triangles) {
        if (planes_[s].normal.dot(planes_[t].normal) < kFacing && is_before(s, t) &&
            is_before(t, s)) {
          return true;
        }
      }
    }
    return false;
  }

  /// Sites, the one and the next along an axis, between which there may be a gap: looked for around
  /// cubes that the surface goes through, which are few.
  std::vector<std::array<std::int32_t, 3>> neighbours_to_ask() {
    std::vector<std::pair<std::int64_t, Bin*>> bins;
    for (auto& bin : bins_) bins.push_back({bin.first, &bin.second});
    std::sort(bins.begin(), bins.end());
    const auto for_each_bin = [&](const auto& f) {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, bins.size(), 64),
                        [&](const tbb::blocked_range<std::size_t>& range) {
                          for (std::size_t i = range.begin(); i < range.end(); ++i) f(i);
                        });
    };
    for_each_bin([&](std::size_t i) {
      Bin& bin = *bins[i].second;
      bin.has_facing = has_facing(bin, bin);
    });
    // Bits of an axis: with the next one, with the one before where the surface does not go through
    // that.
    std::vector<std::uint8_t> ask(bins.size(), 0);
    for_each_bin([&](std::size_t i) {
      const Bin& here = *bins[i].second;
      for (int axis = 0; axis < 3; ++axis) {
        const Bin& next = bin_at(bins[i].first + kStep[axis]);
        if (here.has_facing || next.has_facing || has_facing(here, next)) ask[i] |= 1u << axis;
        if (here.has_facing && bin_at(bins[i].first - kStep[axis]).triangles.empty()) {
          ask[i] |= 8u << axis;
        }
      }
    });
    std::vector<std::pair<std::int64_t, int>> pairs;
    for (std::size_t i = 0; i < bins.size(); ++i) {
      for (int axis = 0; axis < 3; ++axis) {
        if ((ask[i] >> axis & 1) != 0) pairs.push_back({bins[i].first, axis});
        if ((ask[i] >> axis & 8) != 0) pairs.push_back({bins[i].first - kStep[axis], axis});
      }
    }
    std::vector<std::array<std::int32_t, 3>> asked;
    if (pairs.empty()) return asked;
    std::sort(pairs.begin(), pairs.end());
    std::vector<std::int64_t> keys;  // sorted, as sites are
    keys.reserve(lattice_.sites.size());
    for (const Lattice::Site& s : lattice_.sites) keys.push_back(key_of({s.x, s.y, s.z}));
    const auto site_at = [&](std::int64_t key) {
      const auto at = std::lower_bound(keys.begin(), keys.end(), key);
      return at == keys.end() || *at != key ? -1 : static_cast<std::int32_t>(at - keys.begin());
    };
    for (const auto& [key, axis] : pairs) {
      const std::int32_t p = site_at(key);
      const std::int32_t q = p < 0 ? -1 : site_at(key + kStep[axis]);
      if (q >= 0) asked.push_back({p, q, axis});
    }
    return asked;
  }

  /// Where the cube begins; where the next one does, it ends, to the last bit.
  double low_of(const Cube& c, int axis) const { return begin_of(c[axis], axis); }
  double high_of(const Cube& c, int axis) const { return begin_of(c[axis] + 1, axis); }
  double begin_of(int cube, int axis) const { return lattice_.origin[axis] + edge_ * cube; }
  /// Where the line with this number lies across.
  double line_at(const Cube& c, int axis, int line) const {
    const double off = kOff * (1 + 0.37 * axis);
    return low_of(c, axis) + edge_ * ((line + 0.5) / kLines + off);
  }

  /// On which side of an edge a line along an axis lies: alike for both triangles at the edge.
  double side(int a, int b, int u, int v, double at_u, double at_v, bool& left) const {
    const Vec3& low = mesh_.vertices[std::min(a, b)];
    const Vec3& high = mesh_.vertices[std::max(a, b)];
    const double area = (low[u] - at_u) * (high[v] - at_v) - (high[u] - at_u) * (low[v] - at_v);
    left = (area >= 0) == (a < b);
    return std::abs(area);
  }

  /// Where a line along an axis passes some triangles between two places.
  void pass(const std::vector<std::int32_t>& some, int axis, double at_u, double at_v, double from,
            double to, std::vector<Pass>& passes) const {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (const std::int32_t t : some) {
      const std::array<int, 3>& c = mesh_.triangles[t];
      bool left[3];
      double weight[3];
      for (int k = 0; k < 3; ++k) {
        weight[(k + 2) % 3] = side(c[k], c[(k + 1) % 3], u, v, at_u, at_v, left[k]);
      }
      if (left[0] != left[1] || left[1] != left[2]) continue;
      const double sum = weight[0] + weight[1] + weight[2];
      if (!(sum > 0)) continue;
      double at = 0;
      for (int k = 0; k < 3; ++k) at += weight[k] / sum * mesh_.vertices[c[k]][axis];
      if (at < from || at >= to) continue;
      passes.push_back({at, left[0] ? -1 : 1, t});
    }
    std::sort(passes.begin(), passes.end(), [](const Pass& a, const Pass& b) {
      return a.at < b.at || (a.at == b.at && a.step > b.step);
    });
  }

  /// Whether all of a line from one place to another is solid; `winding` at its beginning.
  static bool is_solid(const std::vector<Pass>& passes, double from, double to, int winding) {
    for (const Pass& p : passes) {
      if (p.at < from) continue;
      if (p.at >= to) break;
      winding += p.step;
      if (winding <= 0) return false;
    }
    return winding > 0;
  }

  void take_apart(const RayTree& tree, const Cube& c, CubeParts& parts) const {
    const std::vector<std::int32_t>& some = bin_of(c).triangles;
    double x[3][kLines];
    for (int axis = 0; axis < 3; ++axis) {
      for (int l = 0; l < kLines; ++l) x[axis][l] = line_at(c, axis, l);
      parts.first[axis] = x[axis][0];
      parts.last[axis] = x[axis][kLines - 1];
    }
    const double low = low_of(c, 0), high = high_of(c, 0);
    for (int m = 0; m < kLines * kLines; ++m) {
      const int i = m % kLines, j = m / kLines;
      pass(some, 0, x[1][i], x[2][j], low, high, parts.passes[0][m]);
      // Along y lines are numbered by x and z: pass() takes z first there.
      pass(some, 1, x[2][j], x[0][i], low_of(c, 1), high_of(c, 1), parts.passes[1][m]);
      pass(some, 2, x[0][i], x[1][j], low_of(c, 2), high_of(c, 2), parts.passes[2][m]);
    }
    const Vec3 direction = Vec3(0.8711, 0.3917, 0.2963).normalized();
    // Stretches of lines along x, each a part at first.
    std::vector<double> length;
    const double area = edge_ * edge_ / (kLines * kLines);
    parts.part.fill(-1);
    parts.low.fill(-1);
    parts.high.fill(-1);
    parts.winding.fill(0);
    for (int m = 0; m < kLines * kLines; ++m) {
      // Where the cube begins there may be a face: counted from a sample on.
      int winding = tree.winding(Vec3(x[0][0], x[1][m % kLines], x[2][m / kLines]), direction);
      for (const Pass& p : parts.passes[0][m]) winding -= p.at < x[0][0] ? p.step : 0;
      double from = low;
      int sample = 0;
      const auto stretch_to = [&](double to) {
        if (winding > 0) length.push_back(0);
        const auto part = static_cast<std::int16_t>(winding > 0 ? length.size() - 1 : -1);
        if (part >= 0) length.back() = to - from;
        if (from == low) parts.low[m] = part;
        if (to == high) parts.high[m] = part;
        for (; sample < kLines && x[0][sample] < to; ++sample) {
          parts.part[kLines * m + sample] = part;
          parts.winding[kLines * m + sample] = static_cast<std::int8_t>(winding);
        }
        from = to;
      };
      for (const Pass& p : parts.passes[0][m]) {
        if ((winding > 0) != (winding + p.step > 0)) stretch_to(p.at);
        winding += p.step;
      }
      stretch_to(high);
    }
    UnionFind joined(length.size());
    for (int s = 0; s < 64; ++s) {
      const int i = s % 4, j = s / 4 % 4, k = s / 16;
      if (parts.part[s] < 0) continue;
      if (j < 3 && parts.part[s + 4] >= 0 &&
          is_solid(parts.passes[1][kLines * k + i], x[1][j], x[1][j + 1], parts.winding[s])) {
        joined.join(parts.part[s], parts.part[s + 4]);
      }
      if (k < 3 && parts.part[s + 16] >= 0 &&
          is_solid(parts.passes[2][kLines * j + i], x[2][k], x[2][k + 1], parts.winding[s])) {
        joined.join(parts.part[s], parts.part[s + 16]);
      }
    }
    std::vector<std::int16_t> number(length.size(), -1);
    for (std::size_t l = 0; l < length.size(); ++l) {
      const std::int32_t root = joined.root(static_cast<std::int32_t>(l));
      if (number[root] < 0) {
        number[root] = static_cast<std::int16_t>(parts.volume.size());
        parts.volume.push_back(0);
      }
      number[l] = number[root];
      parts.volume[number[l]] += area * length[l];
    }
    const auto renumber = [&](std::int16_t& p) { p = p < 0 ? p : number[p]; };
    for (std::int16_t& p : parts.part) renumber(p);
    for (std::int16_t& p : parts.low) renumber(p);
    for (std::int16_t& p : parts.high) renumber(p);
    if (parts.volume.empty()) return;
    parts.own = static_cast<int>(std::max_element(parts.volume.begin(), parts.volume.end()) -
                                 parts.volume.begin());
  }

  /// Calls f(part of a, part of b) for parts that meet where the cubes do, b after a along an axis.
  template <class F>
  void for_each_join(const CubeParts& a, const CubeParts& b, int axis, const F& f) const {
    for (int m = 0; m < kLines * kLines; ++m) {
      if (axis == 0) {
        if (a.high[m] >= 0 && b.low[m] >= 0) f(a.high[m], b.low[m]);
        continue;
      }
      const int i = m % kLines, j = m / kLines;
      const int last = axis == 1 ? 16 * j + 12 + i : 48 + 4 * j + i;  // sample of a
      const int first = axis == 1 ? 16 * j + i : 4 * j + i;           // sample of b
      if (a.part[last] < 0 || b.part[first] < 0) continue;
      // Both lists are cut off where the cubes meet, and one goes on where the other ends.
      int winding = a.winding[last];
      bool solid = true;
      const auto go = [&](const std::vector<Pass>& passes, double from, double to) {
        for (const Pass& p : passes) {
          if (p.at < from || p.at >= to) continue;
          winding += p.step;
          solid = solid && winding > 0;
        }
      };
      go(a.passes[axis][m], a.last[axis], 1e300);
      go(b.passes[axis][m], -1e300, b.first[axis]);
      if (solid) f(a.part[last], b.part[first]);
    }
  }

  /// The gap on the way from a site to the next one along an axis.
  Lattice::Gap gap_between(std::int32_t site, int axis) const {
    Lattice::Gap gap;
    gap.site = site;
    gap.axis = axis;
    const Cube c = cube_of(site);
    Cube next = c;
    ++next[axis];
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const double at_u = low_of(c, u) + (0.5 + 1e-5) * edge_,
                 at_v = low_of(c, v) + (0.5 + 2e-5) * edge_, low = low_of(c, axis);
    std::vector<Pass> passes, then;
    pass(bin_of(c).triangles, axis, at_u, at_v, low, high_of(c, axis), passes);
    pass(bin_of(next).triangles, axis, at_u, at_v, low_of(next, axis), high_of(next, axis), then);
    passes.insert(passes.end(), then.begin(), then.end());
    for (std::size_t i = 0; i + 1 < passes.size(); ++i) {
      if (passes[i].step > 0 || passes[i + 1].step < 0) continue;
      const double middle = 0.5 * (passes[i].at + passes[i + 1].at);
      gap.place = std::clamp((middle - low) / edge_ - 0.5, 0.0, 1.0);
      gap.normal = (planes_[passes[i].triangle].normal - planes_[passes[i + 1].triangle].normal)
                       .stableNormalized();
      break;
    }
    return gap;
  }

  void hand_over(const Handover& h, CubeParts& parts) {
    if (!(parts.volume[h.part] > 0)) return;  // went to another one
    double all = 0;
    for (const double volume : parts.volume) all += volume;
    Lattice::Site &from = lattice_.sites[h.from], &to = lattice_.sites[h.to];
    const auto moved = static_cast<float>(from.volume * parts.volume[h.part] / all);
    from.volume -= moved;
    to.volume += moved;
    parts.volume[h.part] = 0;
  }

  const TriangleMesh& mesh_;
  Lattice& lattice_;
  double edge_;
  std::vector<Plane> planes_;
  std::unordered_map<std::int64_t, Bin> bins_;  // by key_of()
};

}  // namespace

void find_gaps(const TriangleMesh& mesh, Lattice& lattice) { Gaps(mesh, lattice).find(); }

}  // namespace tissue_sim
