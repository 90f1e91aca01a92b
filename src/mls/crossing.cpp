#include "mls/crossing.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "compute/simd.h"
#include "cutting/blade_sweep.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace {

/// Chunks that a thread looks at at a time.
constexpr int kChunksAtATime = 32;
/// Of sides: a bit for each of three slabs that a node stays below, then for each above.
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

/// The slabs of what an edge sweeps, side by side.
struct Slabs {
  Vec<4> axis[3];    // by coordinate
  Vec<4> low, high;  // the fourth has all on neither side

  explicit Slabs(const SweptEdge& edge) : low(), high() {
    for (int k = 0; k < 3; ++k) {
      const Slab& slab = edge.slabs[k];
      for (int a = 0; a < 3; ++a) axis[a][k] = static_cast<float>(slab.axis[a]);
      low[k] = static_cast<float>(slab.low - kRounding * std::fabs(slab.low));
      high[k] = static_cast<float>(slab.high + kRounding * std::fabs(slab.high));
    }
    for (int a = 0; a < 3; ++a) axis[a][3] = 0;
  }
  Vec<4> along(Vec<4> x) const { return axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2]; }
};

/// Sides of a chunk's nodes: those on which they stay for certain. Returns those that all have.
template <bool kStill>
std::uint8_t find_sides(const Sweep& w, const Slabs& slabs, int chunk, std::uint8_t* sides) {
  constexpr Mask<4> kBelow = {1, 2, 4, 0}, kAbove = {8, 16, 32, 0};
  const std::int32_t first = chunk * kMlsChunk, last = std::min(w.s.count(), first + kMlsChunk);
  std::int32_t common = kAllSides;
  for (std::int32_t i = first; i < last; ++i) {
    const Vec<4> place = load<4>(&w.s.place[4 * i]), x = place + load<4>(w.u_begin + 4 * i);
    const Vec<4> y = kStill ? x : place + load<4>(w.u_end + 4 * i);
    const Vec<4> p = slabs.along(x), q = kStill ? p : slabs.along(y);
    const float margin =
        kRounding * ((std::fabs(x[0]) + std::fabs(y[0])) + (std::fabs(x[1]) + std::fabs(y[1])) +
                     (std::fabs(x[2]) + std::fabs(y[2])));
    const Mask<4> below = (p + margin < slabs.low) & (q + margin < slabs.low),
                  above = (p - margin > slabs.high) & (q - margin > slabs.high);
    const Mask<4> on = (below & kBelow) | (above & kAbove);
    const std::int32_t of = on[0] | on[1] | on[2];
    sides[i - first] = static_cast<std::uint8_t>(of);
    common &= of;
  }
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

/// Of a chunk's nodes, a byte each: not 0 where one of their later neighbours by slots shares no
/// side with them. Rows of neighbours end within a slot: some of these may be no pairs.
void find_astride(const MlsLanes& lanes, const Sides& sides, int chunk,
                  std::uint8_t (&astride)[kMlsChunk]) {
  typedef std::uint8_t Bytes __attribute__((vector_size(kMlsChunk)));
  const std::int32_t first = chunk * kMlsChunk;
  Bytes own, all{};
  std::memcpy(&own, sides.at(first), sizeof(own));
  const MlsSlots& slots = lanes.of_chunk[chunk];
  for (std::int32_t slot = slots.first; slot < slots.end; ++slot) {
    const std::int32_t other = lanes.first[slot];
    if (other <= first) continue;
    Bytes others;
    std::memcpy(&others, sides.at(other), sizeof(others));
    all |= reinterpret_cast<Bytes>((own & others) == 0);
  }
  std::memcpy(astride, &all, sizeof(all));
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

/// Adds nodes of the chunk that may have a later neighbour on another side.
void list_astride(const MlsState& s, const Sides& sides, int chunk,
                  std::vector<std::int32_t>& nodes) {
  const std::int32_t first = chunk * kMlsChunk, last = std::min(s.count(), first + kMlsChunk);
  const MlsSlots& slots = s.lanes.of_chunk[chunk];
  std::uint8_t astride[kMlsChunk];
  if (slots.first < slots.end) {
    find_astride(s.lanes, sides, chunk, astride);
    std::uint64_t halves[2];
    std::memcpy(halves, astride, sizeof(halves));
    if ((halves[0] | halves[1]) == 0) return;
  } else {
    std::fill_n(astride, kMlsChunk, std::uint8_t{1});
  }
  for (std::int32_t i = first; i < last; ++i) {
    if (astride[i - first] != 0) nodes.push_back(i);
  }
}

/// Of pairs of these nodes with later ones.
void search_nodes(const Sweep& w, const SweepOfEdge& sweep, const Sides& sides,
                  const std::vector<std::int32_t>& nodes, Crossed& found) {
  const MlsPairs& p = w.s.pairs;
  constexpr std::size_t kAhead = 8;  // whose pairs are asked for from memory
  std::vector<std::int32_t> may_pass;
  double t = 0;
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    if (k + kAhead < nodes.size()) {
      const std::int32_t next = p.begin[nodes[k + kAhead]];
      __builtin_prefetch(&p.other[next]);
      __builtin_prefetch(&p.other[next] + 16);
      __builtin_prefetch(&p.crossed[next]);
    }
    const std::int32_t i = nodes[k];
    const std::uint8_t own = *sides.at(i);
    may_pass.resize(p.begin[i + 1] - p.begin[i] + 1);
    int listed = 0;  // without a branch, for nothing foretells which are
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1]; ++e) {
      const std::int32_t j = p.other[e];
      may_pass[listed] = e;
      listed += static_cast<int>(j > i) & ((own & *sides.at(j)) == 0 ? 1 : 0) &
                (p.crossed[e] == 0 ? 1 : 0);
    }
    for (int c = 0; c < listed; ++c) {
      if (passes(w, sweep, i, p.other[may_pass[c]], t)) found.add(may_pass[c], t);
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
      const Slabs slabs(edge);
      s.cpu->for_each(blocks, [&](int block) {
        const int first = block * kChunksAtATime, last = std::min(chunks, first + kChunksAtATime);
        common[block] = kAllSides;
        for (int chunk = first; chunk < last; ++chunk) {
          std::uint8_t* of = sides.at(chunk * kMlsChunk);
          common[block] &= w.is_still() ? find_sides<true>(w, slabs, chunk, of)
                                        : find_sides<false>(w, slabs, chunk, of);
        }
      });
      std::uint8_t all = kAllSides;
      for (const std::uint8_t c : common) all &= c;
      if (all != 0) continue;
      s.cpu->for_each(blocks, [&](int block) {
        const int first = block * kChunksAtATime, last = std::min(chunks, first + kChunksAtATime);
        std::vector<std::int32_t> nodes;
        for (int chunk = first; chunk < last; ++chunk) list_astride(s, sides, chunk, nodes);
        search_nodes(w, sweep, sides, nodes, of_block[block]);
      });
      for (Crossed& some : of_block) found.add(some);
    }
  }
  if (places != nullptr) *places = std::move(found.places);
  return std::move(found.entries);
}

}  // namespace tissue_sim
