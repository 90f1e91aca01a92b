#include "mls/crossing.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "cutting/blade_sweep.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

/// Chunks that a thread looks at at a time.
constexpr int kChunksAtATime = 32;
/// Of sides: a bit for each side of each of three slabs.
constexpr std::uint8_t kAllSides = 0x3f;
/// Rounding of what a node's place comes to along an axis, over the sum of its coordinates.
constexpr float kRounding = 2e-6f;

/// On which sides of what an edge sweeps nodes stay, with room before and behind for what slots
/// name there.
class Sides {
 public:
  explicit Sides(int chunks) : of_(static_cast<std::size_t>(chunks + 2) * kMlsChunk, kAllSides) {}
  std::uint8_t* at(std::int32_t node) { return of_.data() + kMlsChunk + node; }
  const std::uint8_t* at(std::int32_t node) const { return of_.data() + kMlsChunk + node; }

 private:
  std::vector<std::uint8_t> of_;
};

struct Sweep {
  const MlsState& s;
  const float *u_begin, *u_end;

  /// Whether tissue stays where it is while it is cut, as where a service cuts.
  bool is_still() const { return u_begin == u_end; }
};

/// An edge that moves without turning: what it sweeps is a parallelogram, in which a place that
/// lies in its plane is at (along . x, across . x) of [0, 1]^2.
struct Parallelogram {
  bool is = false;
  Vec3 corner, normal, along, across;

  explicit Parallelogram(const SweptEdge& e) {
    constexpr double kTurned = 1e-12;  // rounding of poses
    const Vec3 edge = e.b0 - e.a0, moved = e.a1 - e.a0;
    if ((e.b1 - e.b0 - moved).norm() > kTurned * moved.norm()) return;
    normal = edge.cross(moved).stableNormalized();
    if (normal.isZero()) return;
    corner = e.a0;
    along = moved.cross(normal);
    along /= along.dot(edge);
    across = normal.cross(edge);
    across /= across.dot(moved);
    is = along.allFinite() && across.allFinite();
  }
};

/// Whether a link that stays where it is passes through: 1 it does, 0 it does not, -1 so near to
/// the rim that edge_passes() has to say; at `t` of the link.
int passes_through(const Parallelogram& p, const MovingSegment& link, double& t) {
  constexpr double kNear = 1e-6, kSteep = 1e-3;
  const Vec3 d = link.b0 - link.a0, x = link.a0 - p.corner;
  const double slope = d.dot(p.normal), height = x.dot(p.normal);
  if (!(slope * slope > kSteep * kSteep * d.squaredNorm())) return -1;
  t = -height / slope;
  const Vec3 at = x + t * d;
  const double place[3] = {t, p.along.dot(at), p.across.dot(at)};
  bool within = true;
  for (const double q : place) {
    if (q < -kNear || q > 1 + kNear) return 0;
    within = within && q > kNear && q < 1 - kNear;
  }
  return within ? 1 : -1;
}

MovingSegment link_of(const Sweep& w, std::int32_t i, std::int32_t j) {
  const auto at = [&](std::int32_t node, const float* u) {
    const float* x = &w.s.place[4 * static_cast<std::size_t>(node)];
    u += 4 * static_cast<std::size_t>(node);
    return Vec3(Vec3(x[0], x[1], x[2]) + Vec3(u[0], u[1], u[2]));
  };
  return {at(i, w.u_begin), at(j, w.u_begin), at(i, w.u_end), at(j, w.u_end)};
}

/// Sides of a chunk's nodes: those on which they stay for certain. Where one slab has all of them
/// on one side, the next ones are not looked at. Returns the sides that all of them have.
template <bool kStill>
std::uint8_t find_sides(const Sweep& w, const SweptEdge& edge, int chunk, std::uint8_t* sides) {
  constexpr int kEnd = kStill ? 0 : 1;
  float x[2][3][kMlsChunk], margin[kMlsChunk];
  const float* place = &w.s.place[4 * static_cast<std::size_t>(chunk) * kMlsChunk];
  for (int end = 0; end <= kEnd; ++end) {
    const float* u =
        (end == 0 ? w.u_begin : w.u_end) + 4 * static_cast<std::size_t>(chunk) * kMlsChunk;
    for (int a = 0; a < 3; ++a) {
      for (int l = 0; l < kMlsChunk; ++l) x[end][a][l] = place[4 * l + a] + u[4 * l + a];
    }
  }
  for (int l = 0; l < kMlsChunk; ++l) {
    float sum = 0;
    for (int a = 0; a < 3; ++a) {
      sum += std::fabs(x[0][a][l]) + std::fabs(x[kEnd][a][l]);
    }
    margin[l] = kRounding * sum;
  }
  std::int32_t bits[kMlsChunk] = {}, common = 0;
  const int count = std::min(kMlsChunk, w.s.count() - chunk * kMlsChunk);
  for (int k = 0; k < 3 && common == 0; ++k) {
    const Slab& slab = edge.slabs[k];
    const auto a = static_cast<float>(slab.axis[0]), b = static_cast<float>(slab.axis[1]),
               c = static_cast<float>(slab.axis[2]);
    const auto low = static_cast<float>(slab.low - kRounding * std::fabs(slab.low)),
               high = static_cast<float>(slab.high + kRounding * std::fabs(slab.high));
    for (int l = 0; l < kMlsChunk; ++l) {
      const float p = a * x[0][0][l] + b * x[0][1][l] + c * x[0][2][l];
      const float q = a * x[kEnd][0][l] + b * x[kEnd][1][l] + c * x[kEnd][2][l];
      const float most = p > q ? p : q, least = p > q ? q : p;
      bits[l] |=
          (most + margin[l] < low ? 1 << 2 * k : 0) | (least - margin[l] > high ? 2 << 2 * k : 0);
    }
    common = kAllSides;
    for (int l = 0; l < count; ++l) common &= bits[l];
  }
  for (int l = 0; l < kMlsChunk; ++l) sides[l] = static_cast<std::uint8_t>(bits[l]);
  return static_cast<std::uint8_t>(common);
}

