// The cells of a region, taken apart into shares: points of one cell that see the same fields.
#pragma once

#include <cstdint>
#include <vector>

#include "mpm/blocks/blocks.h"
#include "mpm/lattice/bonds.h"

namespace tissue_sim {

// Sheets: the points of a region, taken apart so that every node means one field.

/// Points of one cell that see the same fields at all 27 nodes: those of a cell are one such share,
/// or several where a cut goes through it. Away from cuts, those of a run of whole cells are.
struct CellShare {
  std::int16_t x, y, z;   ///< cell in the region; of a run, the first
  std::int16_t cells;     ///< from there on along x: each one's points are two further on
  std::int16_t count;     ///< of a cell's points, whatever they are of
  std::int32_t point[8];  ///< by sub-position sx + 2 sy + 4 sz, -1 where it has none
};

/// One set of points for which each node of the region means one field.
struct Sheet {
  std::vector<CellShare> cells;
  std::vector<std::int32_t>
      node;  ///< of the region's nodes, -1 while no point needs it to be split
};

/// Takes the points of a region apart so that within a sheet no two see different fields of a node.
/// What the bonds hold together goes to one sheet where it fits, so that the sides of a cut are
/// sheets of their own and none has a gap where the other one is.
std::vector<Sheet> sheets_of(const BlockRegion& r, const LatticeBody& b, const Points& points,
                             const NodeFields& fields);

/// A split node of the region and the field that a point sees there.
struct Seen {
  int local;
  std::int32_t field;
  friend bool operator==(const Seen& a, const Seen& b) {
    return a.local == b.local && a.field == b.field;
  }
};
/// Those around a cell.
struct AllSeen {
  int count = 0;
  Seen of[27];
  const Seen* begin() const { return of; }
  const Seen* end() const { return of + count; }
};

/// A region with its shares.
class RegionShares {
 public:
  RegionShares(const BlockRegion& r, const LatticeBody& b, const Points& points,
               const NodeFields& fields);

  bool any_split() const { return any_split_; }
  std::size_t node_count() const { return split_.size(); }
  std::size_t count() const { return all_.size(); }
  const CellShare& operator[](std::int32_t share) const { return all_[share]; }

  /// A share, and the bond over which it was reached from another one.
  struct Reached {
    std::int32_t share;
    int bond;
  };
  static constexpr int kNoBond = -1;

  /// What the share's points see at the split nodes, or, where the bond led to it from another
  /// share, at those that the other one does not see: the rest means the same to both.
  AllSeen seen(const Reached& r) const;

  /// All shares that bonds within the region reach from `start`, in the order in which they do:
  /// sides of a cut one after the other. Marks them as `reached`.
  std::vector<Reached> connected(std::int32_t start, std::vector<std::uint8_t>& reached) const;

 private:
  /// A cell and how the bonds hold it together.
  struct Cell {
    static constexpr std::uint8_t kUneven = 0xff;
    std::int32_t first = 0, count = 0;  ///< its shares
    bool whole = true;                  ///< no bond between its points is missing, nor is a point
    /// Directions in which all its points hold on to others outside of the cell, if none do in the
    /// rest.
    std::uint8_t faces = 0;
  };
  /// A byte for each of its points: the bonds, or kNoPoint.
  using CellBonds = std::uint64_t;
  static constexpr std::uint8_t kNoPoint = 0xff;

  static Cell cell_of(CellBonds bonds);
  /// Takes a cell's points apart into shares.
  void add_cell(int x, int y, int z, const std::int32_t (&point)[8], CellBonds bonds, Cell& cell);
  /// Number of the region's node that is lowest around a cell.
  int node_at(int x, int y, int z) const { return (z * (r_.ny + 2) + y) * (r_.nx + 2) + x; }
  /// Whether the points at sub-positions s and t of a cell do.
  bool see_the_same(int x, int y, int z, int s, int t) const;
  /// What the point at sub-position s of a cell sees at the split nodes around it.
  AllSeen seen(int x, int y, int z, int s, int bond) const;
  /// That share of a cell which has the point at sub-position s.
  std::int32_t share_with(const Cell& cell, int s) const {
    std::int32_t share = cell.first;
    while (all_[share].point[s] < 0) ++share;
    return share;
  }

  const BlockRegion& r_;
  const Points& points_;
  const std::ptrdiff_t step_[kBondCount];  // in cells_, to the next one in the direction of a bond
  bool any_split_ = false;
  std::vector<const NodeFields::Split*> split_;  // per node of the region, null where it is whole
  std::vector<std::uint8_t> split_in_row_;       // this node or one of the next two is
  std::vector<std::uint8_t> near_split_;  // per node: a node is of the cell that it is lowest of
  std::vector<Cell> cells_;               // [nz][ny][nx]
  std::vector<CellShare> all_;
};

}  // namespace tissue_sim
