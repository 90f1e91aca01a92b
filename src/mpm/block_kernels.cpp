#include "mpm/block_kernels.h"

#include <algorithm>
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
  int in_plane;        ///< x-y quantities of one node plane, all components
  int front;           ///< zeros before each outgoing quantity
  int out_quantity;    ///< floats of one outgoing quantity
  int out_plane;

  explicit Layout(const Block& b)
      : pitch(b.pitch),
        stride(b.stride),
        plane(b.plane),
        node_component((b.nz + 2) * b.plane + 2 * kLanes),
        in_plane(3 * kXyCount * b.stride),
        front((2 * b.pitch + kLanes - 1) / kLanes * kLanes),
        out_quantity(front + b.plane),
        out_plane(3 * kXyCount * out_quantity) {}
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
        for (int x = 0; x < l.pitch; ++x) out_row[x] = row[x] * scale;
      }
    }
    for (const Block::SplitNode& s : b.split_nodes) to[s.local] = field[c][s.node] * scale;
  }
}

/// The x-y quantities of node plane z, all components, into slot z % 3 of `in`.
template <int W, bool bend_bend = false>
TISSUE_SIM_INLINE void load_plane(const Layout& l, const float* nodes, int z, float* in) {
  for (int c = 0; c < 3; ++c) {
    xy_pass<W, bend_bend>(nodes + c * l.node_component + z * l.plane, l.pitch, l.stride,
                          in + (z % 3) * l.in_plane + c * kXyCount * l.stride);
  }
}

template <int W>
TISSUE_SIM_INLINE void gradients(const Layout& l, const float* in, int z, int j, Vec<W> (*G)[9]) {
  for (int c = 0; c < 3; ++c) {
    const float* q = in + c * kXyCount * l.stride + j;
    gradient<W>(q + (z % 3) * l.in_plane, q + ((z + 1) % 3) * l.in_plane,
                q + ((z + 2) % 3) * l.in_plane, l.stride, c, G);
  }
}

template <int W>
TISSUE_SIM_INLINE void add_identity(Vec<W>* F) {
  for (int i = 0; i < 9; i += 4) F[i] = F[i] + 1.0f;
}

template <int W>
TISSUE_SIM_INLINE bool any_nonzero(const float* p) {
  bool any = false;
  for (int i = 0; i < W; ++i) any |= p[i] != 0;
  return any;
}

