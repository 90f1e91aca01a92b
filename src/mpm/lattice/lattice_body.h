// The bodies of a scene on their lattices: which point sits where, and which node is whose.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "compute/array.h"
#include "compute/host_device.h"
#include "geometry/lattice.h"
#include "mpm/lattice/bonds.h"
#include "tissue_sim/scene.h"

namespace tissue_sim {

/// Places in rows along x, each of which has some stretches. Numbered from 0 on, x fastest, then y,
/// then z: those of a stretch follow one another.
class LatticeRows {
 public:
  struct Stretch {
    int begin, end;  ///< x of its places
    int first;       ///< number of the one at `begin`
  };

  /// Without places; y from `lowest` to `lowest` + ny - 1 and z from `lowest` on.
  explicit LatticeRows(int lowest = 0, int ny = 0) : lowest_(lowest), ny_(ny) {}
  /// Goes on to the next row, y fastest. The first one, too, has to be started.
  void start_row() { first_.push_back(first_.back()); }
  /// Adds places begin .. end - 1 to the row, behind those that it has.
  void add(int begin, int end) {
    const bool joins = first_.back() > first_[first_.size() - 2] && stretches_.back().end == begin;
    if (joins) {
      stretches_.back().end = end;
    } else {
      stretches_.push_back({begin, end, count_});
      ++first_.back();
    }
    count_ += end - begin;
  }

  int count() const { return count_; }
  /// Number of a place, -1 where there is none.
  int number(int x, int y, int z) const {
    int result = -1;
    for_each_in_row(x, x + 1, y, z, [&](int, int number, int) { result = number; });
    return result;
  }
  /// Calls f(x, number, count) for the places x_begin .. x_end - 1 of a row that are there: `count`
  /// of them from x on, with numbers from `number` on.
  template <class F>
  void for_each_in_row(int x_begin, int x_end, int y, int z, const F& f) const {
    y -= lowest_;
    z -= lowest_;
    if (y < 0 || z < 0 || y >= ny_) return;
    const std::size_t row = static_cast<std::size_t>(z) * ny_ + y;
    if (row + 1 >= first_.size()) return;
    for (int i = first_[row]; i < first_[row + 1]; ++i) {
      const Stretch& s = stretches_[i];
      const int begin = std::max(x_begin, s.begin), end = std::min(x_end, s.end);
      if (begin < end) f(begin, s.first + begin - s.begin, end - begin);
    }
  }

 private:
  int lowest_, ny_, count_ = 0;
  std::vector<int> first_ = {0};  ///< stretches of each row, and their end
  std::vector<Stretch> stretches_;
};

/// Crossings of the bonds that point forward, by point and axis (0 x, 1 y, 2 z).
class Crossings {
 public:
  /// Makes room for those of so many points, which add() needs.
  void reserve(std::size_t point_count) { index_.resize(point_count, -1); }
  void add(std::int32_t point, int axis, const Crossing& crossing) {
    if (index_[point] < 0) {
      index_[point] = static_cast<std::int32_t>(of_point_.size());
      of_point_.push_back({kNone, kNone, kNone});
    }
    of_point_[index_[point]][axis] = crossing;
  }
  /// Null where there is none.
  const Crossing* find(std::int32_t point, int axis) const {
    if (static_cast<std::size_t>(point) >= index_.size() || index_[point] < 0) return nullptr;
    const Crossing& crossing = of_point_[index_[point]][axis];
    return crossing.place < 0 ? nullptr : &crossing;
  }

 private:
  template <class Archive>
  friend void fields(Archive& archive, Crossings& x);  // mpm/mpm_fields.h

  static constexpr Crossing kNone = {-1, {}};
  std::vector<std::int32_t> index_;  // per point, -1 where none was broken
  std::vector<std::array<Crossing, 3>> of_point_;
};

/// A place on the true surface of a whole body: see mpm/surface/surface_places.h.
struct OuterPlace {
  std::int32_t point;
  std::uint8_t bond;  ///< that it has not
  float place[3];     ///< in cells, from the middle of the point's cell
  float normal[3];    ///< unit, outward, in reference space
};

/// What a cut changes of points.
struct PointBonds {
  Array<std::uint8_t>
      bonds;  ///< bit k: still bound to the neighbour of bond k (mpm/lattice/bonds.h)
  Array<std::uint8_t>
      soft;             ///< of a bit of debris or a slice: mpm/tear/debris.h; empty before any is
  Crossings crossings;  ///< of the bonds that blades broke; one that tore has none
  TISSUE_SIM_FIELDS(bonds, soft, crossings)
};

/// Points of all bodies, numbered body after body in the order of Lattice::sites.
struct Points : PointBonds {
  struct Site {
    std::int16_t x, y, z;  ///< half cells of the body's lattice
    std::int16_t body;
  };
  Array<Site> site;
  Array<float> volume;  ///< [m^3]
  /// Outside its body's anchors, where it moves, some of it given to neighbours
  /// (mpm/anchors/); empty where there are no anchors [m^3].
  Array<float> free_volume;
  /// Of that the share of the most that a neighbour has, where it is less: so much lighter than its
  /// neighbours; as `free_volume`.
  Array<float> lightness;
  Array<std::uint8_t> anchored;                 ///< kInAnchor, kAtAnchor or 0
  static constexpr std::uint8_t kInAnchor = 1;  ///< its place is in an anchor
  static constexpr std::uint8_t kAtAnchor = 2;  ///< the face of one holds it
  Array<std::uint8_t> material;   ///< in LatticeBody::materials; empty where no body has inclusions
  std::vector<OuterPlace> outer;  ///< true surface of the whole bodies; empty on a GPU
  /// Bonds that never were, across gaps of a mesh, as of make_lattice_bodies(), which leaves it to
  /// part_at_gaps() to break them; and a bit of each for both their points, empty where there are
  /// none.
  std::vector<BrokenBond> gaps;
  Array<std::uint8_t> beside_gap;
  int size() const { return static_cast<int>(site.size()); }
  /// Number of a point's material among those of its body.
  int material_of(std::int32_t point) const { return material.empty() ? 0 : material[point]; }
  /// Volume that moves [m^3].
  float free_volume_of(std::int32_t point) const {
    return free_volume.empty() ? volume[point] : free_volume[point];
  }
  bool is_soft(std::int32_t point) const { return !soft.empty() && soft[point] != 0; }
};

/// Calls f(point, site) for each of some points. Their sites lie scattered and come from far: those
/// of later ones are on their way while f works on one.
template <class F>
void for_each_site(const Points& points, const std::vector<std::int32_t>& some, const F& f) {
  constexpr std::size_t kAhead = 16;
  for (std::size_t i = 0; i < some.size(); ++i) {
    if (i + kAhead < some.size()) __builtin_prefetch(&points.site[some[i + kAhead]]);
    f(some[i], points.site[some[i]]);
  }
}

struct LatticeBody {
  Body body;
  std::vector<Material> materials;  ///< that its points are of: its own and its inclusions'
  Vec3 origin = Vec3::Zero();       ///< lowest corner of cell (0, 0, 0) [m]
  double cell_size = 0;
  int nx = 0, ny = 0, nz = 0;  ///< cells
  int first_node = 0;          ///< of its lattice nodes in Nodes
  int first_point = 0, point_count = 0;
  LatticeRows nodes;   ///< by the cells whose middle they are, -1 .. n each
  LatticeRows points;  ///< by their sites

