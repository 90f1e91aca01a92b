#include "mpm/blocks/blocks.h"

#include <algorithm>
#include <memory>
#include <numeric>

#include "mpm/blocks/known_facets.h"
#include "mpm/surface/surface_places.h"

namespace tissue_sim {
namespace {

/// Runs of columns that hold points, gaps of up to kRunGap bridged, long runs halved.
std::vector<std::pair<int, int>> x_runs(const LatticeBody& b, int y0, int ny, int z0, int nz,
                                        int longest) {
  std::vector<std::pair<int, int>> runs;
  std::vector<bool> any(b.nx, false);
  for (int z = 2 * z0; z < 2 * (z0 + nz); ++z) {
    for (int y = 2 * y0; y < 2 * (y0 + ny); ++y) {
      b.for_each_point_in_row(0, 2 * b.nx, y, z, [&](int x, int, int count) {
        std::fill(any.begin() + x / 2, any.begin() + (x + count + 1) / 2, true);
      });
    }
  }
  for (int x = 0; x < b.nx; ++x) {
    if (!any[x]) continue;
    if (!runs.empty() && x - runs.back().second <= 2 * kRunGap) {
      runs.back().second = x + 1;
    } else {
      runs.emplace_back(x, x + 1);
    }
  }
  std::vector<std::pair<int, int>> parts;
  for (const auto& [begin, end] : runs) {
    const int n = (end - begin + longest - 1) / longest;
    for (int i = 0; i < n; ++i) {
      parts.emplace_back(begin + (end - begin) * i / n, begin + (end - begin) * (i + 1) / n);
    }
  }
  return parts;
}

void list_by_cost(Blocks& blocks) {
  std::vector<std::size_t> cost;  // in cells; one that is stabilised counts twice
  for (const Block* block : blocks.all) {
    cost.push_back(block->partial.size());
    for (const auto& plane : block->filled) {
      for (const Block::Span& span : plane) cost.back() += span.end - span.begin;
    }
  }
  blocks.by_cost.resize(cost.size());
  std::iota(blocks.by_cost.begin(), blocks.by_cost.end(), 0);
  std::stable_sort(blocks.by_cost.begin(), blocks.by_cost.end(),
                   [&cost](int a, int b) { return cost[a] > cost[b]; });
}

}  // namespace

void list_blocks(Blocks& blocks) {
  blocks.all.clear();
  blocks.force_size = kLanes;  // rows are read in whole vectors, which reach beyond either end
  for (BlockRegion& r : blocks.regions) {
    for (Block& b : r.blocks) {
      b.force_offset = blocks.force_size;
      blocks.force_size += static_cast<std::size_t>(3) * b.node_count();
      if (b.number < 0) b.number = blocks.next_number++;
      blocks.all.push_back(&b);
    }
  }
  blocks.force_size += kLanes;
}

void connect_forces(Blocks& blocks, std::size_t node_count) {
  if (!blocks.has_rows) return;
  list_by_cost(blocks);
  struct Entry {
    int row;
    RowPart part;
  };
  std::vector<Entry> entries;
  for (const Block* block : blocks.all) {
    const std::size_t component = block->node_count();
    for (const Block::NodeRow& r : block->node_rows) {
      for (int i = 0; r.node >= 0 && i < r.count;) {
        const int node = r.node + i, begin = node % kNodeRow;
        const int count = std::min(r.count - i, kNodeRow - begin);
        const std::size_t force = block->force_offset + r.local + i;
        entries.push_back({node / kNodeRow, {force, component, begin, count}});
        i += count;
      }
    }
  }
  // Those of a row one after the other, in the order of the blocks.
  const int row_count = static_cast<int>((node_count + kNodeRow - 1) / kNodeRow);
  std::vector<int> end_of(row_count + 1, 0);  // first, then end of each row's
  for (const Entry& e : entries) ++end_of[e.row + 1];
  std::partial_sum(end_of.begin(), end_of.end(), end_of.begin());
  blocks.row_parts.resize(entries.size());
  for (const Entry& e : entries) blocks.row_parts[end_of[e.row]++] = e.part;
  blocks.rows.clear();
  for (int row = 0, begin = 0; row < row_count; begin = end_of[row++]) {
    const int end = end_of[row];
    int lo = kNodeRow, hi = 0;
    for (int i = begin; i < end; ++i) {
      const RowPart& part = blocks.row_parts[i];
      lo = std::min(lo, part.begin);
      hi = std::max(hi, part.begin + part.count);
    }
    for (int i = begin; i < end; ++i) blocks.row_parts[i].begin -= lo;
    if (end > begin) blocks.rows.push_back({row * kNodeRow + lo, hi - lo, begin, end - begin});
  }
}

namespace {

/// A region whose blocks are made anew, and the facets that it had; null until it is filled.
struct NewRegion {
  int index;
  std::shared_ptr<const KnownFacets> known;
};

/// Makes their blocks, without facets.
void fill_regions(Blocks& blocks, std::vector<NewRegion>& anew, const LatticeTissue& tissue,
                  Cpu& cpu) {
  cpu.for_each(static_cast<int>(anew.size()), [&](int i) {
    NewRegion& of = anew[i];
    BlockRegion& r = blocks.regions[of.index];
    if (of.known == nullptr) {
      of.known = r.blocks.empty() ? std::make_shared<const KnownFacets>()
                                  : std::make_shared<const KnownFacets>(tissue.bodies[r.body], r,
                                                                        blocks.stale_facets);
    }
    fill_region(r, tissue, blocks.uniform);
  });
}

/// Block by block their facets; meanwhile connects the forces of all blocks.
void finish_regions(Blocks& blocks, const std::vector<NewRegion>& anew, const LatticeTissue& tissue,
                    Cpu& cpu) {
  std::vector<std::pair<Block*, const KnownFacets*>> made;
  for (const NewRegion& r : anew) {
    for (Block& b : blocks.regions[r.index].blocks) made.emplace_back(&b, r.known.get());
  }
  list_blocks(blocks);
  cpu.both([&] { connect_forces(blocks, tissue.nodes.size()); },
           [&] {
             cpu.for_each(static_cast<int>(made.size()), [&](int i) {
               Block& b = *made[i].first;
               b.facets = facets_of(tissue.bodies[b.body], tissue.points, tissue.nodes, b,
                                    *made[i].second);
               if (tissue.points.outer.empty()) return;
               b.surface = surface_places_of(tissue.bodies[b.body], tissue.points, b);
               b.merged = merged_places(b.surface, tissue.points);
             });
           });
}

/// Whether a block that a cut goes through is so tall that halves of its region have two layers.
bool may_be_halved(const BlockRegion& r) {
  return !r.half && std::any_of(r.blocks.begin(), r.blocks.end(),
                                [](const Block& b) { return b.nz >= 4 && !b.partial.empty(); });
}

/// How much of thread blocks a region takes: two blocks of few columns can share one.
double share_of(const BlockRegion& r) {
  double sum = 0;
  for (const Block& b : r.blocks) {
    const auto columns = std::count(b.filled_columns.begin(), b.filled_columns.end(), 1);
    sum += 2 * columns > r.nx * r.ny ? 1 : 0.5;
  }
  return sum;
}

/// See BlockShape::room. `before`: the blocks that each region had. Returns those of `anew` that
/// are still to be filled.
std::vector<NewRegion> halve_regions(Blocks& blocks, std::vector<NewRegion>& anew,
                                     std::vector<Blocks::Origin>& before) {
  if (blocks.room == 0) return {};
  double wanted = 0;
  for (const BlockRegion& r : blocks.regions) wanted += share_of(r);
  std::vector<const NewRegion*> of(blocks.regions.size(), nullptr);
  bool any = false;
  for (const NewRegion& r : anew) {
    of[r.index] = &r;
    if (!may_be_halved(blocks.regions[r.index])) continue;
    wanted += share_of(blocks.regions[r.index]);
    any = true;
  }
  if (!any) return {};
  if (wanted > blocks.room) {
    blocks.room = 0;
    return {};
  }
  std::vector<BlockRegion> regions;
  std::vector<Blocks::Origin> origin;
  std::vector<NewRegion> all_new, unfilled;
  for (std::size_t i = 0; i < blocks.regions.size(); ++i) {
    BlockRegion& r = blocks.regions[i];
    if (of[i] != nullptr && may_be_halved(r)) {
      const int below = r.nz / 2;
      for (const auto& [z, nz] : {std::pair(r.z, below), std::pair(r.z + below, r.nz - below)}) {
        all_new.push_back({static_cast<int>(regions.size()), of[i]->known});
        unfilled.push_back(all_new.back());
        regions.push_back({r.body, r.x, r.y, z, r.nx, r.ny, nz, {}, true});
        origin.push_back(before[i]);
      }
      continue;
    }
    if (of[i] != nullptr) all_new.push_back({static_cast<int>(regions.size()), of[i]->known});
    regions.push_back(std::move(r));
    origin.push_back(before[i]);
  }
  blocks.regions = std::move(regions);
  before = std::move(origin);
  anew = std::move(all_new);
  return unfilled;
}

}  // namespace

Blocks make_blocks(const LatticeTissue& tissue, const BlockShape& shape, Cpu& cpu) {
  Blocks blocks;
  blocks.uniform = shape.uniform;
  blocks.has_rows = shape.has_rows;
  blocks.room = shape.room;
  for (std::size_t i = 0; i < tissue.bodies.size(); ++i) {
    const LatticeBody& b = tissue.bodies[i];
    for (int z = 0; z < b.nz; z += shape.z) {
      for (int y = 0; y < b.ny; y += shape.y) {
        const int ny = std::min(shape.y, b.ny - y), nz = std::min(shape.z, b.nz - z);
        for (const auto& [begin, end] : x_runs(b, y, ny, z, nz, shape.x)) {
          blocks.regions.push_back({static_cast<int>(i), begin, y, z, end - begin, ny, nz, {}});
        }
      }
    }
  }
  std::vector<NewRegion> all;
  for (std::size_t i = 0; i < blocks.regions.size(); ++i) {
    all.push_back({static_cast<int>(i), nullptr});
  }
  fill_regions(blocks, all, tissue, cpu);
  finish_regions(blocks, all, tissue, cpu);
  return blocks;
}

void update_blocks(Blocks& blocks, const LatticeTissue& tissue,
                   const std::vector<NodeFields::Cell>& cells, Cpu& cpu) {
  const auto touched = [&cells](const BlockRegion& r) {
    return std::any_of(cells.begin(), cells.end(), [&r](const NodeFields::Cell& c) {
      return c.body == r.body && c.x >= r.x - 1 && c.x <= r.x + r.nx && c.y >= r.y - 1 &&
             c.y <= r.y + r.ny && c.z >= r.z - 1 && c.z <= r.z + r.nz;
    });
  };
  std::vector<Blocks::Origin> before;  // blocks of each region
  for (const BlockRegion& r : blocks.regions) {
    const int first = before.empty() ? 0 : before.back().end;
    before.push_back({first, first + static_cast<int>(r.blocks.size())});
  }
  std::vector<NewRegion> anew;
  for (std::size_t i = 0; i < blocks.regions.size(); ++i) {
    if (touched(blocks.regions[i])) anew.push_back({static_cast<int>(i), nullptr});
  }
  fill_regions(blocks, anew, tissue, cpu);
  std::vector<NewRegion> unfilled = halve_regions(blocks, anew, before);
  fill_regions(blocks, unfilled, tissue, cpu);
  finish_regions(blocks, anew, tissue, cpu);
  std::vector<std::uint8_t> is_new(blocks.regions.size(), 0);
  for (const NewRegion& of : anew) {
    is_new[of.index] = 1;
    const BlockRegion& r = blocks.regions[of.index];
    const LatticeBody& b = tissue.bodies[r.body];
    for (int z = r.z; z < r.z + r.nz; ++z) {
      for (int y = r.y; y < r.y + r.ny; ++y) {
        b.for_each_node_in_row(r.x, r.x + r.nx, y, z, [&](int, int first, int count) {
          std::fill_n(blocks.stale_facets.begin() + first, count, std::uint8_t{0});
        });
      }
    }
  }
  blocks.origin.clear();
  for (std::size_t i = 0; i < blocks.regions.size(); ++i) {
    for (int b = 0; b < static_cast<int>(blocks.regions[i].blocks.size()); ++b) {
      const int same = before[i].begin + b;
      blocks.origin.push_back(is_new[i] != 0 ? before[i] : Blocks::Origin{same, same + 1});
    }
  }
}

}  // namespace tissue_sim
