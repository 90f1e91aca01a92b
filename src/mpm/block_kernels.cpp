#include "mpm/block_kernels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "material/laws.h"
#include "mpm/block_passes.h"
#include "mpm/stabilisation.h"

namespace tissue_sim {
namespace {

/// Offsets into a thread's scratch for one block.
struct Layout {
  int pitch, stride, plane;
  int node_component;  ///< floats of one component of the block's nodes
  int quantity;        ///< floats of one x-y quantity: the lanes and room for what overruns them
  int in_plane;        ///< x-y quantities of one node plane, all components
  int out_plane;       ///< the same of outgoing ones, kLanes in front
  int sum_component;   ///< floats of one component of the forces on a node plane

  explicit Layout(const Block& b)
      : pitch(b.pitch),
        stride(b.stride),
        plane(b.plane),
        node_component((b.nz + 2) * b.plane + 2 * kLanes),
        quantity(b.stride + kLanes),
        in_plane(3 * kStressXyCount * quantity),
        out_plane(in_plane + kLanes),
        sum_component(b.plane + kLanes) {}
};

void reserve(Array<float>& a, std::size_t n) {
  if (a.size() < n) a.resize(n);
}

/// Copies the block's nodes of `field`, times `scale`, into [3][nz + 2][plane].
void gather_nodes(const Block& b, const BlockField& f, const Array<float>* field, float scale,
                  const Layout& l, float* out) {
  for (int c = 0; c < 3; ++c) {
    const float* from = field[c].data() + f.first_node;
    float* to = out + c * l.node_component;
    for (int z = 0; z < b.nz + 2; ++z) {
      for (int y = 0; y < b.ny + 2; ++y) {
        const float* row = from + z * f.pitch_z + y * f.pitch_y;
        float* out_row = to + z * l.plane + y * l.pitch;
        const Block::NodeSpan seen = b.node_rows[y];
        for (int x = seen.begin; x < seen.end; ++x) out_row[x] = row[x] * scale;
      }
    }
    for (const Block::SplitNode& s : b.split_nodes) to[s.local] = field[c][s.node] * scale;
  }
}

/// The x-y quantities of node plane z, all components, into slot z % 3 of `in`.
template <int W>
TISSUE_SIM_INLINE void load_plane(const Block& b, const Layout& l, const float* nodes, int z,
                                  float* in) {
  for (const Block::Run& run : b.runs) {
    const float* from = nodes + z * l.plane + run.y * l.pitch + run.x;
    float* to = in + (z % 3) * l.in_plane + run.lane;
    for_each_vector<W>(
        run.count, [&](auto width, int j) __attribute__((always_inline)) {
          for (int c = 0; c < 3; ++c) {
            xy_pass<width>(from + c * l.node_component + j, l.pitch, l.quantity,
                           to + c * kStressXyCount * l.quantity + j);
          }
        });
  }
}

/// The same for the mean gradients of cells.
template <int W>
TISSUE_SIM_INLINE void load_mean_plane(const Block& b, const Layout& l, const float* nodes, int z,
                                       float* in) {
  for (const Block::Run& run : b.runs) {
    const float* from = nodes + z * l.plane + run.y * l.pitch + run.x;
    float* to = in + (z % 3) * 3 * kMeanXyCount * l.quantity + run.lane;
    for_each_vector<W>(
        run.count, [&](auto width, int j) __attribute__((always_inline)) {
          for (int c = 0; c < 3; ++c) {
            mean_xy_pass<width>(from + c * l.node_component + j, l.pitch, l.quantity,
                                to + c * kMeanXyCount * l.quantity + j);
          }
        });
  }
}

/// The forces on node plane z from its outgoing x-y quantities.
template <int W>
TISSUE_SIM_INLINE void store_plane(const Block& b, const Layout& l, const float* out, int z,
                                   float scale, float* sums, float* force) {
  std::fill_n(sums, 3 * l.sum_component, 0.0f);
  for (const Block::Run& run : b.runs) {
    const float* from = out + (z % 3) * l.out_plane + kLanes + run.lane;
    float* to = sums + run.y * l.pitch + run.x;
    for_each_vector<W>(
        run.count + 2, [&](auto width, int m) __attribute__((always_inline)) {
          for (int c = 0; c < 3; ++c) {
            xy_transpose<width>(from + c * kStressXyCount * l.quantity, l.quantity, run.count, m,
                                l.pitch, to + c * l.sum_component);
          }
        });
  }
  for (int c = 0; c < 3; ++c) {
    const float* from = sums + c * l.sum_component;
    float* to = force + (c * (b.nz + 2) + z) * l.plane;
    for (int i = 0; i < l.plane; ++i) to[i] = scale * from[i];
  }
}

template <int W>
TISSUE_SIM_INLINE void gradients(const Layout& l, const float* in, int z, int j, Vec<W> (*G)[9]) {
  for (int c = 0; c < 3; ++c) {
    const float* q = in + c * kStressXyCount * l.quantity + j;
    gradient<W>(q + (z % 3) * l.in_plane, q + ((z + 1) % 3) * l.in_plane,
                q + ((z + 2) % 3) * l.in_plane, l.quantity, c, G);
  }
}

template <int W>
TISSUE_SIM_INLINE void add_identity(Vec<W>* F) {
  for (int i = 0; i < 9; i += 4) F[i] = F[i] + 1.0f;
}

/// Adds the force that stabilises the block's partial cells, W cells at a time, to `force` where
/// there is one. Returns the energy. `nodes` are displacements over cell size.
template <int W>
TISSUE_SIM_INLINE double stabilise_cells(const Block& b, const BlockField& f, const Layout& l,
                                         const float* nodes, float* force) {
  const int count = static_cast<int>(b.partial.size());
  int row[9];  // of a cell's nodes, from its lowest
  for (int k = 0; k < 9; ++k) row[k] = k / 3 * l.plane + k % 3 * l.pitch;
  double twice_energy = 0;
  for (int first = 0; first < count; first += W) {
    alignas(64) float stiffness[W], u[27][W];
    int node[W];
    for (int i = 0; i < W; ++i) {
      const Block::PartialCell& cell = b.partial[std::min(first + i, count - 1)];
      node[i] = cell.node;
      stiffness[i] = first + i < count ? kStabilisation * f.mu * cell.volume : 0.0f;
    }
    const int used = std::min(W, count - first);
    for (int c = 0; c < 3; ++c) {
      for (int i = 0; i < W; ++i) {
        const float* from = nodes + c * l.node_component + node[i];
#pragma GCC unroll 9
        for (int k = 0; k < 9; ++k) {
          const float* at = from + row[k];
          u[3 * k][i] = at[0];
          u[3 * k + 1][i] = at[1];
          u[3 * k + 2][i] = at[2];
        }
      }
      Vec<W> v[27];
      for (int k = 0; k < 27; ++k) v[k] = load<W>(u[k]);
      const Vec<W> energy = stabilise<W>(load<W>(stiffness), v);
      for (int i = 0; i < used; ++i) twice_energy += static_cast<double>(energy[i]);
      if (force == nullptr) continue;
      for (int k = 0; k < 27; ++k) store<W>(u[k], v[k] * (-1.0f / f.cell_size));
      for (int i = 0; i < used; ++i) {
        float* to = force + c * b.node_count() + node[i];
#pragma GCC unroll 9
        for (int k = 0; k < 9; ++k) {
          float* at = to + row[k];
          at[0] += u[3 * k][i];
          at[1] += u[3 * k + 1][i];
          at[2] += u[3 * k + 2][i];
        }
      }
    }
  }
  return 0.5 * twice_energy;
}

/// Kelvin-Voigt stress of W cells at their middle, times an eighth of the volume of their points:
/// added to the stress at all eight points it is the force of the mean gradient.
template <int W>
TISSUE_SIM_INLINE void viscous_stress(const Block& b, const BlockField& f, const Layout& l,
                                      const float* in, const float* in_rate, int z, int j,
                                      Vec<W>* P) {
  Vec<W> F[9], rate[9];
  for (int c = 0; c < 3; ++c) {
    const float *q[3], *r[3];
    for (int i = 0; i < 3; ++i) {
      const int slot = (z + i) % 3;
      q[i] = in + slot * l.in_plane + c * kStressXyCount * l.quantity + j;
      r[i] = in_rate + (3 * slot + c) * kMeanXyCount * l.quantity + j;
    }
    const auto of = [&l](const float* const(&plane)[3], int k) {
      return std::array<const float*, 3>{plane[0] + k * l.quantity, plane[1] + k * l.quantity,
                                         plane[2] + k * l.quantity};
    };
    mean_gradient<W>(of(q, kAA), of(q, kAd), of(q, kdA), c, F);
    mean_gradient<W>(of(r, kMeanAA), of(r, kMeanAd), of(r, kMeandA), c, rate);
  }
  add_identity<W>(F);
  const float* volume = b.volume.data() + static_cast<std::size_t>(z) * 8 * l.stride + j;
  Vec<W> V = load<W>(volume);
  for (int s = 1; s < 8; ++s) V += load<W>(volume + s * l.stride);
  for (int i = 0; i < 9; ++i) P[i] = 0.0f * V;
  add_viscous_stress(F, rate, 0.125f * f.viscosity * V, P);
}

/// Stress of the cells in W lanes, from the incoming x-y quantities to the outgoing ones.
template <int W, class LawOf, bool viscous>
TISSUE_SIM_INLINE void stress_lanes(const Block& b, const BlockField& f, const Layout& l,
                                    const float* in, const float* in_rate, int z, int j,
                                    float* out) {
  Vec<W> G[8][9], damping[9];
  gradients<W>(l, in, z, j, G);
  if (viscous) viscous_stress<W>(b, f, l, in, in_rate, z, j, damping);
  const float* volume = b.volume.data() + static_cast<std::size_t>(z) * 8 * l.stride + j;
  for (int s = 0; s < 8; ++s) {
    const Vec<W> V = load<W>(volume + s * l.stride);
    Vec<W> P[9];
    add_identity<W>(G[s]);
    LawOf::stress(G[s], f.mu * V, f.lambda * V, P);
    for (int i = 0; i < 9; ++i) G[s][i] = viscous ? P[i] + damping[i] : P[i];
  }
  for (int c = 0; c < 3; ++c) {
    float* q = out + kLanes + c * kStressXyCount * l.quantity + j;
    add_divergence<W>(G, c, l.quantity, q + (z % 3) * l.out_plane, q + ((z + 1) % 3) * l.out_plane,
                      q + ((z + 2) % 3) * l.out_plane);
  }
}

template <int W, class LawOf, bool viscous>
TISSUE_SIM_INLINE void forces(const Block& b, const BlockField& f, BlockScratch& scratch,
                              float* force) {
  const Layout l(b);
  const float inv_h = 1.0f / f.cell_size;
  reserve(scratch.nodes, 3 * l.node_component);
  reserve(scratch.in, 3 * l.in_plane);
  reserve(scratch.out, 3 * l.out_plane + kLanes);
  reserve(scratch.row, 3 * l.sum_component);
  gather_nodes(b, f, f.nodes->u, inv_h, l, scratch.nodes.data());
  if (viscous) {
    reserve(scratch.velocities, 3 * l.node_component);
    reserve(scratch.in_rate, 9 * kMeanXyCount * l.quantity);
    gather_nodes(b, f, f.nodes->v, inv_h, l, scratch.velocities.data());
  }
  float* out = scratch.out.data();
  std::fill_n(out, 2 * l.out_plane, 0.0f);  // the third is written before it is added to
  for (int z = 0; z < 2; ++z) {
    load_plane<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
    if (viscous) load_mean_plane<W>(b, l, scratch.velocities.data(), z, scratch.in_rate.data());
  }
  const int lanes = b.runs.back().lane + b.runs.back().count;
  for (int z = 0; z < b.nz + 2; ++z) {
    if (z < b.nz) {
      load_plane<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
      if (viscous) {
        load_mean_plane<W>(b, l, scratch.velocities.data(), z + 2, scratch.in_rate.data());
      }
      for_each_vector<W>(
          lanes, [&](auto width, int j) __attribute__((always_inline)) {
            stress_lanes<width, LawOf, viscous>(b, f, l, scratch.in.data(), scratch.in_rate.data(),
                                                z, j, out);
          });
    }
    store_plane<W>(b, l, out, z, -inv_h, scratch.row.data(), force);
  }
  stabilise_cells<W>(b, f, l, scratch.nodes.data(), force);
}

template <int W>
TISSUE_SIM_INLINE void forces_any(const Block& b, const BlockField& f, BlockScratch& s,
                                  float* out) {
  const bool viscous = f.viscosity > 0;
  if (f.law == Law::kNeoHookean) {
    viscous ? forces<W, NeoHookean, true>(b, f, s, out)
            : forces<W, NeoHookean, false>(b, f, s, out);
  } else {
    viscous ? forces<W, FixedCorotated, true>(b, f, s, out)
            : forces<W, FixedCorotated, false>(b, f, s, out);
  }
}

/// Adds the nodes' reference places to the displacements that gather_nodes() brought.
void add_reference(const Block& b, const BlockField& f, const Layout& l, float* nodes) {
  for (int z = 0; z < b.nz + 2; ++z) {
    for (int y = 0; y < b.ny + 2; ++y) {
      float* row = nodes + z * l.plane + y * l.pitch;
      for (int x = 0; x < l.pitch; ++x) {
        row[x] += f.origin[0] + x * f.cell_size;
        row[x + l.node_component] += f.origin[1] + y * f.cell_size;
        row[x + 2 * l.node_component] += f.origin[2] + z * f.cell_size;
      }
    }
  }
}

template <int W>
TISSUE_SIM_INLINE void positions(const Block& b, const BlockField& f, const Array<float>* u,
                                 BlockScratch& scratch, float* out) {
  const Layout l(b);
  reserve(scratch.nodes, 3 * l.node_component);
  reserve(scratch.in, 3 * l.in_plane);
  gather_nodes(b, f, u, 1.0f, l, scratch.nodes.data());
  add_reference(b, f, l, scratch.nodes.data());
  const float* in = scratch.in.data();
  for (int z = 0; z < 2; ++z) load_plane<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int c = 0; c < 3; ++c) {
      for (int j = 0; j < l.stride; j += W) {
        constexpr XyQuantity kinds[4] = {kAA, kdA, kAd, kdd};
        Vec<W> w[2][4];
        for (int k = 0; k < 4; ++k) {
          const float* q = in + (c * kStressXyCount + kinds[k]) * l.quantity + j;
          const Line<Vec<W>> line(load<W>(q + (z % 3) * l.in_plane),
                                  load<W>(q + ((z + 1) % 3) * l.in_plane),
                                  load<W>(q + ((z + 2) % 3) * l.in_plane));
          w[0][k] = line.A - 0.125f * line.d;
          w[1][k] = line.A + 0.125f * line.d;
        }
        float* to = out + (static_cast<std::size_t>(c) * b.nz + z) * 8 * l.stride + j;
        for (int s = 0; s < 8; ++s) {
          const Vec<W>* v = w[s / 4];
          const float x = s & 1 ? 0.125f : -0.125f, y = s & 2 ? 0.125f : -0.125f;
          store<W>(to + s * l.stride, v[0] + x * v[1] + y * (v[2] + x * v[3]));
        }
      }
    }
  }
}