template <int W, class LawOf, bool viscous, bool partial>
TISSUE_SIM_INLINE void forces(const Block& b, const BlockField& f, BlockScratch& scratch,
                              float* force) {
  const Layout l(b);
  const float inv_h = 1.0f / f.cell_size;
  reserve(scratch.nodes, 3 * l.node_component);
  reserve(scratch.in, 3 * l.in_plane);
  reserve(scratch.out, 3 * l.out_plane);
  reserve(scratch.row, 3 * (l.plane + kLanes) + kLanes);
  gather_nodes(b, f, f.nodes->u, inv_h, l, scratch.nodes.data());
  if (viscous) {
    reserve(scratch.velocities, 3 * l.node_component);
    reserve(scratch.in_rate, 3 * l.in_plane);
    gather_nodes(b, f, f.nodes->v, inv_h, l, scratch.velocities.data());
  }
  float* out = scratch.out.data();
  std::fill_n(out, 3 * l.out_plane, 0.0f);
  std::fill_n(scratch.row.data(), 3 * (l.plane + kLanes) + kLanes, 0.0f);
  for (int z = 0; z < 2; ++z) {
    load_plane<W, partial>(l, scratch.nodes.data(), z, scratch.in.data());
    if (viscous) load_plane<W>(l, scratch.velocities.data(), z, scratch.in_rate.data());
  }
  for (int z = 0; z < b.nz + 2; ++z) {
    if (z < b.nz) {
      load_plane<W, partial>(l, scratch.nodes.data(), z + 2, scratch.in.data());
      for (int c = 0; partial && c < 3; ++c) {  // the stress does not write it
        std::fill_n(out + ((z + 2) % 3) * l.out_plane + (c * kXyCount + kBB) * l.out_quantity,
                    l.out_quantity, 0.0f);
      }
      if (viscous) load_plane<W>(l, scratch.velocities.data(), z + 2, scratch.in_rate.data());
      for (int j = 0; j < l.stride; j += W) {
        Vec<W> G[8][9], rate[8][9];
        gradients<W>(l, scratch.in.data(), z, j, G);
        if (viscous) gradients<W>(l, scratch.in_rate.data(), z, j, rate);
        const float* volume = b.volume.data() + static_cast<std::size_t>(z) * 8 * l.stride + j;
        for (int s = 0; s < 8; ++s) {
          const Vec<W> V = load<W>(volume + s * l.stride);
          Vec<W> P[9];
          add_identity<W>(G[s]);
          LawOf::stress(G[s], f.mu * V, f.lambda * V, P);
          if (viscous) add_viscous_stress(G[s], rate[s], f.viscosity * V, P);
          for (int i = 0; i < 9; ++i) G[s][i] = P[i];
        }
        const float* cell = partial ? b.partial.data() + z * l.stride + j : nullptr;
        const bool stabilised = partial && any_nonzero<W>(cell);
        for (int c = 0; c < 3; ++c) {
          float* q = out + l.front + c * kXyCount * l.out_quantity + j;
          float *q0 = q + (z % 3) * l.out_plane, *q1 = q + ((z + 1) % 3) * l.out_plane,
                *q2 = q + ((z + 2) % 3) * l.out_plane;
          add_divergence<W>(G, c, l.out_quantity, q0, q1, q2);
          if (stabilised) {
            const float* in = scratch.in.data() + c * kXyCount * l.stride + j;
            stabilise<W>(in + (z % 3) * l.in_plane, in + ((z + 1) % 3) * l.in_plane,
                         in + ((z + 2) % 3) * l.in_plane, l.stride,
                         kStabilisation * f.mu * load<W>(cell), l.out_quantity, q0, q1, q2);
          }
        }
      }
    }
    for (int c = 0; c < 3; ++c) {
      xy_transpose<W, partial>(
          out + l.front + (z % 3) * l.out_plane + c * kXyCount * l.out_quantity, l.out_quantity,
          l.pitch, l.plane, -inv_h, scratch.row.data(), l.plane + kLanes,
          force + (c * (b.nz + 2) + z) * l.plane);
    }
  }
}

template <int W, class LawOf, bool viscous>
TISSUE_SIM_INLINE void forces_of(const Block& b, const BlockField& f, BlockScratch& s, float* out) {
  b.partial.empty() ? forces<W, LawOf, viscous, false>(b, f, s, out)
                    : forces<W, LawOf, viscous, true>(b, f, s, out);
}

