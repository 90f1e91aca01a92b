// Groups of points, read out of the labels of the cells that they are in.
#pragma once

#include <cstdint>
#include <vector>

#include "compute/for_each.h"
#include "math/union_find.h"

namespace tissue_sim {

/// Which group each point is in.
struct PointGroups {
  std::vector<std::int32_t> of_point;  ///< numbered from 0 on by their lowest point
  std::vector<std::int32_t> count;     ///< points of each group
};

/// Groups of points that links hold together: `linked` has joined both ends of each.
PointGroups groups_of_links(UnionFind& linked);

/// The groups that are fragments: of `least` points or more, but less than `most` (algorithm 1 of
/// Sung, Kim and Shin, Electronics 13:1340, 2024).
std::vector<std::int32_t> fragments_among(const PointGroups& groups, std::int32_t least,
                                          std::int32_t most);

/// Keeps its memory from one time to the next.
class GroupReader {
 public:
  /// Groups of points by the label of their cell, 0 .. labels - 1. The same whatever the number of
  /// threads.
  void read(const std::vector<std::int32_t>& cell_of_point,
            const std::vector<std::int32_t>& label_of_cell, std::int32_t labels, Cpu& cpu,
            PointGroups& groups);

 private:
  /// Some points, which one thread works on.
  struct Part {
    std::int32_t begin, end;
    std::vector<std::int32_t> number;  ///< of each label's group here, -1 where it was not met
    std::vector<std::int32_t> labels;  ///< of each group here
    std::vector<std::int32_t> count;   ///< of each group here
    std::vector<std::int32_t> group;   ///< of each group here: its number among all
  };
  static void read(const std::int32_t* cell, const std::int32_t* label, std::int32_t labels,
                   std::int32_t* group_of, Part& part);

  std::vector<Part> parts_;
};

}  // namespace tissue_sim
