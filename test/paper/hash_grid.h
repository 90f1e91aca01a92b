// Fragments by hash grid and minimum labels: algorithm 1 of Sung, Kim and Shin (Material Point
// Method-Based Simulation Techniques for Medical Applications, Electronics 13:1340, 2024).
//
// Each point puts its cell into a hash table; each cell takes the least label of those beside it,
// and with it all cells of both groups do, until a group has one label. Here a row of cells that
// hang together is one entry, 64 cells of a row are one word of the table, and the least label of
// two groups that meet is found by union-find: no queue, and whole words at a time.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "math/union_find.h"
#include "paper/cell_box.h"
#include "paper/point_groups.h"

namespace tissue_sim {

/// Keeps its memory from one search to the next.
class HashGrid {
 public:
  /// Groups of points whose cells hang together over faces (four neighbours in a plane, six in
  /// space): the same as BreadthFirstSearch finds, whatever the number of threads. Throws
  /// std::invalid_argument for a point outside of the box.
  const PointGroups& find_groups(const PointPlaces& places, const CellBox& box, Cpu& cpu);

  /// Its three steps. The first puts points into the table.
  void mark(const PointPlaces& places, const CellBox& box, Cpu& cpu);
  void label(Cpu& cpu);  ///< of cells by group
  const PointGroups& read_out(Cpu& cpu);

 private:
  /// Some words, which one thread works on.
  struct WordShare {
    std::size_t begin, end;
    std::int32_t first_run, runs;  ///< runs of cells that hold points, in these words
  };
  void mark_all(const PointPlaces& places, const CellBox& box, Cpu& cpu);
  void join_all(Cpu& cpu);
  void mark_scattered(const PointPlaces& places, const CellBox& box);
  void join_scattered();
  /// Of a key in the table, or where it would be.
  std::size_t place_of(std::int64_t key) const;
  void label_roots(Cpu& cpu);
  void join_along(std::size_t before, std::size_t word);

  CellBox box_;
  bool dense_ = true;               ///< whether each cell of the box has memory of its own
  std::vector<std::int32_t> cell_;  ///< of each point
  std::vector<std::uint8_t> held_;  ///< of each cell: 1 where it holds points
  bool held_is_clear_ = true;
  std::vector<std::uint64_t> words_;  ///< 64 cells of a row each: bits of those that hold points
  std::vector<std::int32_t> label_;   ///< of each cell that holds points: its run's root
  std::vector<std::int32_t> first_;   ///< of each word: number of its first run of such cells
  UnionFind runs_{0};
  std::vector<std::int32_t> root_;  ///< of each run
  std::vector<WordShare> shares_;
  GroupReader reader_;
  PointGroups groups_;
  // Where the box has far more cells than there are points: the words that hold any, by their hash.
  std::vector<std::int64_t> key_;   ///< of each place of the table, -1 for none
  std::vector<std::int32_t> word_;  ///< of each place
  std::vector<std::int64_t> key_of_word_;
};

}  // namespace tissue_sim