/// A part of the path's edge and when it sweeps.
struct SweepOfEdge {
  double begin, end;
  const SweptEdge& edge;
  Parallelogram flat;
};

/// At `t` of the way from i to j.
bool passes(const Sweep& w, const SweepOfEdge& sweep, std::int32_t i, std::int32_t j, double& t) {
  const SweptEdge& edge = sweep.edge;
  MovingSegment link = link_of(w, i, j);
  if (w.is_still() && sweep.flat.is) {
    const int passes = passes_through(sweep.flat, link, t);
    if (passes >= 0) return passes != 0;
  }
  link = link.during(sweep.begin, sweep.end);
  MeetingOf<Vec3> meeting;
  if (stays_aside(edge, link) || !edge_passes(edge, link, &meeting)) return false;
  t = meeting.place;
  return true;
}

/// Whether any of eight nodes and the eight others have no side in common, whose sides are below
/// 0x80.
bool any_astride(const std::uint8_t* sides, const std::uint8_t* others) {
  constexpr std::uint64_t kOnes = 0x7f7f7f7f7f7f7f7full;
  std::uint64_t a, b;
  std::memcpy(&a, sides, sizeof(a));
  std::memcpy(&b, others, sizeof(b));
  return (((a & b) + kOnes) & ~kOnes) != ~kOnes;
}

struct Crossed {
  std::vector<std::int32_t> entries;
  std::vector<float> places;

  void add(std::int32_t entry, double place) {
    entries.push_back(entry);
    places.push_back(static_cast<float>(place));
  }
  void add(Crossed& other) {
    entries.insert(entries.end(), other.entries.begin(), other.entries.end());
    places.insert(places.end(), other.places.begin(), other.places.end());
    other.entries.clear();
    other.places.clear();
  }
};

/// Of pairs of the chunk's nodes with later ones.
void search_chunk(const Sweep& w, const SweepOfEdge& sweep, const Sides& sides, int chunk,
                  Crossed& found) {
  const MlsPairs& p = w.s.pairs;
  const MlsLanes& lanes = w.s.lanes;
  const std::int32_t first = chunk * kMlsChunk, last = std::min(w.s.count(), first + kMlsChunk);
  const MlsSlots& slots = lanes.of_chunk[chunk];
  double t = 0;
  for (std::int32_t slot = slots.first; slot < slots.end; ++slot) {
    const std::int32_t other = lanes.first[slot];
    if (other <= first) continue;
    for (int half = 0; half < kMlsChunk; half += 8) {
      if (!any_astride(sides.at(first + half), sides.at(other + half))) continue;
      for (int l = half; l < half + 8; ++l) {
        if ((*sides.at(first + l) & *sides.at(other + l)) != 0) continue;
        const std::int32_t i = first + l, j = other + l;
        if (i >= last || j >= w.s.count()) continue;
        if (!passes(w, sweep, i, j, t)) continue;
        const std::int32_t e = p.find(i, j);  // rows end within a slot: they may be no pair
        if (e >= 0 && p.crossed[e] == 0) found.add(e, t);
      }
    }
  }
  if (slots.first < slots.end) return;
  for (std::int32_t i = first; i < last; ++i) {
    const std::uint8_t own = *sides.at(i);
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      const std::int32_t j = p.other[e];
      if (j < i || (own & *sides.at(j)) != 0 || p.crossed[e] != 0) continue;
      if (passes(w, sweep, i, j, t)) found.add(e, t);
    }
  }
}

}  // namespace

std::vector<std::int32_t> find_crossed(const MlsState& s, const BladePath& path,
                                       const float* u_begin, const float* u_end,
                                       std::vector<float>* places) {
  const Sweep w{s, u_begin, u_end};
  const int chunks = s.chunks(), blocks = (chunks + kChunksAtATime - 1) / kChunksAtATime;
  Sides sides(chunks);
  std::vector<std::uint8_t> common(blocks);  // sides on which all of a block stay
  std::vector<Crossed> of_block(blocks);
  Crossed found;
  for (const SweepPart& part : sweep_parts(path)) {
    stop_if_asked();
    for (const SweptEdge& edge : part.edges) {
      const SweepOfEdge sweep{part.begin, part.end, edge, Parallelogram(edge)};
      s.cpu->for_each(blocks, [&](int block) {
        const int first = block * kChunksAtATime, last = std::min(chunks, first + kChunksAtATime);
        common[block] = kAllSides;
        for (int chunk = first; chunk < last; ++chunk) {
          std::uint8_t* of = sides.at(chunk * kMlsChunk);
          common[block] &= w.is_still() ? find_sides<true>(w, edge, chunk, of)
                                        : find_sides<false>(w, edge, chunk, of);
        }
      });
      std::uint8_t all = kAllSides;
      for (const std::uint8_t c : common) all &= c;
      if (all != 0) continue;
      s.cpu->for_each(blocks, [&](int block) {
        const int first = block * kChunksAtATime, last = std::min(chunks, first + kChunksAtATime);
        for (int chunk = first; chunk < last; ++chunk) {
          search_chunk(w, sweep, sides, chunk, of_block[block]);
        }
      });
      for (Crossed& some : of_block) found.add(some);
    }
  }
  if (places != nullptr) *places = std::move(found.places);
  return std::move(found.entries);
}

}  // namespace tissue_sim