template <int W, class LawOf>
TISSUE_SIM_INLINE BlockState state(const Block& b, const BlockField& f, BlockScratch& scratch,
                                   float* von_mises) {
  const Layout l(b);
  reserve(scratch.nodes, 3 * l.node_component);
  reserve(scratch.in, 3 * l.in_plane);
  gather_nodes(b, f, f.nodes->u, 1.0f / f.cell_size, l, scratch.nodes.data());
  BlockState result;
  result.elastic_energy = stabilise_cells<W>(b, f, l, scratch.nodes.data(), nullptr);
  for (int z = 0; z < 2; ++z) load_plane<W>(b, l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W>(b, l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int j = 0; j < l.stride; j += W) {
      Vec<W> G[8][9];
      gradients<W>(l, scratch.in.data(), z, j, G);
      const std::size_t lane = static_cast<std::size_t>(z) * 8 * l.stride + j;
      for (int s = 0; s < 8; ++s) {
        const float* volume = b.volume.data() + lane + s * l.stride;
        Vec<W> cof[9], P[9];
        Vec<W> zero = load<W>(volume) * 0.0f;
        add_identity<W>(G[s]);
        cofactor(G[s], cof);
        const Vec<W> J = G[s][0] * cof[0] + G[s][1] * cof[1] + G[s][2] * cof[2];
        const Vec<W> energy = LawOf::energy(G[s], zero + f.mu, zero + f.lambda);
        const Vec<W> cx = cof[0] * cof[0] + cof[3] * cof[3] + cof[6] * cof[6];
        const Vec<W> cy = cof[1] * cof[1] + cof[4] * cof[4] + cof[7] * cof[7];
        const Vec<W> cz = cof[2] * cof[2] + cof[5] * cof[5] + cof[8] * cof[8];
        const Vec<W> f2 = norm2(G[s]);
        LawOf::stress(G[s], zero + f.mu, zero + f.lambda, P);
        const Vec<W> mises2 = von_mises_squared(G[s], P);
        for (int i = 0; i < W; ++i) {
          const float v = volume[i];
          if (v == 0) continue;
          const float stiffening =
              std::max(cx[i], std::max(cy[i], cz[i])) + std::fabs(J[i] - 1) * std::sqrt(f2[i] / 3);
          if (!std::isfinite(energy[i] + stiffening)) result.finite = false;
          result.elastic_energy += static_cast<double>(energy[i]) * v;
          result.stiffening = std::max(result.stiffening, stiffening);
          if (von_mises) von_mises[lane + s * l.stride + i] = std::sqrt(mises2[i]);
        }
      }
    }
  }
  return result;
}

