#include "fragments/pieces.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>

#include "cutting/bonds.h"
#include "cutting/node_box.h"

namespace tissue_sim {
namespace {

/// Points begin .. end - 1: neighbours along x that hold together. They stand and fall together.
struct Run {
  std::int32_t begin, end;
};

std::vector<Run> runs_of(const Points& points) {
  constexpr std::uint64_t kBackInX = 0x0101010101010101 << opposite_bond(kForwardBond);
  const std::int32_t count = points.size();
  std::vector<Run> runs;
  for (std::int32_t p = 0; p < count;) {
    std::uint64_t bonds = 0;  // of eight points
    std::memcpy(&bonds, &points.bonds[p], std::min(8, count - p));
    if ((bonds & kBackInX) == kBackInX) {
      p += 8;
      continue;
    }
    if ((bonds & kBackInX & 0xff) == 0) {
      if (!runs.empty()) runs.back().end = p;
      runs.push_back({p, count});
    }
    ++p;
  }
  return runs;
}

int root(std::vector<int>& parent, int i) {
  while (parent[i] != i) {
    parent[i] = parent[parent[i]];
    i = parent[i];
  }
  return i;
}

/// First run of each run's component (union-find). Where two runs lie side by side the first bond
/// between them tells.
std::vector<int> components(const std::vector<LatticeBody>& bodies, const Points& points,
                            const std::vector<Run>& runs) {
  std::vector<int> parent(runs.size());
  std::iota(parent.begin(), parent.end(), 0);
  for (const int k : {kForwardBond + 1, kForwardBond + 2}) {
    const BondOffset o = bond_offset(k);
    std::size_t other = 0;  // only goes up: points are numbered along x, then y, then z
    for (std::size_t i = 0; i < runs.size(); ++i) {
      for (std::int32_t p = runs[i].begin; p < runs[i].end;) {
        if ((points.bonds[p] >> k & 1) == 0) {
          ++p;
          continue;
        }
        const Points::Site& s = points.site[p];
        const std::int32_t q = bodies[s.body].point(s.x, s.y + o.y, s.z + o.z);
        while (runs[other].end <= q) ++other;
        const int a = root(parent, static_cast<int>(i)), b = root(parent, static_cast<int>(other));
        parent[std::max(a, b)] = std::min(a, b);
        p += std::min(runs[i].end - p, runs[other].end - q);
      }
    }
  }
  for (std::size_t i = 0; i < runs.size(); ++i) parent[i] = root(parent, static_cast<int>(i));
  return parent;
}

double volume_of(const Points& points, const Run& run) {
  double sum[4] = {};  // side by side: each waits for what it was
  std::int32_t p = run.begin;
  for (; p + 4 <= run.end; p += 4) {
    for (int i = 0; i < 4; ++i) sum[i] += points.volume[p + i];
  }
  for (; p < run.end; ++p) sum[0] += points.volume[p];
  return sum[0] + sum[1] + (sum[2] + sum[3]);
}

/// Loose is what came off something, or lies in a body that is held elsewhere, and is not held
/// itself.
void tell_loose(const Points& points, const std::vector<Run>& runs, Pieces& pieces) {
  std::vector<bool> anchored(pieces.next_id, false), body_held(pieces.all.size(), false);
  for (const Run& run : runs) {
    const auto end = points.anchored.begin() + run.end;
    if (std::find(points.anchored.begin() + run.begin, end, 1) != end) {
      anchored[pieces.of_point[run.begin]] = true;
    }
  }
  for (const Fragment& f : pieces.all) body_held[f.body] = body_held[f.body] || anchored[f.id];
  for (Fragment& f : pieces.all) {
    f.loose = !anchored[f.id] && (f.parent >= 0 || body_held[f.body]);
  }
}

}  // namespace

Pieces whole_pieces(const std::vector<LatticeBody>& bodies, const Points& points) {
  Pieces pieces;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Fragment f;
    f.id = f.body = static_cast<int>(b);
    pieces.all.push_back(f);
  }
  pieces.next_id = static_cast<int>(bodies.size());
  pieces.of_point.reserve(points.size());
  for (std::int32_t p = 0; p < points.size(); ++p) {
    Fragment& f = pieces.all[points.site[p].body];
    pieces.of_point.push_back(f.id);
    ++f.point_count;
    f.volume += points.volume[p];
  }
  tell_loose(points, runs_of(points), pieces);
  update_pieces(bodies, points, pieces);  // a mesh may have parts that do not touch
  return pieces;
}

