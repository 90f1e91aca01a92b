// All constraints of one kind: as a list, which cuts change, and packed for the kernels.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "compute/array.h"
#include "pbd/colouring.h"

namespace tissue_sim {
namespace pbd {

constexpr int kLanes = 16;  ///< constraints of a block: those of the widest vector

/// Sixteen constraints of one colour, side by side. Lanes without one mean padding: vertices behind
/// all others (state.h) that nothing moves.
template <class Kind>
struct alignas(64) ConstraintBlock {
  std::int32_t vertex[Kind::kVertices][kLanes];
  float number[Kind::kNumbers][kLanes];
};

template <class Kind>
struct ConstraintSet {
  using Vertices = std::array<std::int32_t, Kind::kVertices>;
  using Numbers = std::array<float, Kind::kNumbers>;
  using Block = ConstraintBlock<Kind>;
  static constexpr int kMultipliers = Kind::kMultipliers > 0 ? Kind::kMultipliers : 1;

  std::vector<Vertices> vertices;
  std::vector<Numbers> numbers;
  std::vector<std::int16_t> colour;

  /// By level, then by chunk, then by colour. What lies within one chunk of a level, and in none of
  /// the levels before, is that chunk's: chunks of a level share no vertex, and a thread that
  /// projects all colours of one finds its vertices in the cache. The last level is all vertices.
  std::vector<Block, CacheLineAllocator<Block>> blocks;
  std::vector<std::int32_t> begin;  ///< first block of each of these, and the number of blocks
  int colours = 0;
  std::vector<std::int32_t> chunks;  ///< of each level
  Array<float> multipliers;          ///< kMultipliers x kLanes for each block

  int size() const { return static_cast<int>(vertices.size()); }
  void add(const Vertices& v, const Numbers& n) {
    vertices.push_back(v);
    numbers.push_back(n);
    colour.push_back(-1);
  }
  /// Leaves out those for which it is true.
  template <class F>
  int remove_if(const F& gone) {
    int kept = 0;
    for (int c = 0; c < size(); ++c) {
      if (gone(c)) continue;
      vertices[kept] = vertices[c];
      numbers[kept] = numbers[c];
      colour[kept++] = colour[c];
    }
    const int removed = size() - kept;
    vertices.resize(kept);
    numbers.resize(kept);
    colour.resize(kept);
    return removed;
  }
  /// `levels`: vertices of a chunk, ascending; without any there is one chunk, and so one list of
  /// colours.
  /// `most_rounds` as find_colours() has it.
  void pack(int vertex_count, const std::vector<std::int32_t>& levels = {}, int most_rounds = 30);
};

template <class Kind>
void ConstraintSet<Kind>::pack(int vertex_count, const std::vector<std::int32_t>& levels,
                               int most_rounds) {
  constexpr int kVertices = Kind::kVertices;
  const std::int32_t* all = vertices.empty() ? nullptr : vertices.front().data();
  colours = find_colours({all, vertices.size() * kVertices}, kVertices, vertex_count, colour,
                         most_rounds);
  chunks.clear();
  int count = 0;
  for (const std::int32_t vertices_of_chunk : levels) {
    chunks.push_back((vertex_count + vertices_of_chunk - 1) / vertices_of_chunk);
    count += chunks.back();
  }
  chunks.push_back(1);
  // Of each constraint: its list, by chunk and colour.
  std::vector<std::int32_t> list(vertices.size());
  std::vector<std::int32_t> end(static_cast<std::size_t>(count + 1) * colours + 1, 0);
  std::vector<std::int32_t> end_of_first(static_cast<std::size_t>(vertex_count) + 1, 0);
  for (int c = 0; c < size(); ++c) {
    const auto [low, high] = std::minmax_element(vertices[c].begin(), vertices[c].end());
    int chunk = 0;
    std::size_t level = 0;
    for (; level < levels.size() && *low / levels[level] != *high / levels[level]; ++level) {
      chunk += chunks[level];
    }
    if (level < levels.size()) chunk += *low / levels[level];
    list[c] = chunk * colours + colour[c];
    ++end[list[c] + 1];
    ++end_of_first[vertices[c][0] + 1];
  }
  // Side by side in memory what lies side by side in space, for vertices are numbered so: by the
  // first vertex, which no two of a list share.
  for (int v = 0; v < vertex_count; ++v) end_of_first[v + 1] += end_of_first[v];
  std::vector<std::int32_t> by_first(vertices.size()), sorted(vertices.size());
  for (int c = 0; c < size(); ++c) by_first[end_of_first[vertices[c][0]]++] = c;
  for (std::size_t l = 1; l < end.size(); ++l) end[l] += end[l - 1];
  for (const std::int32_t c : by_first) sorted[end[list[c]]++] = c;
  begin.assign(1, 0);
  std::int32_t first = 0;
  for (std::size_t l = 0; l + 1 < end.size(); first = end[l++]) {
    begin.push_back(begin.back() + (end[l] - first + kLanes - 1) / kLanes);
  }
  blocks.resize(begin.back());
  Block* block = blocks.data();
  first = 0;
  for (std::size_t l = 0; l + 1 < end.size(); first = end[l++]) {
    for (std::int32_t at = first; at < end[l]; at += kLanes, ++block) {
      for (int lane = 0; lane < kLanes; ++lane) {
        const bool is_there = at + lane < end[l];
        const std::int32_t c = sorted[is_there ? at + lane : end[l] - 1];
        for (int i = 0; i < kVertices; ++i) {
          block->vertex[i][lane] = is_there ? vertices[c][i] : vertex_count + 4 * lane + i;
        }
        for (int i = 0; i < Kind::kNumbers; ++i) block->number[i][lane] = numbers[c][i];
      }
    }
  }
  multipliers.assign(blocks.size() * kMultipliers * kLanes, 0.0f);
}

}  // namespace pbd
}  // namespace tissue_sim
