#include "mpm/tear/tear.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "math/draw.h"
#include "math/union_find.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {
namespace {

/// From this excess on a crack begins though another one may be about to relieve the place.
constexpr float kPatience = 1.1f;

/// Whether a bond goes from what is in an anchor to what its face holds: that would stay there.
bool held_fast(const LatticeTissue& tissue, std::int32_t p, std::int32_t q) {
  const std::uint8_t a = tissue.points.anchored[p], b = tissue.points.anchored[q];
  return (a == Points::kInAnchor && b == Points::kAtAnchor) ||
         (a == Points::kAtAnchor && b == Points::kInAnchor);
}

/// The bond that a crack takes first.
Bond begin(const LatticeTissue& tissue, const TearingPoint& t,
           const std::vector<TearingPoint>& tearing) {
  const Points::Site& s = tissue.points.site[t.point];
  const LatticeBody& body = tissue.bodies[s.body];
  int axis = 0;
  t.normal.cwiseAbs().maxCoeff(&axis);
  Bond best{t.point, -1, false};
  float most = -1;
  for (const int k : {kForwardBond + axis, opposite_bond(kForwardBond + axis)}) {
    if ((tissue.points.bonds[t.point] >> k & 1) == 0) continue;
    const std::int32_t q = neighbour(body, s, k);
    if (held_fast(tissue, t.point, q)) continue;
    const TearingPoint* far = entry(tearing, q);
    const float excess = far != nullptr ? far->excess : 0.0f;
    if (excess <= most) continue;
    most = excess;
    best.bond = k;
  }
  return best;
}

/// Whether what tore last had no time yet to relieve all of the point's body.
bool being_relieved(const BlockTissue& tissue, const TearRecords& records, std::int32_t point) {
  const int body = tissue.points.site[point].body;
  const LatticeBody& b = tissue.bodies[body];
  const double extent = std::max({b.nx, b.ny, b.nz}) * b.cell_size;
  return tissue.time - records.tore_at[body] <
         extent / wave_speed(b.material_of(tissue.points, point));
}

/// Whether a corner that two bonds hold comes off. No crack goes through it, for each would leave
/// it on a thread; where a tool tears tissue to shreds such corners were drawn out 5 to 13-fold,
/// and what they had of energy set the substep of all.
bool comes_off(const LatticeTissue& tissue, const TearingPoint& t) {
  constexpr float kDrawnOut = 3;  // stretch
  if (t.excess < 1 || __builtin_popcount(tissue.points.bonds[t.point]) != 2) return false;
  return t.stretch > kDrawnOut;
}

/// Regions of tissue past its limit: for each entry the lowest of those that bonds join it to.
std::vector<std::int32_t> regions(const LatticeTissue& tissue,
                                  const std::vector<TearingPoint>& tearing) {
  UnionFind linked(tearing.size());
  for (std::size_t i = 0; i < tearing.size(); ++i) {
    const Points::Site& s = tissue.points.site[tearing[i].point];
    const unsigned bonds = tissue.points.bonds[tearing[i].point];
    for (unsigned forward = bonds >> kForwardBond; forward != 0; forward &= forward - 1) {
      const int k = kForwardBond + __builtin_ctz(forward);
      const TearingPoint* other = entry(tearing, neighbour(tissue.bodies[s.body], s, k));
      if (other == nullptr) continue;
      linked.join(static_cast<std::int32_t>(i), static_cast<std::int32_t>(other - tearing.data()));
    }
  }
  std::vector<std::int32_t> lowest(tearing.size());
  for (std::size_t i = 0; i < lowest.size(); ++i) {
    lowest[i] = linked.root(static_cast<std::int32_t>(i));
  }
  return lowest;
}

/// Whether a crack is so near that a point is past its limit because of it: strain is largest not
/// ahead of a tip but aside, 1.7 times as far out as ahead.
bool in_reach_of_crack(const LatticeTissue& tissue, const TearingPoint& t) {
  const Points::Site& s = tissue.points.site[t.point];
  const LatticeBody& body = tissue.bodies[s.body];
  const int reach = std::max(
      2 * kReach,
      static_cast<int>(4 * body.material_of(tissue.points, t.point).tear_length / body.cell_size));
  bool found = false;
  for (int z = s.z - reach; z <= s.z + reach; ++z) {
    for (int y = s.y - reach; y <= s.y + reach; ++y) {
      body.for_each_point_in_row(s.x - reach, s.x + reach + 1, y, z, [&](int, int from, int count) {
        const std::uint8_t* const bonds = &tissue.points.bonds[from];
        found = found || !std::equal(bonds, bonds + count, &tissue.whole_bonds[from]);
      });
    }
    if (found) return true;
  }
  return false;
}

/// Where cracks begin, `at_crack` telling which entries have one within kReach.
std::vector<Bond> beginnings(const BlockTissue& tissue, const TearRecords& records,
                             const std::vector<TearingPoint>& tearing,
                             const std::vector<std::uint8_t>& at_crack) {
  const std::vector<std::int32_t> region = regions(tissue, tearing);
  std::vector<std::uint8_t> cracked(tearing.size(), 0);
  for (std::size_t i = 0; i < tearing.size(); ++i) cracked[region[i]] |= at_crack[i];
  std::vector<int> worst(tearing.size(), -1);  // of each region
  for (std::size_t i = 0; i < tearing.size(); ++i) {
    const TearingPoint& t = tearing[i];
    if (t.excess < 1 || cracked[region[i]] != 0) continue;
    if (t.excess < kPatience && being_relieved(tissue, records, t.point)) continue;
    int& w = worst[region[i]];
    if (w < 0 || t.excess > tearing[w].excess) w = static_cast<int>(i);
  }
  std::vector<int> first(tissue.bodies.size(), -1);  // of each body
  for (const int i : worst) {
    if (i < 0) continue;
    int& f = first[tissue.points.site[tearing[i].point].body];
    if (f >= 0 && tearing[i].excess <= tearing[f].excess) continue;
    if (!in_reach_of_crack(tissue, tearing[i])) f = i;
  }
  std::vector<Bond> bonds;
  for (const int i : first) {
    if (i < 0) continue;
    const Bond b = begin(tissue, tearing[i], tearing);
    if (b.bond >= 0) bonds.push_back(b);
  }
  return bonds;
}

}  // namespace

