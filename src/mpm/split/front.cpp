// Which nodes are parted ahead of a cut, and how far.
#include "mpm/split/front.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "math/bspline.h"
#include "mpm/lattice/bonds.h"
#include "mpm/split/lattice_tissue.h"
#include "mpm/split/node_fields.h"

namespace tissue_sim {
namespace {

/// A node's box of 6 x 6 x 6 places and what lies in it.
struct BoxOfNode {
  std::int32_t point[216];
  static int bit(int i) { return bit_in_plane(i % 6, i / 6 % 6); }
  static bool has(const Planes& planes, int i) { return (planes[i / 36] >> bit(i) & 1) != 0; }
  static double weight(int i) {
    const auto along = [](int j) { return lattice_weight(j & 1, 2 - j / 2); };
    return static_cast<double>(along(i % 6)) * along(i / 6 % 6) * along(i / 36);
  }
  static Vec3 place(int i) { return Vec3(i % 6, i / 6 % 6, i / 36); }  // [half cells]
};

/// Calls f(i, j, axis) for the pairs of neighbours among some places.
template <class F>
void for_each_pair(const Planes& all, const F& f) {
  for (int z = 0; z < 6; ++z) {
    for (int i = 36 * z; i < 36 * z + 36; ++i) {
      if (!BoxOfNode::has(all, i)) continue;
      if (i % 6 < 5 && BoxOfNode::has(all, i + 1)) f(i, i + 1, 0);
      if (i % 36 < 30 && BoxOfNode::has(all, i + 6)) f(i, i + 6, 1);
      if (z < 5 && BoxOfNode::has(all, i + 36)) f(i, i + 36, 2);
    }
  }
}

/// How much of the area that a bond stands for was passed.
double passed_share(const LatticeTissue& s, std::int32_t p, int axis) {
  if (is_broken(s.points, p, axis) && s.points.crossings.find(p, axis) == nullptr) return 1;
  const auto found = s.front.rim.find(3 * static_cast<std::int64_t>(p) + axis);
  if (found != s.front.rim.end()) {
    return static_cast<double>(__builtin_popcount(found->second)) / kRimProbes;
  }
  return is_broken(s.points, p, axis) ? 1 : 0;
}

/// The plane of a cut in a box, and on which side of it places are: 1 and -1, 0 unknown.
struct CutPlane {
  bool there = false;
  int broken = 0;  ///< bonds between the places
  Vec3 normal = Vec3::Zero();
  std::array<std::int8_t, 216> side = {};
};

CutPlane find_plane(const LatticeTissue& s, const BoxOfNode& box, const Planes& all) {
  CutPlane plane;
  Vec3 middle = Vec3::Zero();
  int count = 0;  // of those that were cut
  bool torn = false;
  std::array<int, 216> votes = {};
  for_each_pair(all, [&](int i, int j, int axis) {
    const std::int32_t p = box.point[i];
    if (!is_broken(s.points, p, axis)) return;
    ++plane.broken;
    const Crossing* crossing = s.points.crossings.find(p, axis);
    if (crossing == nullptr) {
      torn = true;
      return;
    }
    Vec3 n(crossing->normal[0], crossing->normal[1], crossing->normal[2]);
    if (n.dot(plane.normal) < 0) n = -n;
    plane.normal += n;
    middle += BoxOfNode::place(i) + crossing->place * Vec3::Unit(axis);
    ++count;
    const int up = n[axis] > 0 ? 1 : -1;
    votes[i] -= up;
    votes[j] += up;
  });
  // Where cuts meet, or tissue tore, there is no one plane.
  if (torn || count == 0 || plane.normal.norm() < 0.9 * count) return plane;
  plane.normal.normalize();
  middle /= count;
  plane.there = true;
  for (int i = 0; i < 216; ++i) {
    if (!BoxOfNode::has(all, i)) continue;
    const double above = plane.normal.dot(BoxOfNode::place(i) - middle);
    plane.side[i] =
        static_cast<std::int8_t>(votes[i] != 0 ? (votes[i] > 0 ? 1 : -1) : (above > 0 ? 1 : -1));
  }
  return plane;
}

/// How far a node is parted where the cut ends `a` cells beyond it: as much as makes it as
/// compliant as one that ends there,
///   s / (1 + c (1 - s)) = a, 0 <= a <= 1,
/// with c as measured on edge cracks, which are then as deep as they were cut within 0.04 cells;
/// for the energy of volume see FrontPart::volume_share.
float parted_share(double beyond) {
  const double a = std::min(std::max(beyond, 0.0), 1.0);
  constexpr double c = 1.5;
  return static_cast<float>((1 + c) * a / (1 + c * a));
}

/// A side lighter than that share of its node (a plane through nodes leaves 0.016 on the far ones,
/// without which it counts up to a quarter of a cell short), or a component of fewer points: swings
/// by itself.
constexpr double kLeastSide = 0.01;
constexpr int kLeastPoints = 32;

/// The share that the bonds between a node's sides ask for. A cut ends along a line across the way
/// from the middle of what was cut to that of what is whole, wherever that leaves as much of it.
float share_of(const LatticeTissue& s, const BoxOfNode& box, const CutPlane& plane,
               const FrontNode& node) {
  struct Bond {
    Vec3 place;  // in the plane, from the node [half cells]
    double area;
  };
  std::vector<Bond> bonds;
  double all = 0, cut = 0;
  Vec3 of_cut = Vec3::Zero(), of_whole = Vec3::Zero();
  for_each_pair(node.all, [&](int i, int j, int axis) {
    if (BoxOfNode::has(node.first_side, i) == BoxOfNode::has(node.first_side, j)) return;
    const double area = std::fabs(plane.normal[axis]);
    const double passed = area * passed_share(s, box.point[i], axis);
    Vec3 place = (BoxOfNode::place(i) + BoxOfNode::place(j)) / 2 - Vec3::Constant(2.5);
    place -= plane.normal.dot(place) * plane.normal;
    bonds.push_back({place, area});
    all += area;
    cut += passed;
    of_cut += passed * place;
    of_whole += (area - passed) * place;
  });
  if (!(cut > 0)) return 0;
  const double whole = all - cut;
  if (!(whole > 1e-6 * all)) return 1;
  const Vec3 ahead = (of_whole / whole - of_cut / cut).normalized();
  double low = -5, high = 5;
  for (int k = 0; k < 30; ++k) {
    const double end = (low + high) / 2;
    double behind = 0;
    for (const Bond& b : bonds) {
      behind += b.area * std::min(std::max(end - ahead.dot(b.place) + 0.5, 0.0), 1.0);
    }
    (behind < cut ? low : high) = end;
  }
  return parted_share((low + high) / 4);
}

/// Parts a node as far as its bonds say; `before` if it was parted already. Returns a share of 0
/// where it is not.
FrontNode parted_node(const LatticeTissue& s, const FrontNode& at, const FrontNode* before) {
  FrontNode result = at;
  result.share = 0;
  const LatticeBody& body = s.bodies[at.body];
  BoxOfNode box;
  points_around(body, at.x, at.y, at.z, box.point);
  const CutPlane plane = find_plane(s, box, at.all);
  if (!plane.there) return before != nullptr ? *before : result;
  if (before != nullptr) {
    result = *before;
  } else {
    result.first_side = {};
    for (int i = 0; i < 216; ++i) {
      if (!BoxOfNode::has(at.all, i) || plane.side[i] >= 0) continue;
      result.first_side[i / 36] |= std::uint64_t{1} << BoxOfNode::bit(i);
    }
    if (!weigh_sides(s, result)) return result;
  }
  result.share = std::max(result.share, share_of(s, box, plane, result));
  return result;
}

}  // namespace

bool weigh_sides(const LatticeTissue& s, FrontNode& n) {
  const LatticeBody& body = s.bodies[n.body];
  BoxOfNode box;
  points_around(body, n.x, n.y, n.z, box.point);
  double mass[2] = {}, volume = 0, ratio = 0;
  int count = 0;
  for (int i = 0; i < 216; ++i) {
    if (!BoxOfNode::has(n.all, i)) continue;
    const std::int32_t p = box.point[i];
    const Material& material = body.material_of(s.points, p);
    const double weighed = BoxOfNode::weight(i) * s.points.free_volume_of(p);
    mass[BoxOfNode::has(n.first_side, i) ? 0 : 1] += material.density * weighed;
    volume += weighed;
    ratio += weighed * lame_lambda(material) / lame_mu(material);
    ++count;
  }
  const double sum = mass[0] + mass[1];
  if (!(sum > 0)) return false;
  n.first = static_cast<float>(mass[0] / sum);
  n.other = static_cast<float>(mass[1] / sum);
  n.mass = static_cast<float>(mass[0] * mass[1] / sum);
  n.lambda_over_mu = static_cast<float>(ratio / volume);
  return count >= kLeastPoints && std::min(mass[0], mass[1]) > kLeastSide * sum;
}

bool is_cut_between_sides(const LatticeTissue& s, const FrontNode& n) {
  BoxOfNode box;
  points_around(s.bodies[n.body], n.x, n.y, n.z, box.point);
  const CutPlane plane = find_plane(s, box, n.all);
  return plane.there ? share_of(s, box, plane, n) > 0 : plane.broken > 0;
}

void follow_front(LatticeTissue& s, const std::vector<std::int32_t>& touched,
                  const std::vector<std::uint8_t>& held) {
  Front& front = s.front;
  std::vector<FrontNode> candidates;
  for (std::size_t b = 0; b < s.bodies.size(); ++b) {
    const CellsAround around(s.bodies[b], 1, s.points, touched);
    const int body = static_cast<int>(b);
    around.for_each_row([&](int x, int y, int z, int node, const std::uint8_t* near, int count) {
      for (int n = 0; n < count; ++n) {
        if (near[n] == 0) continue;
        FrontNode at{};
        at.body = body;
        at.x = x + n;
        at.y = y;
        at.z = z;
        const auto add = [&](std::int32_t field, const Planes& points) {
          const bool is_held = field < static_cast<std::int32_t>(held.size()) && held[field] != 0;
          if (s.nodes.inv_mass[field] == 0 || is_held) return;  // or it flies
          at.node = field;
          at.all = points;
          candidates.push_back(at);
        };
        if (const NodeFields::Split* split = s.fields->split(node + n)) {
          for (const NodeFields::Split::Field& f : split->fields) add(f.node, f.points);
        } else {
          add(node + n, s.fields->bonds().points_in_box(body, x + n, y, z));
        }
      }
    });
  }
  std::map<std::int32_t, std::int32_t> known;
  for (std::size_t i = 0; i < front.nodes.size(); ++i) {
    known[front.nodes[i].node] = static_cast<std::int32_t>(i);
  }
  s.cpu->for_each(
      static_cast<int>(candidates.size()),
      [&](int i) {
        const auto found = known.find(candidates[i].node);
        candidates[i] = parted_node(s, candidates[i],
                                    found == known.end() ? nullptr : &front.nodes[found->second]);
      },
      32);
  std::map<std::int32_t, FrontNode> all;
  for (const FrontNode& n : front.nodes) all[n.node] = n;
  for (const FrontNode& n : candidates) {
    if (n.share > 0) all[n.node] = n;
  }
  Array<float> d[3], rate[3];
  for (int a = 0; a < 3; ++a) {
    d[a].assign(all.size(), 0.0f);
    rate[a].assign(all.size(), 0.0f);
  }
  std::vector<FrontNode> nodes;
  for (const auto& [node, n] : all) {
    const auto found = known.find(node);
    if (found != known.end()) {
      for (int a = 0; a < 3; ++a) {
        d[a][nodes.size()] = front.d[a][found->second];
        rate[a][nodes.size()] = front.rate[a][found->second];
      }
    }
    nodes.push_back(n);
  }
  front.nodes = std::move(nodes);
  for (int a = 0; a < 3; ++a) {
    std::swap(front.d[a], d[a]);
    std::swap(front.rate[a], rate[a]);
  }
}

}  // namespace tissue_sim
