// A surface for any loop: rings of vertices around its middle.
#include <algorithm>

#include "pbd/cap_mesh.h"

namespace tissue_sim {
namespace pbd {

CapMesh fill_by_rings(const std::vector<Vec3>& loop, double edge, double rise) {
  CapMesh cap;
  std::vector<Vec3> at = loop;
  std::vector<int> ring(loop.size());
  for (std::size_t i = 0; i < loop.size(); ++i) ring[i] = static_cast<int>(i);
  const auto middle_of = [&at](const std::vector<int>& of) {
    Vec3 sum = Vec3::Zero();
    for (const int v : of) sum += at[v] / static_cast<double>(of.size());
    return sum;
  };
  const auto add = [&](const Vec3& x) {
    at.push_back(x);
    cap.inner.push_back(x);
    std::vector<double> w;
    double sum = 0;
    for (const Vec3& corner : loop) {
      w.push_back(1 / ((corner - x).squaredNorm() + 1e-30));
      sum += w.back();
    }
    for (double& v : w) v /= sum;
    cap.weights.push_back(std::move(w));
    return static_cast<int>(at.size()) - 1;
  };
  for (int round = 0; round < 30; ++round) {
    const Vec3 middle = middle_of(ring);
    const std::size_t n = ring.size();
    // A vertex further in for each run of edges that is long enough, and where the run ends.
    std::vector<Vec3> inner;
    std::vector<std::size_t> end;
    double run = 0, nearest = 1e300;
    for (std::size_t i = 0; i < n; ++i) {
      run += (at[ring[i]] - at[ring[(i + 1) % n]]).norm();
      if (run < edge) continue;
      run = 0;
      const Vec3 way = middle - at[ring[i]];
      nearest = std::min(nearest, way.norm());
      inner.push_back(at[ring[i]] + 0.8 * edge * way.stableNormalized());
      end.push_back(i + 1);
    }
    if (inner.size() < 5 || inner.size() >= n + 1 || nearest < 1.6 * edge) break;
    std::vector<int> next;
    for (const Vec3& x : inner) next.push_back(add(x));
    end.back() = n;
    const std::size_t m = next.size();
    for (std::size_t k = 0, i = 0; k < m; ++k) {
      for (; i < end[k]; ++i) cap.triangles.push_back({ring[i], ring[(i + 1) % n], next[k]});
      cap.triangles.push_back({ring[end[k] % n], next[(k + 1) % m], next[k]});
    }
    ring.swap(next);
  }
  Vec3 normal = Vec3::Zero();
  for (std::size_t i = 0; i < ring.size(); ++i) {
    normal += (at[ring[i]] - at[ring[0]]).cross(at[ring[(i + 1) % ring.size()]] - at[ring[0]]);
  }
  const int top = add(middle_of(ring) + rise * normal.stableNormalized());
  for (std::size_t i = 0; i < ring.size(); ++i) {
    cap.triangles.push_back({ring[i], ring[(i + 1) % ring.size()], top});
  }
  return cap;
}

}  // namespace pbd
}  // namespace tissue_sim