bool can_tear(const LatticeTissue& tissue) {
  return std::any_of(tissue.bodies.begin(), tissue.bodies.end(),
                     [](const LatticeBody& b) { return least_tear_limit(b) > 0; });
}

int tear_checks(const LatticeTissue& tissue, int substeps, float dt) {
  double interval = 1e9;
  for (const LatticeBody& b : tissue.bodies) {
    for (const Material& m : b.materials) {
      if (m.tear_stretch <= 0) continue;
      interval = std::min(interval, kTearSteps * 0.5 * b.cell_size / wave_speed(m));
    }
  }
  const double every = std::max(1.0, std::round(interval / dt));
  return static_cast<int>(std::ceil(substeps / every));
}

/// That of a material in such cells.
static float tear_share(const Material& m, double cell_size) {
  return m.tear_stretch > 0 && m.tear_length > 0 && m.tear_length < kTipBehind * cell_size
             ? kAtFronts
             : 1.0f;
}

float tear_share(const LatticeTissue& tissue, const TearRecords& records) {
  float share = records.expected.empty() ? 1.0f : kWhereExpected;
  for (const LatticeBody& b : tissue.bodies) {
    for (const Material& m : b.materials) share = std::min(share, tear_share(m, b.cell_size));
  }
  return share;
}

float least_tear_limit(const Material& m) {
  if (m.tear_stretch <= 0) return 0;
  return static_cast<float>(1 + (m.tear_stretch - 1) * (1 - m.tear_scatter));
}

float least_tear_limit(const LatticeBody& body) {
  float least = 0;
  for (const Material& m : body.materials) {
    const float limit = least_tear_limit(m);
    if (limit > 0 && (least == 0 || limit < least)) least = limit;
  }
  return least;
}

float tear_limit(const LatticeTissue& tissue, std::int32_t point) {
  const Points::Site& s = tissue.points.site[point];
  const Material& m = tissue.bodies[s.body].material_of(tissue.points, point);
  std::uint64_t x = tissue.scene.seed;
  for (const std::int16_t part : {s.body, s.x, s.y, s.z}) {
    x = split_mix(x + static_cast<std::uint16_t>(part));
  }
  const double drawn = static_cast<double>(x >> 11) * 0x1p-52 - 1;  // -1 to 1
  return static_cast<float>(1 + (m.tear_stretch - 1) * (1 + m.tear_scatter * drawn));
}

std::vector<StretchedPoint> find_stretched(BlockTissue& tissue, double share) {
  const int count = static_cast<int>(tissue.blocks.all.size());
  std::vector<std::vector<StretchedPoint>> of_block(count);
  tissue.cpu->for_each(count, [&](int i) {
    const Block& block = *tissue.blocks.all[i];
    const LatticeBody& body = tissue.bodies[block.body];
    const float limit = block.material == Block::kMixed
                            ? least_tear_limit(body)
                            : least_tear_limit(body.materials[block.material]);
    if (limit == 0) return;
    tissue.kernels->stretched(block, block_field(tissue, block),
                              static_cast<float>(1 + share * (limit - 1)), tissue.scratch.local(),
                              of_block[i]);
  });
  std::vector<StretchedPoint> stretched;
  for (const auto& part : of_block) stretched.insert(stretched.end(), part.begin(), part.end());
  std::sort(stretched.begin(), stretched.end(),
            [](const StretchedPoint& a, const StretchedPoint& b) { return a.point < b.point; });
  return stretched;
}