template <int W>
TISSUE_SIM_INLINE BlockState state_any(const Block& b, const BlockField& f, BlockScratch& s,
                                       float* von_mises) {
  return f.law == Law::kNeoHookean ? state<W, NeoHookean>(b, f, s, von_mises)
                                   : state<W, FixedCorotated>(b, f, s, von_mises);
}

template <int W>
TISSUE_SIM_INLINE int lanes_in_box(const float* x, std::size_t count, const float* min,
                                   const float* max, std::int32_t* lanes) {
  int found = 0;
  for (std::size_t j = 0; j < count; j += W) {
    const auto inside = (load<W>(x + j) > min[0]) & (load<W>(x + j) < max[0]) &
                        (load<W>(x + count + j) > min[1]) & (load<W>(x + count + j) < max[1]) &
                        (load<W>(x + 2 * count + j) > min[2]) &
                        (load<W>(x + 2 * count + j) < max[2]);
    bool any = false;
    for (int i = 0; i < W; ++i) any |= inside[i] != 0;
    if (!any) continue;
    for (int i = 0; i < W; ++i) {
      if (inside[i] != 0) lanes[found++] = static_cast<std::int32_t>(j) + i;
    }
  }
  return found;
}

template <int W>
TISSUE_SIM_INLINE void update_row(const NodeRow& row, const RowPart* parts, const float* force,
                                  const UpdateNode& update, BlockScratch& scratch) {
  const int stride = row.count + W;
  reserve(scratch.row, 3 * stride);
  float* sum = scratch.row.data();
  std::fill_n(sum, 3 * stride, 0.0f);
  for (int p = 0; p < row.part_count; ++p) {
    const RowPart& part = parts[p];
    for (int c = 0; c < 3; ++c) {
      const float* from = force + part.force + c * part.component;
      float* to = sum + c * stride + part.begin;
      for (int i = 0; i < part.count; ++i) to[i] += from[i];
    }
  }
  for (int i = 0; i < row.count; ++i) {
    update(row.first_node + i, sum[i], sum[i + stride], sum[i + 2 * stride]);
  }
}

