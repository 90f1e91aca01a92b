#include "paper/breadth_first.h"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

namespace tissue_sim {

void BreadthFirstSearch::mark(const PointPlaces& places, const CellBox& box, Cpu& cpu) {
  // A ring of empty cells around the box: no neighbour has to be asked whether it is inside.
  const bool space = places.x[2] != nullptr;
  const std::int64_t row = box.n[0] + 2, plane = row * (box.n[1] + 2),
                     size = space ? plane * (box.n[2] + 2) : plane;
  if (size > 1 << 28) {
    throw std::invalid_argument("the grid has " + std::to_string(size) +
                                " cells: too many for a breadth-first search, use the hash grid");
  }
  order_ = {static_cast<std::int32_t>(1 + row + (space ? plane : 0)),
            static_cast<std::int32_t>(row), static_cast<std::int32_t>(plane)};
  neighbours_ = space ? 6 : 4;
  waits_.assign((size + 7) / 8 * 8, 0);
  label_.resize(size);
  queue_.resize(std::min<std::int64_t>(size, places.count));
  cell_.resize(places.count);
  mark_cells(places, box, order_, cpu, cell_, waits_);
}

void BreadthFirstSearch::label() {
  const std::int32_t to_neighbour[6] = {-1,          1, -order_.row, order_.row, -order_.plane,
                                        order_.plane};
  const int neighbours = neighbours_;
  std::uint8_t* const waits = waits_.data();
  std::int32_t *const label = label_.data(), *const queue = queue_.data();
  const auto search = [=, &to_neighbour](std::int32_t from, std::int32_t group) {
    std::int32_t head = 0, tail = 0;
    queue[tail++] = from;
    waits[from] = 0;
    while (head < tail) {
      const std::int32_t cell = queue[head++];
      label[cell] = group;
      for (int k = 0; k < neighbours; ++k) {
        const std::int32_t next = cell + to_neighbour[k];
        if (waits[next] == 0) continue;
        waits[next] = 0;
        queue[tail++] = next;
      }
    }
  };
  labels_ = 0;
  const auto size = static_cast<std::int32_t>(waits_.size());
  for (std::int32_t first = 0; first < size; first += 8) {
    std::uint64_t eight;
    std::memcpy(&eight, waits + first, sizeof eight);
    if (eight == 0) continue;
    for (std::int32_t cell = first; cell < first + 8; ++cell) {
      if (waits[cell] != 0) search(cell, labels_++);
    }
  }
}

const PointGroups& BreadthFirstSearch::read_out(Cpu& cpu) {
  reader_.read(cell_, label_, labels_, cpu, groups_);
  return groups_;
}

const PointGroups& BreadthFirstSearch::find_groups(const PointPlaces& places, const CellBox& box,
                                                   Cpu& cpu) {
  mark(places, box, cpu);
  label();
  return read_out(cpu);
}

}  // namespace tissue_sim