std::vector<TearingPoint> tearing_of(const LatticeTissue& tissue, const TearRecords& records,
                                     const std::vector<StretchedPoint>& stretched) {
  std::vector<TearingPoint> tearing;
  for (const StretchedPoint& p : stretched) {
    if (tissue.points.anchored[p.point] == Points::kInAnchor)
      continue;  // held fast, it cannot come apart
    const LatticeBody& body = tissue.bodies[tissue.points.site[p.point].body];
    const Material& material = body.material_of(tissue.points, p.point);
    const float limit = least_tear_limit(material);
    if (limit == 0) continue;
    const bool expected =
        std::binary_search(records.expected.begin(), records.expected.end(), p.point);
    const float begins = expected ? kWhereExpected : 1.0f;
    const float least = 1 + std::min(begins, tear_share(material, body.cell_size)) * (limit - 1);
    Eigen::Matrix3d C;
    C << p.C[0], p.C[3], p.C[4], p.C[3], p.C[1], p.C[5], p.C[4], p.C[5], p.C[2];
    if (!C.allFinite()) continue;  // the frame's end will find out
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
    solver.computeDirect(C);
    const double stretch = std::sqrt(solver.eigenvalues()[2]);
    if (stretch < least) continue;  // it was looked for by the limit of a weaker material
    const double excess = (stretch - 1) / (tear_limit(tissue, p.point) - 1) / begins;
    Vec3 normal = solver.eigenvectors().col(2);
    if (tissue.points.anchored[p.point] == Points::kAtAnchor) {
      const Points::Site& s = tissue.points.site[p.point];
      normal = face_normal(body.body.anchors, body.site_position(s.x, s.y, s.z));
    }
    tearing.push_back({p.point, static_cast<float>(excess), static_cast<float>(stretch), normal,
                       stretch >= limit});
  }
  const auto is_past = [](const TearingPoint& t) { return t.past; };
  if (std::none_of(tearing.begin(), tearing.end(), is_past)) tearing.clear();
  return tearing;
}

void tear_bonds(BlockTissue& tissue, TearRecords& records, const std::vector<TearingPoint>& tearing,
                std::vector<std::int32_t>& changed, CutReport& report) {
  records.tore_at.resize(tissue.bodies.size(), -1e9);
  const std::size_t first = changed.size();
  const auto tear = [&](const Bond& b) {
    const Points::Site& s = tissue.points.site[b.point];
    const LatticeBody& body = tissue.bodies[s.body];
    if ((tissue.points.bonds[b.point] >> b.bond & 1) == 0) return false;
    if (!b.bridge && broken_on_line(tissue, body, b.point, b.bond)) return false;
    const std::int32_t q = neighbour(body, s, b.bond);
    if (held_fast(tissue, b.point, q)) return false;
    for (const std::int32_t end : {b.point, q}) {  // at a corner it may be the last
      if (__builtin_popcount(tissue.points.bonds[end]) == 1) return false;
    }
    // What would hang by a thread stays on the side that it has more of: it would swing until that
    // tears, too.
    if (leaves_thread(body, tissue.points, b.point, b.bond)) return false;
    break_bond(b.bond, tissue.points.bonds[b.point], tissue.points.bonds[q]);
    changed.push_back(b.point);
    changed.push_back(q);
    ++report.bonds_broken;
    records.tore_at[s.body] = tissue.time;
    return true;
  };
  const int count = static_cast<int>(tearing.size());
  std::vector<std::vector<Bond>> bonds(count);
  std::vector<std::uint8_t> at_crack(count);
  for (int step = 0; step < kTearSteps; ++step) {
    tissue.cpu->for_each(
        count,
        [&](int i) {
          bonds[i].clear();
          at_crack[i] = go_on(tissue, tearing[i], tearing, bonds[i]);
        },
        64);
    bool any = false;
    for (const std::vector<Bond>& of_point : bonds) {
      for (const Bond& b : of_point) any = tear(b) || any;
    }
    if (step == 0) {
      for (const Bond& b : beginnings(tissue, records, tearing, at_crack)) any = tear(b) || any;
    }
    if (!any) break;
  }
  for (const TearingPoint& t : tearing) {
    if (!comes_off(tissue, t)) continue;
    const Points::Site& s = tissue.points.site[t.point];
    std::uint8_t& bonds = tissue.points.bonds[t.point];
    changed.push_back(t.point);
    for (unsigned left = bonds; left != 0; left &= left - 1) {
      const int k = __builtin_ctz(left);
      const std::int32_t q = neighbour(tissue.bodies[s.body], s, k);
      break_bond(k, bonds, tissue.points.bonds[q]);
      changed.push_back(q);
      ++report.bonds_broken;
    }
    records.tore_at[s.body] = tissue.time;
  }
  std::sort(changed.begin() + first, changed.end());
  changed.erase(std::unique(changed.begin() + first, changed.end()), changed.end());
  report.points_separated += static_cast<int>(changed.size() - first);
}

}  // namespace tissue_sim
