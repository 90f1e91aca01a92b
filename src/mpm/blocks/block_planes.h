// What the kernels of a block share: its layout in scratch, its nodes and their x-y quantities. For
// kernel_set.h alone, which compiles it for each instruction set.
#pragma once

#include <algorithm>

#include "mpm/blocks/block_kernels.h"
#include "mpm/blocks/block_passes.h"

namespace tissue_sim {
namespace kernels {

/// Offsets into a thread's scratch for one block.
struct Layout {
  int pitch, stride, plane;
  int node_component;  ///< floats of one component of the block's nodes
  int quantity;        ///< floats of one x-y quantity: the lanes and room for what overruns them
  int in_plane;        ///< x-y quantities of one node plane, all components
  int out_plane;       ///< the same of outgoing ones, kLanes in front
  int sum_pitch;       ///< of the forces on a node plane: rows in whole vectors, for a vector that
                       ///< overlaps one just stored must wait for it
  int sum_component;   ///< floats of one component of the forces on a node plane

  explicit Layout(const Block& b)
      : pitch(b.pitch),
        stride(b.stride),
        plane(b.plane),
        node_component(b.copied_component()),
        quantity(b.stride + kLanes),
        in_plane(3 * kStressXyCount * quantity),
        out_plane(in_plane + kLanes),
        sum_pitch((b.pitch + kLanes - 1) / kLanes * kLanes),
        sum_component((b.ny + 2) * sum_pitch + kLanes) {}
};

inline void reserve(Array<float>& a, std::size_t n) {
  if (a.size() < n) a.resize(n);
}

/// `count` floats times `scale`, in vectors that overlap at the end.
template <int W>
TISSUE_SIM_INLINE void scale_row(const float* from, float scale, int count, float* to) {
  if (count >= W) {
    for (int i = 0; i + W < count; i += W) store<W>(to + i, scale * load<W>(from + i));
    store<W>(to + count - W, scale * load<W>(from + count - W));
  } else if constexpr (W > 4) {
    scale_row<W / 2>(from, scale, count, to);
  } else {
    for (int i = 0; i < count; ++i) to[i] = scale * from[i];
  }
}

/// Copies the block's nodes of `field`, times `scale`, into `copy`: [3][nz + 2][plane]. In whole
/// vectors, for many rows are shorter: what is behind a row is of one that follows, or of none.
template <int W>
TISSUE_SIM_INLINE void gather_nodes(const Block& b, const Array<float>* field, float scale,
                                    const Layout& l, Array<float>& copy) {
  reserve(copy, 3 * l.node_component);
  float* const out = copy.data();
  const float* from[3] = {field[0].data(), field[1].data(), field[2].data()};
  for (const Block::NodeRow& row : b.node_rows) {
    float* to = out + row.local;
    if (row.node < 0) {
      for (int c = 0; c < 3; ++c) std::fill_n(to + c * l.node_component, row.count, 0.0f);
      continue;
    }
    for (int i = 0; i < row.count; i += W) {
      for (int c = 0; c < 3; ++c) {
        store<W>(to + c * l.node_component + i, scale * load<W>(from[c] + row.node + i));
      }
    }
  }
}

/// Some x-y quantities of node plane z, `count` of each component, into slot z % 3 of `in`;
/// pass(width, from, pitch, stride, to) is their x-y pass of one component.
template <int W, class Pass>
TISSUE_SIM_INLINE void load_quantities(const Block& b, const Layout& l, const float* nodes, int z,
                                       int count, float* in, const Pass& pass) {
  for (const Block::Run& run : b.runs) {
    const float* from = nodes + z * l.plane + run.y * l.pitch + run.x;
    float* to = in + (z % 3) * 3 * count * l.quantity + run.lane;
    for_each_vector<W>(run.count, [&](auto width, int j) TISSUE_SIM_INLINE_LAMBDA {
      for (int c = 0; c < 3; ++c) {
        pass(width, from + c * l.node_component + j, l.pitch, l.quantity,
             to + c * count * l.quantity + j);
      }
    });
  }
}

/// Those of the stress.
template <int W>
TISSUE_SIM_INLINE void load_plane(const Block& b, const Layout& l, const float* nodes, int z,
                                  float* in) {
  load_quantities<W>(b, l, nodes, z, kStressXyCount, in,
                     [](auto width, auto... of)
                         TISSUE_SIM_INLINE_LAMBDA { xy_pass<width>(of...); });
}

/// Those of the mean gradients of cells.
template <int W>
TISSUE_SIM_INLINE void load_mean_plane(const Block& b, const Layout& l, const float* nodes, int z,
                                       float* in) {
  load_quantities<W>(b, l, nodes, z, kMeanXyCount, in,
                     [](auto width, auto... of)
                         TISSUE_SIM_INLINE_LAMBDA { mean_xy_pass<width>(of...); });
}

/// Those of values at the points.
template <int W>
TISSUE_SIM_INLINE void load_values(const Block& b, const Layout& l, const float* nodes, int z,
                                   float* in) {
  load_quantities<W>(b, l, nodes, z, kValueXyCount, in,
                     [](auto width, auto... of)
                         TISSUE_SIM_INLINE_LAMBDA { value_xy_pass<width>(of...); });
}

/// The forces on node plane z from its outgoing x-y quantities.
template <int W>
TISSUE_SIM_INLINE void store_plane(const Block& b, const Layout& l, const float* out, int z,
                                   float scale, float* sums, float* force) {
  for (int c = 0; c < 3; ++c) std::fill_n(sums + c * l.sum_component, l.sum_component, 0.0f);
  for (const Block::Run& run : b.runs) {
    const float* from = out + (z % 3) * l.out_plane + kLanes + run.lane;
    float* to = sums + run.y * l.sum_pitch + run.x;
    for_each_vector<W>(run.count + 2, [&](auto width, int m) TISSUE_SIM_INLINE_LAMBDA {
      for (int c = 0; c < 3; ++c) {
        xy_transpose<width>(from + c * kStressXyCount * l.quantity, l.quantity, run.count, m,
                            l.sum_pitch, to + c * l.sum_component);
      }
    });
  }
  for (int c = 0; c < 3; ++c) {
    const float* from = sums + c * l.sum_component;
    float* to = force + (c * (b.nz + 2) + z) * l.plane;
    for (int y = 0; y < b.ny + 2; ++y) {
      scale_row<W>(from + y * l.sum_pitch, scale, l.pitch, to + y * l.pitch);
    }
    std::fill(to + (b.ny + 2) * l.pitch, to + l.plane, 0.0f);
  }
}

/// As gradient() has it, of all components.
template <int W, bool some = false>
TISSUE_SIM_INLINE void gradients(const Layout& l, const float* in, int z, int j, Vec<W> (*G)[9],
                                 Mask<W> holds = Mask<W>{}) {
  for (int c = 0; c < 3; ++c) {
    const float* q = in + c * kStressXyCount * l.quantity + j;
    gradient<W, some>(q + (z % 3) * l.in_plane, q + ((z + 1) % 3) * l.in_plane,
                      q + ((z + 2) % 3) * l.in_plane, l.quantity, c, G, holds);
  }
}

template <int W>
TISSUE_SIM_INLINE void add_identity(Vec<W>* F) {
  for (int i = 0; i < 9; i += 4) F[i] = F[i] + 1.0f;
}

}  // namespace kernels
}  // namespace tissue_sim