template <int W>
TISSUE_SIM_INLINE void forces_any(const Block& b, const BlockField& f, BlockScratch& s,
                                  float* out) {
  const bool viscous = f.viscosity > 0;
  if (f.law == Law::kNeoHookean) {
    viscous ? forces_of<W, NeoHookean, true>(b, f, s, out)
            : forces_of<W, NeoHookean, false>(b, f, s, out);
  } else {
    viscous ? forces_of<W, FixedCorotated, true>(b, f, s, out)
            : forces_of<W, FixedCorotated, false>(b, f, s, out);
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
  for (int z = 0; z < 2; ++z) load_plane<W>(l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W>(l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int c = 0; c < 3; ++c) {
      for (int j = 0; j < l.stride; j += W) {
        constexpr XyQuantity kinds[4] = {kAA, kdA, kAd, kdd};
        Vec<W> w[2][4];
        for (int k = 0; k < 4; ++k) {
          const float* q = in + (c * kXyCount + kinds[k]) * l.stride + j;
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
  for (int z = 0; z < 2; ++z) load_plane<W, true>(l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W, true>(l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int j = 0; j < l.stride; j += W) {
      Vec<W> G[8][9];
      gradients<W>(l, scratch.in.data(), z, j, G);
      for (int c = 0; !b.partial.empty() && c < 3; ++c) {
        const float* in = scratch.in.data() + c * kXyCount * l.stride + j;
        const Vec<W> stiffness =
            kStabilisation * f.mu * load<W>(b.partial.data() + z * l.stride + j);
        const Vec<W> energy = stabilise<W>(
            in + (z % 3) * l.in_plane, in + ((z + 1) % 3) * l.in_plane,
            in + ((z + 2) % 3) * l.in_plane, l.stride, stiffness, 0, nullptr, nullptr, nullptr);
        for (int i = 0; i < W; ++i) {
          if (stiffness[i] != 0) result.elastic_energy += 0.5 * static_cast<double>(energy[i]);
        }
      }
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

/// The largest eigenvalue of C reaches s^2 where s^2 I - C is not positive definite: by its leading
/// minors (Sylvester), 20 operations a point and no eigenvalue.
template <int W>
TISSUE_SIM_INLINE void stretched(const Block& b, const BlockField& f, float stretch,
                                 BlockScratch& scratch, std::vector<StretchedPoint>& found) {
  const Layout l(b);
  reserve(scratch.nodes, 3 * l.node_component);
  reserve(scratch.in, 3 * l.in_plane);
  gather_nodes(b, f, f.nodes->u, 1.0f / f.cell_size, l, scratch.nodes.data());
  const float s2 = stretch * stretch;
  for (int z = 0; z < 2; ++z) load_plane<W>(l, scratch.nodes.data(), z, scratch.in.data());
  for (int z = 0; z < b.nz; ++z) {
    load_plane<W>(l, scratch.nodes.data(), z + 2, scratch.in.data());
    for (int j = 0; j < l.stride; j += W) {
      Vec<W> G[8][9];
      gradients<W>(l, scratch.in.data(), z, j, G);
      for (int s = 0; s < 8; ++s) {
        Vec<W> C[6];
        add_identity<W>(G[s]);
        right_cauchy_green(G[s], C);
        const Vec<W> x = s2 - C[0], y = s2 - C[1], w = s2 - C[2];
        const Vec<W> minor = x * y - C[3] * C[3];
        const Vec<W> det =
            w * minor - x * C[5] * C[5] - y * C[4] * C[4] - 2.0f * C[3] * C[4] * C[5];
        const auto below = (x > 0.0f) & (minor > 0.0f) & (det > 0.0f);
        bool all = true;
        for (int i = 0; i < W; ++i) all &= below[i] != 0;
        if (all) continue;
        const std::int32_t* point =
            b.point.data() + (static_cast<std::size_t>(z) * 8 + s) * l.stride + j;
        for (int i = 0; i < W; ++i) {
          if (below[i] != 0 || point[i] < 0) continue;
          found.push_back({point[i], {C[0][i], C[1][i], C[2][i], C[3][i], C[4][i], C[5][i]}});
        }
      }
    }
  }
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
  }                                                                                               \
  target void stretched_##suffix(const Block& b, const BlockField& f, float stretch,              \
                                 BlockScratch& s, std::vector<StretchedPoint>& found) {           \
    stretched<W>(b, f, stretch, s, found);                                                        \
  }

TISSUE_SIM_KERNELS(sse2, 4, )
#if defined(__x86_64__)
TISSUE_SIM_KERNELS(avx2, 8, TISSUE_SIM_TARGET_AVX2)
TISSUE_SIM_KERNELS(avx512, 16, TISSUE_SIM_TARGET_AVX512)
#endif

}  // namespace

const BlockKernels& block_kernels(InstructionSet set) {
  static constexpr BlockKernels sse2 = {forces_sse2,     positions_sse2, lanes_in_box_sse2,
                                        update_row_sse2, state_sse2,     stretched_sse2};
#if defined(__x86_64__)
  static constexpr BlockKernels avx2 = {forces_avx2,     positions_avx2, lanes_in_box_avx2,
                                        update_row_avx2, state_avx2,     stretched_avx2};
  static constexpr BlockKernels avx512 = {forces_avx512,     positions_avx512, lanes_in_box_avx512,
                                          update_row_avx512, state_avx512,     stretched_avx512};
  if (set == InstructionSet::kAvx512) return avx512;
  if (set == InstructionSet::kAvx2) return avx2;
#endif
  (void)set;
  return sse2;
}

}  // namespace tissue_sim