bool may_have_parted(const std::vector<LatticeBody>& bodies, const Points& points,
                     const BondWindows& bonds, const std::vector<std::int32_t>& changed) {
  Planes components[216];
  int count = 0;
  Points::Site of{-1, -1, -1, -1};  // the cell that they are around
  for (const std::int32_t p : changed) {
    const Points::Site& s = points.site[p];
    const LatticeBody& body = bodies[s.body];
    if (s.x / 2 != of.x || s.y / 2 != of.y || s.z / 2 != of.z || s.body != of.body) {
      of = {static_cast<std::int16_t>(s.x / 2), static_cast<std::int16_t>(s.y / 2),
            static_cast<std::int16_t>(s.z / 2), s.body};
      count = bonds.find_components(of.body, of.x, of.y, of.z, components);
    }
    const auto component_of = [&](int x, int y, int z) {
      const int plane = z - 2 * of.z + 2, bit = bit_in_plane(x - 2 * of.x + 2, y - 2 * of.y + 2);
      int i = 0;
      while (i < count && (components[i][plane] >> bit & 1) == 0) ++i;
      return i;
    };
    const int own = component_of(s.x, s.y, s.z);
    for (int k = 0; k < kBondCount; ++k) {
      if ((points.bonds[p] >> k & 1) != 0) continue;
      const BondOffset o = bond_offset(k);
      const int x = s.x + o.x, y = s.y + o.y, z = s.z + o.z;
      if (body.point(x, y, z) >= 0 && component_of(x, y, z) != own) return true;
    }
  }
  return false;
}

std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               Pieces& pieces) {
  const std::vector<Run> runs = runs_of(points);
  const std::vector<int> first_of = components(bodies, points, runs);
  struct Part {
    int first;  // run
    int count;  // points
  };
  std::vector<int> size(runs.size(), 0), id_of(runs.size(), -1), fresh;  // by first run
  for (std::size_t i = 0; i < runs.size(); ++i) size[first_of[i]] += runs[i].end - runs[i].begin;
  std::map<int, std::vector<Part>> parts_of;  // by piece, each in the order of its lowest point
  for (int i = 0; i < static_cast<int>(runs.size()); ++i) {
    if (first_of[i] == i) parts_of[pieces.of_point[runs[i].begin]].push_back({i, size[i]});
  }
  for (const auto& [id, parts] : parts_of) {
    const auto largest = std::max_element(
        parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.count < b.count; });
    for (auto part = parts.begin(); part != parts.end(); ++part) {
      id_of[part->first] = part == largest ? id : pieces.next_id;
      if (part == largest) continue;
      Fragment f;
      f.id = pieces.next_id++;
      f.parent = id;
      f.body = points.site[runs[part->first].begin].body;
      fresh.push_back(f.id);
      pieces.all.push_back(f);
    }
  }
  if (fresh.empty()) return fresh;
  std::vector<int> index(pieces.next_id, -1);  // of a piece in `all`
  for (std::size_t i = 0; i < pieces.all.size(); ++i) {
    index[pieces.all[i].id] = static_cast<int>(i);
  }
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const Run& run = runs[i];
    const int from = pieces.of_point[run.begin], to = id_of[first_of[i]];
    if (from == to) continue;
    Fragment &rest = pieces.all[index[from]], &part = pieces.all[index[to]];
    const double volume = volume_of(points, run);
    part.point_count += run.end - run.begin;
    rest.point_count -= run.end - run.begin;
    part.volume += volume;
    rest.volume -= volume;
    std::fill(pieces.of_point.begin() + run.begin, pieces.of_point.begin() + run.end, to);
  }
  tell_loose(points, runs, pieces);
  return fresh;
}

}  // namespace tissue_sim
