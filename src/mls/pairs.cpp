#include "mls/pairs.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "geometry/nearest.h"
#include "math/union_find.h"

namespace tissue_sim {

std::int32_t MlsPairs::find(std::int32_t node, std::int32_t neighbour) const {
  const auto first = other.begin() + begin[node], last = other.begin() + begin[node + 1];
  const auto at = std::lower_bound(first, last, neighbour);
  return at != last && *at == neighbour ? static_cast<std::int32_t>(at - other.begin()) : -1;
}

// 1.5 reaches past the edges of a cubic lattice's cells (18 neighbours), 1.9 past their corners
// (26), 2.2 past the next but one (32).
double support_factor(int neighbours) {
  return neighbours <= 32 ? 1.5 + 0.05 * (neighbours - 18) : 2.2 * std::cbrt(neighbours / 32.0);
}

namespace {

/// Of the kernel, over h^9: 315 / 64 pi cancels. Beyond the support, where a mesh's edge joins
/// nodes, as much of moments as at four fifths of it.
double kernel(double r2, double h) {
  constexpr double kFarthest = 0.8 * 0.8;
  if (r2 < h * h) return std::pow(h * h - r2, 3);
  return std::pow((1 - kFarthest) * h * h, 3) * kFarthest * h * h / r2;
}

/// What no pairs join, but edges of a tetrahedral mesh do, is joined by all of these.
void join_as_meshes_do(const MlsNodes& nodes, std::vector<std::vector<std::int32_t>>& of) {
  if (nodes.mesh_edges.empty()) return;
  UnionFind linked(nodes.count());
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    for (const std::int32_t j : of[i]) linked.join(i, j);
  }
  for (const auto& [i, j] : nodes.mesh_edges) {
    if (linked.root(i) == linked.root(j)) continue;
    of[i].insert(std::lower_bound(of[i].begin(), of[i].end(), j), j);
    of[j].insert(std::lower_bound(of[j].begin(), of[j].end(), i), i);
  }
}

}  // namespace

MlsPairs make_pairs(const MlsNodes& nodes, int neighbours, Cpu& cpu) {
  const std::int32_t n = nodes.count();
  MlsPairs pairs;
  pairs.support.resize(n);
  std::vector<std::vector<std::int32_t>> of(n);
  const double factor = support_factor(neighbours);
  for (std::int32_t first = 0; first < n;) {  // body by body
    std::int32_t last = first;
    std::vector<Vec3> places;
    for (; last < n && nodes.body[last] == nodes.body[first]; ++last) {
      places.push_back(nodes.place[last]);
    }
    const auto body = static_cast<std::size_t>(nodes.body[first]);
    const NearGaps* gaps =
        body < nodes.gaps.size() && !nodes.gaps[body].empty() ? &nodes.gaps[body] : nullptr;
    const NearestPoints tree(places);
    cpu.for_each(last - first, [&](int i) {
      std::vector<Neighbour> found;
      tree.nearest(places[i], 7, found);
      double sum = 0;
      for (std::size_t k = 1; k < found.size(); ++k) sum += std::sqrt(found[k].distance2);
      pairs.support[first + i] = found.size() > 1 ? factor * sum / (found.size() - 1) : 0;
    });
    const double widest =
        *std::max_element(pairs.support.begin() + first, pairs.support.begin() + last);
    cpu.for_each(last - first, [&](int i) {
      std::vector<Neighbour> found;
      const double own = pairs.support[first + i];
      tree.within(places[i], 0.5 * (own + widest), found);
      for (const Neighbour& f : found) {
        const double reach = 0.5 * (own + pairs.support[first + f.index]);
        if (f.index == i || !(f.distance2 < reach * reach)) continue;
        if (nodes.part[first + i] != nodes.part[first + f.index]) continue;
        // Alike from either end.
        if (gaps == nullptr ||
            gaps->joined(places[std::min(i, f.index)], places[std::max(i, f.index)])) {
          of[first + i].push_back(first + f.index);
        }
      }
    });
    first = last;
  }
  join_as_meshes_do(nodes, of);
  pairs.begin.push_back(0);
  for (std::int32_t i = 0; i < n; ++i) {
    pairs.other.insert(pairs.other.end(), of[i].begin(), of[i].end());
    pairs.begin.push_back(static_cast<std::int32_t>(pairs.other.size()));
  }
  const std::size_t count = pairs.other.size();
  pairs.twin.resize(count);
  pairs.whole.resize(count);
  pairs.crossed.assign(count, 0);
  std::vector<double> weight(count);
  double sum = 0;
  for (std::int32_t i = 0; i < n; ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      const std::int32_t j = pairs.other[e];
      pairs.twin[e] = pairs.find(j, i);
      const double h = 0.5 * (pairs.support[i] + pairs.support[j]);
      const double r2 = (nodes.place[j] - nodes.place[i]).squaredNorm();
      if (!(r2 > 1e-8 * h * h)) {
        throw std::invalid_argument("nodes " + std::to_string(std::min(i, j)) + " and " +
                                    std::to_string(std::max(i, j)) +
                                    " are at one place: each needs its own");
      }
      const double volumes = static_cast<double>(nodes.volume[i]) * nodes.volume[j];
      weight[e] = std::sqrt(std::sqrt(volumes)) * kernel(r2, h) / std::pow(h, 9);
      sum += weight[e];
    }
  }
  for (std::size_t e = 0; e < count; ++e) {
    pairs.whole[e] = static_cast<float>(weight[e] * count / sum);
  }
  pairs.weight = pairs.whole;
  return pairs;
}

void note_far_pairs(const MlsNodes& nodes, const MlsPairs& pairs, std::vector<std::string>& notes) {
  int far = 0;
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      const std::int32_t j = pairs.other[e];
      const double reach = 0.5 * (pairs.support[i] + pairs.support[j]);
      far += i < j && (nodes.place[j] - nodes.place[i]).squaredNorm() >= reach * reach ? 1 : 0;
    }
  }
  if (far == 0) return;
  notes.push_back("the vertices of tetrahedra, as nodes, hang together by " + std::to_string(far) +
                  " edges of their meshes that reach past what is near: cells are too long and "
                  "thin; mesh them more evenly, or take mpm");
}

}  // namespace tissue_sim
