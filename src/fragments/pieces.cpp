#include "fragments/pieces.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <numeric>

#include "cutting/bonds.h"

namespace tissue_sim {
namespace {

std::int32_t root(std::vector<std::int32_t>& parent, std::int32_t p) {
  while (parent[p] != p) {
    parent[p] = parent[parent[p]];
    p = parent[p];
  }
  return p;
}

/// Lowest point of each point's component. Points that x-bonds hold together in a run stand and
/// fall with its first.
std::vector<std::int32_t> components(const std::vector<LatticeBody>& bodies, const Points& points) {
  constexpr int kBackInX = opposite_bond(kForwardBond);
  std::vector<std::int32_t> run(points.size());
  for (std::int32_t p = 0; p < points.size(); ++p) {
    run[p] = (points.bonds[p] >> kBackInX & 1) != 0 ? run[p - 1] : p;
  }
  std::vector<std::int32_t> parent(points.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (const int k : {kForwardBond + 1, kForwardBond + 2}) {
    const BondOffset o = bond_offset(k);
    std::int32_t from = -1, to = -1;  // runs joined last
    for (std::int32_t p = 0; p < points.size(); ++p) {
      if ((points.bonds[p] >> k & 1) == 0) continue;
      const Points::Site& s = points.site[p];
      const std::int32_t q = run[bodies[s.body].point(s.x, s.y + o.y, s.z + o.z)];
      if (run[p] == from && q == to) continue;
      from = run[p];
      to = q;
      const std::int32_t a = root(parent, from), b = root(parent, to);
      if (a != b) parent[std::max(a, b)] = std::min(a, b);
    }
  }
  for (std::int32_t p = 0; p < points.size(); ++p) run[p] = root(parent, run[p]);
  return run;
}

/// Counts, volumes and anchors of the labelled pieces.
void count_points(const Points& points, Pieces& pieces) {
  std::vector<bool> anchored(pieces.next_id, false);
  std::vector<int> index(pieces.next_id, -1);
  for (std::size_t i = 0; i < pieces.all.size(); ++i) {
    index[pieces.all[i].id] = static_cast<int>(i);
    pieces.all[i].point_count = 0;
    pieces.all[i].volume = 0;
  }
  for (std::int32_t p = 0; p < points.size(); ++p) {
    Fragment& f = pieces.all[index[pieces.of_point[p]]];
    ++f.point_count;
    f.volume += points.volume[p];
    if (points.anchored[p]) anchored[f.id] = true;
  }
  std::vector<bool> body_held(pieces.all.size(), false);
  for (const Fragment& f : pieces.all) body_held[f.body] = body_held[f.body] || anchored[f.id];
  for (Fragment& f : pieces.all) {
    f.loose = !anchored[f.id] && (f.parent >= 0 || body_held[f.body]);
  }
}

}  // namespace

Pieces whole_pieces(const std::vector<LatticeBody>& bodies, const Points& points) {
  Pieces pieces;
  pieces.of_point.assign(points.size(), 0);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Fragment f;
    f.id = f.body = static_cast<int>(b);
    pieces.all.push_back(f);
  }
  pieces.next_id = static_cast<int>(bodies.size());
  for (std::int32_t p = 0; p < points.size(); ++p) pieces.of_point[p] = points.site[p].body;
  update_pieces(bodies, points, pieces);  // a mesh may have parts that do not touch
  return pieces;
}

std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               Pieces& pieces) {
  const std::vector<std::int32_t> component = components(bodies, points);
  struct Part {
    std::int32_t lowest;
    int count;
  };
  std::map<int, std::vector<Part>> parts_of;  // by piece, each in the order of its lowest point
  std::vector<int> size(points.size(), 0);
  for (std::int32_t p = 0; p < points.size(); ++p) ++size[component[p]];
  for (std::int32_t p = 0; p < points.size(); ++p) {
    if (component[p] == p) parts_of[pieces.of_point[p]].push_back({p, size[p]});
  }
  std::vector<int> id_of(points.size(), -1), fresh;
  for (const auto& [id, parts] : parts_of) {
    const auto largest = std::max_element(
        parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.count < b.count; });
    for (auto part = parts.begin(); part != parts.end(); ++part) {
      if (part == largest) {
        id_of[part->lowest] = id;
        continue;
      }
      Fragment f;
      f.id = pieces.next_id++;
      f.parent = id;
      f.body = points.site[part->lowest].body;
      id_of[part->lowest] = f.id;
      fresh.push_back(f.id);
      pieces.all.push_back(f);
    }
  }
  for (std::int32_t p = 0; p < points.size(); ++p) pieces.of_point[p] = id_of[component[p]];
  count_points(points, pieces);
  return fresh;
}

}  // namespace tissue_sim
