#include <algorithm>
#include <numeric>
#include <tuple>

#include "mpm/blocks/blocks.h"
#include "mpm/blocks/region_shares.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/block.h"

namespace tissue_sim {
namespace {

/// A sheet and the region's cells that it needs.
struct Part {
  const Sheet* sheet;
  int lo[3] = {1 << 30, 1 << 30, 1 << 30}, hi[3] = {-1, -1, -1};

  explicit Part(const Sheet& of) : sheet(&of) {
    for (const CellShare& c : of.cells) {
      const int first[3] = {c.x, c.y, c.z}, last[3] = {c.x + c.cells - 1, c.y, c.z};
      for (int a = 0; a < 3; ++a) {
        lo[a] = std::min(lo[a], first[a]);
        hi[a] = std::max(hi[a], last[a]);
      }
    }
  }
};

/// Runs of the cells that hold points in any z-plane, gaps of up to kRunGap cells bridged where
/// they are of one side. `holds` is [ny][nx].
std::vector<Block::Run> runs_of(const Block& block, const std::vector<bool>& holds) {
  std::vector<Block::Run> runs;
  int lane = 0;
  for (int y = 0; y < block.ny; ++y) {
    for (int x = 0; x < block.nx; ++x) {
      if (!holds[y * block.nx + x]) continue;
      Block::Run* last = runs.empty() || runs.back().y != y ? nullptr : &runs.back();
      if (last == nullptr || x - (last->x + last->count) > kRunGap ||
          &block.side_at(x) != &block.side_at(last->x)) {
        runs.push_back({x, y, 0, lane});
        last = &runs.back();
      }
      lane += x + 1 - (last->x + last->count);
      last->count = x + 1 - last->x;
    }
  }
  return runs;
}

/// Fills the block's nodes and rows of them.
void find_nodes(Block& block, const LatticeBody& b) {
  const std::size_t sides = block.sides.size();
  std::vector<Block::Span> seen((block.ny + 2) * sides, {block.pitch, 0});  // by the runs
  for (const Block::Run& run : block.runs) {
    const std::ptrdiff_t side = &block.side_at(run.x) - block.sides.data();
    for (int y = run.y; y < run.y + 3; ++y) {
      Block::Span& s = seen[y * sides + side];
      s = {std::min(s.begin, run.x), std::max(s.end, run.x + run.count + 2)};
    }
  }
  block.node.assign(block.node_count(), -1);
  for (int z = 0; z < block.nz + 2; ++z) {
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const int y = static_cast<int>(i / sides), row = z * block.plane + y * block.pitch;
      const Block::Side& side = block.sides[i % sides];
      const int x0 = side.x - 1 - side.column;
      int next = seen[i].begin;
      const auto add = [&](int end, int node) {
        if (end > next) block.node_rows.push_back({row + next, end - next, node});
        next = std::max(next, end);
      };
      b.for_each_node_in_row(side.x - 1, side.x - 1 + side.count, block.y + y - 1, block.z + z - 1,
                             [&](int x, int node, int count) {
                               const int begin = x - x0, end = begin + count;
                               const auto to = block.node.begin() + row + begin;
                               std::iota(to, to + count, node);
                               add(std::min(begin, seen[i].end), -1);
                               add(std::min(end, seen[i].end), node + next - begin);
                             });
      add(seen[i].end, -1);
    }
  }
}

/// Whether all bonds of a cell's points are whole. Beside torn tissue nodes are light and swing.
bool has_whole_bonds(const LatticeBody& b, const Points& points, const CellShare& c, int i) {
  for (const std::int32_t first : c.point) {
    const std::int32_t p = first + 2 * i;
    if (first >= 0 && points.bonds[p] != whole_bonds(b, points, p)) return false;
  }
  return true;
}

/// What an anchor holds of a cell at its face keeps a little of its stiffness, so that no node of
/// the cell hangs loose.
void keep_held(Block& block, const Points& points, int z, int column) {
  for (int s = 0; s < 8; ++s) {
    const std::size_t lane = (static_cast<std::size_t>(z) * 8 + s) * block.stride + column;
    const std::int32_t point = block.point[lane];
    if (point >= 0 && block.volume[lane] == 0) {
      block.volume[lane] = kStabilisation * points.volume[point];
    }
  }
}

/// Puts the part's points into the lanes of the block, lane_of[ny][nx].
void fill_side(Block& block, const LatticeBody& b, const Points& points, const Part& part,
               const Block::Side& side, int first_y, const std::vector<int>& lane_of) {
  for (const CellShare& c : part.sheet->cells) {
    const int x = side.column + c.x - part.lo[0], z = c.z - part.lo[2];
    const int column = lane_of[(c.y - first_y) * block.nx + x];
    std::vector<double> mu(c.cells, 0.0);
    std::vector<int> count(c.cells, points.free_volume.empty() ? c.count : 0);
    for (int s = 0; s < 8; ++s) {
      if (c.point[s] < 0) continue;
      const std::size_t lane = (static_cast<std::size_t>(z) * 8 + s) * block.stride + column;
      float* const volume = &block.volume[lane];
      std::int32_t* const point = &block.point[lane];
      for (int i = 0; i < c.cells; ++i) {
        point[i] = c.point[s] + 2 * i;
        volume[i] = points.volume[point[i]];
      }
      if (!points.soft.empty() || !points.free_volume.empty()) {
        for (int i = 0; i < c.cells; ++i) volume[i] = elastic_volume(points, point[i]);
      }
      for (int i = 0; i < c.cells; ++i) {
        mu[i] += lame_mu(b.material_of(points, point[i])) * volume[i];
        if (!points.free_volume.empty() && volume[i] > 0) ++count[i];
      }
    }
    for (int i = 0; i < c.cells; ++i) {
      if (count[i] >= kSteadyCount || count[i] == 0) continue;
      const bool anchor_has_rest = c.count >= kSteadyCount;
      if (anchor_has_rest && has_whole_bonds(b, points, c, i)) {
        keep_held(block, points, z, column + i);
        continue;
      }
      block.partial.push_back({z * block.stride + column + i,
                               z * block.plane + block.cell[column + i],
                               static_cast<float>(mu[i])});
    }
  }
}

/// Adds the nodes of row y of z-plane z that are split, as a side sees them, to `split`.
void split_row(Block& block, const BlockRegion& r, const Part& part, const Block::Side& side, int y,
               int z, std::vector<Block::NodeRow>& split) {
  const std::vector<std::int32_t>& field = part.sheet->node;
  if (field.empty()) return;
  const int first = ((part.lo[2] + z) * (r.ny + 2) + block.y - r.y + y) * (r.nx + 2) + part.lo[0];
  Block::NodeRow* last = nullptr;
  for (int x = 0; x < side.count; ++x) {
    const int local = z * block.plane + y * block.pitch + side.column + x;
    const std::int32_t node = field[first + x];
    if (node == -1 || node == block.node[local]) continue;
    block.node[local] = node;
    if (last != nullptr && last->local + last->count == local && last->node + last->count == node) {
      ++last->count;
      continue;
    }
    split.push_back({local, 1, node});
    last = &split.back();
  }
}

/// The rows, but where nodes are `split` those that stand there instead. Both in the order of the
/// block's nodes.
std::vector<Block::NodeRow> with_split(const std::vector<Block::NodeRow>& rows,
                                       const std::vector<Block::NodeRow>& split) {
  std::vector<Block::NodeRow> all;
  all.reserve(rows.size() + 2 * split.size());
  const auto add = [&all](const Block::NodeRow& r, int begin, int end) {
    if (begin < end) all.push_back({begin, end - begin, r.node + begin - r.local});
  };
  std::size_t next = 0;
  for (const Block::NodeRow& row : rows) {
    int local = row.local;
    const int row_end = local + row.count;
    if (row.node < 0) {
      all.push_back(row);
      continue;
    }
    for (; next < split.size() && split[next].local < row_end; ++next) {
      const Block::NodeRow& s = split[next];
      const int begin = std::max(local, s.local), end = std::min(row_end, s.local + s.count);
      if (begin < end) {
        add(row, local, begin);
        add(s, begin, end);
        local = end;
      }
      if (s.local + s.count > row_end) break;
    }
    add(row, local, row_end);
  }
  return all;
}

/// The block of parts between the same z-planes, no larger than their points need.
Block make_block(const BlockRegion& r, const LatticeBody& b, const Points& points,
                 const std::vector<Part>& parts) {
  int first_y = 1 << 30, last_y = -1, columns = 0;
  Block block;
  block.body = r.body;
  for (const Part& part : parts) {
    first_y = std::min(first_y, part.lo[1]);
    last_y = std::max(last_y, part.hi[1]);
    block.sides.push_back({columns, part.hi[0] - part.lo[0] + 3, r.x + part.lo[0]});
    columns += block.sides.back().count;
  }
  block.x = block.sides[0].x;
  block.y = r.y + first_y;
  block.z = r.z + parts[0].lo[2];
  block.nx = columns - 2;
  block.ny = last_y - first_y + 1;
  block.nz = parts[0].hi[2] - parts[0].lo[2] + 1;
  std::vector<bool> holds(block.nx * block.ny, false);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (const CellShare& c : parts[i].sheet->cells) {
      const int x = block.sides[i].column + c.x - parts[i].lo[0];
      std::fill_n(holds.begin() + (c.y - first_y) * block.nx + x, c.cells, true);
    }
  }
  block.runs = runs_of(block, holds);
  lay_out(block);
  block.volume.assign(block.lane_count(), 0.0f);
  block.point.assign(block.lane_count(), -1);
  std::vector<int> lane_of(block.nx * block.ny, -1);
  for (const Block::Run& run : block.runs) {
    for (int i = 0; i < run.count; ++i) lane_of[run.y * block.nx + run.x + i] = run.lane + i;
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    fill_side(block, b, points, parts[i], block.sides[i], first_y, lane_of);
  }
  find_filled(block);
  std::sort(block.partial.begin(), block.partial.end(),
            [](const auto& p, const auto& q) { return p.lane < q.lane; });
  find_materials(block, b, points);
  find_nodes(block, b);
  std::vector<Block::NodeRow> split;
  for (int z = 0; z < block.nz + 2; ++z) {
    for (int y = 0; y < block.ny + 2; ++y) {
      for (std::size_t i = 0; i < parts.size(); ++i) {
        split_row(block, r, parts[i], block.sides[i], y, z, split);
      }
    }
  }
  if (!split.empty()) block.node_rows = with_split(block.node_rows, split);
  return block;
}

