// Fragments by breadth-first search over the cells of a grid: the reference that the hash grid
// (paper/hash_grid.h) is checked against and measured beside. All but label() is the same.
#pragma once

#include <cstdint>
#include <vector>

#include "paper/cell_box.h"
#include "paper/point_groups.h"

namespace tissue_sim {

/// Keeps its memory from one search to the next.
class BreadthFirstSearch {
 public:
  /// Groups of points whose cells hang together over faces (four neighbours in a plane, six in
  /// space): mark(), label() and read_out(). Throws std::invalid_argument for a point outside of
  /// the box and for a box of more than 2^28 cells.
  const PointGroups& find_groups(const PointPlaces& places, const CellBox& box, Cpu& cpu);

  /// Finds the cell of each point.
  void mark(const PointPlaces& places, const CellBox& box, Cpu& cpu);
  /// Labels the cells by group, on one thread. Each cell is put into the queue once.
  void label();
  const PointGroups& read_out(Cpu& cpu);

 private:
  std::vector<std::int32_t> cell_;   ///< of each point
  std::vector<std::uint8_t> waits_;  ///< of each cell: holds points, and was in no queue yet
  std::vector<std::int32_t> label_;  ///< of each cell that holds points
  std::vector<std::int32_t> queue_;
  CellOrder order_{};
  int neighbours_ = 0;
  std::int32_t labels_ = 0;
  GroupReader reader_;
  PointGroups groups_;
};

}  // namespace tissue_sim
