// Clouds of tissue on the CPU.
#include <algorithm>
#include <cstring>

#include "fragments/piece_colour.h"
#include "frame/select_points.h"
#include "mpm/cpu/cpu_device.h"
#include "mpm/lattice/bonds.h"
#include "mpm/point_fields.h"

namespace tissue_sim {

int CpuMpmDevice::read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) {
  MpmState& s = state_;
  const std::vector<const Fragment*> piece = pieces_by_id(run_.pieces);
  int count = 0;
  const std::vector<std::int32_t> index = select_points(
      selection, run_.pieces, [&](std::int32_t p) { return s.points.bonds[p] != kAllBonds; },
      count);
  cloud.resize(static_cast<std::size_t>(count) * sizeof(Point));
  s.cpu->for_each(static_cast<int>(s.blocks.all.size()), [&](int i) {
    const Block& block = *s.blocks.all[i];
    const auto wanted = [&index](std::int32_t p) { return p >= 0 && index[p] >= 0; };
    if (std::none_of(block.point.begin(), block.point.end(), wanted)) return;
    const LatticeBody& body = s.bodies[block.body];
    BlockScratch& scratch = s.scratch.local();
    const std::size_t lanes = block.lane_count();
    if (scratch.values.size() < 4 * lanes) scratch.values.resize(4 * lanes);
    float* x = scratch.values.data();
    float* stress = x + 3 * lanes;
    const BlockField field = block_field(s, block);
    s.kernels->positions(block, field, s.nodes.u, scratch, x);
    s.kernels->state(block, field, scratch, stress);
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const std::int32_t p = block.point[lane];
      if (!wanted(p)) continue;
      const Fragment& f = *piece[run_.pieces.of_point[p]];
      Point out;
      out.x = x[lane];
      out.y = x[lanes + lane];
      out.z = x[2 * lanes + lane];
      Vec3 held;
      if (held_place(s, p, held)) {
        out.x = static_cast<float>(held[0]);
        out.y = static_cast<float>(held[1]);
        out.z = static_cast<float>(held[2]);
      }
      out.rgb = piece_colour(f);
      out.id = static_cast<std::uint32_t>(p);
      out.fragment = f.id;
      // What an anchor holds has none.
      out.stress = s.points.free_volume_of(p) > 0 ? stress[lane] : 0;
      const int whole = __builtin_popcount(whole_bonds(body, s.points, p));
      const int left = __builtin_popcount(s.points.bonds[p]);
      out.damage = whole > 0 ? 1.0f - static_cast<float>(left) / whole : 0.0f;
      std::memcpy(cloud.data() + static_cast<std::size_t>(index[p]) * sizeof(Point), &out,
                  sizeof(Point));
    }
  });
  add_point_fields(s, selection, index, count, cloud);
  return count;
}

}  // namespace tissue_sim
