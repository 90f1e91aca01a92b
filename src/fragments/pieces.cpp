#include "fragments/pieces.h"

#include <algorithm>
#include <cstring>
#include <map>
#include <numeric>
#include <unordered_map>

#include "mpm/lattice/bonds.h"
#include "mpm/split/node_box.h"

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
    const std::uint64_t gone = ~bonds & kBackInX;
    if (gone == 0) {
      p += 8;
      continue;
    }
    p += __builtin_ctzll(gone) / 8;
    if (p >= count) break;
    if (!runs.empty()) runs.back().end = p;
    runs.push_back({p, count});
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

double volume_of(const Points& points, const PartedRun& run) {
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
void tell_loose(Pieces& pieces) {
  std::vector<bool> anchored(pieces.next_id, false), body_held(pieces.all.size(), false);
  for (const std::int32_t p : pieces.anchored) anchored[pieces.of_point[p]] = true;
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
    if (f.point_count == 0) pieces.lowest.push_back(p);
    pieces.of_point.push_back(f.id);
    ++f.point_count;
    f.volume += points.volume[p];
    if (points.anchored[p] != 0) pieces.anchored.push_back(p);
  }
  tell_loose(pieces);
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

std::vector<int> part_pieces(const Points& points, const std::vector<PartedRun>& parted,
                             Pieces& pieces) {
  struct Part {
    std::int32_t lowest;
    int count;
    double volume;
  };
  std::vector<int> index(pieces.next_id, -1);  // of a piece in `all`
  for (std::size_t i = 0; i < pieces.all.size(); ++i) {
    index[pieces.all[i].id] = static_cast<int>(i);
  }
  // By piece, each in the order of its lowest point: first what is left of it.
  std::map<int, std::vector<Part>> parts_of;
  std::unordered_map<std::int32_t, int> place;  // of a part, by its lowest point
  for (const PartedRun& run : parted) {
    const int id = pieces.of_point[run.begin];
    std::vector<Part>& parts = parts_of[id];
    if (parts.empty()) {
      const Fragment& piece = pieces.all[index[id]];
      parts.push_back({pieces.lowest[id], piece.point_count, piece.volume});
    }
    const auto [at, is_new] = place.try_emplace(run.lowest, static_cast<int>(parts.size()));
    if (is_new) parts.push_back({run.lowest, 0, 0});
    const double volume = volume_of(points, run);
    for (Part* part : {&parts[at->second], &parts[0]}) {
      const int sign = part == &parts[0] ? -1 : 1;
      part->count += sign * (run.end - run.begin);
      part->volume += sign * volume;
    }
  }
  std::vector<int> fresh;
  std::unordered_map<std::int32_t, int> id_of;  // of a part, by its lowest point
  for (const auto& [id, parts] : parts_of) {
    const auto largest = std::max_element(
        parts.begin(), parts.end(), [](const Part& a, const Part& b) { return a.count < b.count; });
    for (auto part = parts.begin(); part != parts.end(); ++part) {
      const int own_id = part == largest ? id : pieces.next_id;
      id_of[part->lowest] = own_id;
      if (part != largest) {
        Fragment f;
        f.id = pieces.next_id++;
        f.parent = id;
        f.body = pieces.all[index[id]].body;
        index.push_back(static_cast<int>(pieces.all.size()));
        fresh.push_back(f.id);
        pieces.all.push_back(f);
        pieces.lowest.push_back(part->lowest);
      }
      Fragment& piece = pieces.all[index[own_id]];
      piece.point_count = part->count;
      piece.volume = part->volume;
    }
    pieces.lowest[id] = largest->lowest;
    if (largest == parts.begin()) continue;
    const int now = id_of[parts[0].lowest];
    // Written to whether or not it changes, as std::replace() is not: in vectors.
    for (std::int32_t& piece : pieces.of_point) piece = piece == id ? now : piece;
  }
  for (const PartedRun& run : parted) {
    std::fill(pieces.of_point.begin() + run.begin, pieces.of_point.begin() + run.end,
              id_of[run.lowest]);
  }
  if (!fresh.empty()) tell_loose(pieces);
  return fresh;
}

std::vector<int> update_pieces(const std::vector<LatticeBody>& bodies, const Points& points,
                               Pieces& pieces) {
  const std::vector<Run> runs = runs_of(points);
  const std::vector<int> first_of = components(bodies, points, runs);
  std::vector<PartedRun> parted;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    const std::int32_t lowest = runs[first_of[i]].begin;
    if (pieces.lowest[pieces.of_point[runs[i].begin]] == lowest) continue;
    parted.push_back({runs[i].begin, runs[i].end, lowest});
  }
  return part_pieces(points, parted, pieces);
}

}  // namespace tissue_sim