  const Material& material_of(const Points& points, std::int32_t point) const {
    return materials[points.material_of(point)];
  }
  /// Point at a site, -1 where there is none or outside.
  int point(int x, int y, int z) const {
    const int number = points.number(x, y, z);
    return number < 0 ? -1 : first_point + number;
  }
  /// Calls f(x, point, count) for the points at x_begin .. x_end - 1 of a row of sites: `count` of
  /// them from x on, numbered from `point` on.
  template <class F>
  void for_each_point_in_row(int x_begin, int x_end, int y, int z, const F& f) const {
    points.for_each_in_row(x_begin, x_end, y, z, [&](int x, int number, int count) {
      f(x, first_point + number, count);
    });
  }
  /// The point after a site along an axis (0 x, 1 y, 2 z), -1 where there is none.
  std::int32_t next_point(const Points::Site& s, int axis) const {
    return point(s.x + (axis == 0), s.y + (axis == 1), s.z + (axis == 2));
  }
  /// Lattice node of cell (x, y, z), -1 .. n each; -1 where there is none, for no point sees it.
  int node(int x, int y, int z) const {
    const int number = nodes.number(x, y, z);
    return number < 0 ? -1 : first_node + number;
  }
  /// Calls f(x, node, count) for the nodes of the cells x_begin .. x_end - 1 of a row: `count` of
  /// them from x on, numbered from `node` on.
  template <class F>
  void for_each_node_in_row(int x_begin, int x_end, int y, int z, const F& f) const {
    nodes.for_each_in_row(x_begin, x_end, y, z,
                          [&](int x, int number, int count) { f(x, first_node + number, count); });
  }
  /// Calls f(node, x, y, z) for all lattice nodes, in order.
  template <class F>
  void for_each_node(const F& f) const {
    for (int z = -1; z <= nz; ++z) {
      for (int y = -1; y <= ny; ++y) {
        for_each_node_in_row(-1, nx + 1, y, z, [&](int x, int node, int count) {
          for (int i = 0; i < count; ++i) f(node + i, x + i, y, z);
        });
      }
    }
  }
  Vec3 node_position(int x, int y, int z) const {
    return origin + cell_size * Vec3(x + 0.5, y + 0.5, z + 0.5);
  }
  Vec3 site_position(int x, int y, int z) const {
    return origin + 0.5 * cell_size * Vec3(x + 0.5, y + 0.5, z + 0.5);
  }
};

/// Nodes of all bodies' lattices; higher numbers are fields that cuts made.
inline int lattice_node_count(const std::vector<LatticeBody>& bodies) {
  return bodies.back().first_node + bodies.back().nodes.count();
}

/// The volume by which a point resists strain [m^3]: its own, or less where it is soft.
inline float elastic_volume(const Points& points, std::int32_t point) {
  return (points.is_soft(point) ? kSoftness : 1.0f) * points.free_volume_of(point);
}

/// Which nodes a lattice has: those that points see, or all around the cells of its box.
enum class NodeRange { kSeen, kBox };

/// Puts the bodies of a scene on their lattices and fills `points`, all bonds whole. Throws
/// std::invalid_argument (a mesh that cannot be used, an anchor that holds nothing, ...).
std::vector<LatticeBody> make_lattice_bodies(const Scene& scene, Points& points,
                                             std::vector<std::string>* notes,
                                             NodeRange range = NodeRange::kSeen);

/// Points around lattice node (x, y, z) of `body` in the order of a 6 x 6 x 6 box, -1 where none:
/// those whose stencils hold the node.
void points_around(const LatticeBody& body, int x, int y, int z, std::int32_t (&around)[216]);

/// Weight of node `k` (0..26: x fastest) of the point's stencil.
float site_weight(const Points::Site& site, int k);

/// The bonds to all lattice neighbours that a point has.
std::uint8_t whole_bonds(const LatticeBody& body, const Points::Site& site);
/// The bonds of a point while the tissue is whole: none across a gap.
std::uint8_t whole_bonds(const LatticeBody& body, const Points& points, std::int32_t point);

}  // namespace tissue_sim