#define TISSUE_SIM_KERNELS(suffix, W, target)                                                     \
  target void forces_##suffix(const Block& b, const BlockField& f, BlockScratch& s, float* out) { \
    forces_any<W>(b, f, s, out);                                                                  \
  }                                                                                               \
  target void positions_##suffix(const Block& b, const BlockField& f, const Array<float>* u,      \
                                 BlockScratch& s, float* out) {                                   \
    positions<W>(b, f, u, s, out);                                                                \
  }                                                                                               \
  target int lanes_in_box_##suffix(const float* x, std::size_t count, const float* min,           \
                                   const float* max, std::int32_t* lanes) {                       \
    return lanes_in_box<W>(x, count, min, max, lanes);                                            \
  }                                                                                               \
  target void update_row_##suffix(const NodeRow& row, const RowPart* parts, const float* force,   \
                                  const UpdateNode& update, BlockScratch& s) {                    \
    update_row<W>(row, parts, force, update, s);                                                  \
  }                                                                                               \
  target BlockState state_##suffix(const Block& b, const BlockField& f, BlockScratch& s,          \
                                   float* von_mises) {                                            \
    return state_any<W>(b, f, s, von_mises);                                                      \
  }

TISSUE_SIM_KERNELS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const BlockKernels& block_kernels(InstructionSet set) {
  static constexpr BlockKernels sse2 = {forces_sse2, positions_sse2, lanes_in_box_sse2,
                                        update_row_sse2, state_sse2};
#if defined(__x86_64__)
  static constexpr BlockKernels avx2 = {forces_avx2, positions_avx2, lanes_in_box_avx2,
                                        update_row_avx2, state_avx2};
  static constexpr BlockKernels avx512 = {forces_avx512, positions_avx512, lanes_in_box_avx512,
                                          update_row_avx512, state_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace tissue_sim