/// A sheet's points by their materials, in the order of these.
std::vector<Sheet> by_material(const Sheet& sheet, const LatticeBody& b, const Points& points) {
  std::vector<Sheet> parts(b.materials.size());
  for (const CellShare& of_run : sheet.cells) {
    for (int i = 0; i < of_run.cells; ++i) {
      CellShare c = of_run;
      c.cells = 1;
      c.x = static_cast<std::int16_t>(c.x + i);
      for (int s = 0; s < 8; ++s) {
        if (c.point[s] < 0) continue;
        const std::int32_t p = c.point[s] + 2 * i;
        std::vector<CellShare>& cells = parts[points.material_of(p)].cells;
        if (cells.empty() ||
            std::tie(cells.back().x, cells.back().y, cells.back().z) != std::tie(c.x, c.y, c.z)) {
          cells.push_back(c);
          std::fill_n(cells.back().point, 8, -1);
        }
        cells.back().point[s] = p;
      }
    }
  }
  for (Sheet& part : parts) part.node = sheet.node;
  return parts;
}

}  // namespace

void fill_region(BlockRegion& r, const LatticeTissue& tissue, bool uniform) {
  r.blocks.clear();
  const LatticeBody& b = tissue.bodies[r.body];
  std::vector<std::vector<Part>> together;
  const auto add = [&](const Sheet& sheet) {
    if (sheet.cells.empty()) return;
    const Part part(sheet);
    const auto same = std::find_if(together.begin(), together.end(), [&](const auto& parts) {
      return !uniform && parts[0].lo[2] == part.lo[2] && parts[0].hi[2] == part.hi[2];
    });
    if (same != together.end()) {
      same->push_back(part);
    } else {
      together.push_back({part});
    }
  };
  std::vector<Sheet> sheets = sheets_of(r, b, tissue.points, *tissue.fields);
  if (uniform && b.materials.size() > 1) {
    std::vector<Sheet> of_one;
    for (const Sheet& sheet : sheets) {
      for (Sheet& part : by_material(sheet, b, tissue.points)) of_one.push_back(std::move(part));
    }
    sheets = std::move(of_one);
  }
  for (const Sheet& sheet : sheets) add(sheet);
  for (const std::vector<Part>& parts : together) {
    r.blocks.push_back(make_block(r, b, tissue.points, parts));
  }
}

}  // namespace tissue_sim
