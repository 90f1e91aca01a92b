#include <algorithm>
#include <cmath>
#include <iterator>

#include "cutting/edge_forces.h"
#include "mpm/contact/touching_tissue.h"
#include "mpm/lattice/bonds.h"
#include "mpm/surface/facet_motion.h"

namespace tissue_sim {
namespace {

Vec3 in_sites(const LatticeBody& body, const Vec3& X) {
  return (X - body.origin) / (0.5 * body.cell_size) - Vec3::Constant(0.5);
}

std::vector<std::int32_t> nodes_of(const Block& block) {
  std::vector<std::int32_t> nodes;
  std::copy_if(block.node.begin(), block.node.end(), std::back_inserter(nodes),
               [](std::int32_t n) { return n >= 0; });
  return nodes;
}

/// The lattice to cutting/edge_forces.h. A hold's site is of the point as which it sees the tissue.
class LatticeEdges {
 public:
  explicit LatticeEdges(TouchingTissue& state) : s_(state) {}

  double cell_size() const { return s_.scene.cell_size; }
  /// Set by how deep finite elements have a blade in before it cuts: docs/cutting.md.
  double spread() const { return 1.4 * cell_size(); }
  template <class F>
  void each(int count, const F& f, int grain) const {
    s_.cpu->for_each(count, f, grain);
  }

  /// The nodes that the point sees.
  void see(const EdgePlace& place, EdgeStencil& stencil) const {
    const LatticeBody& body = s_.bodies[place.body];
    const Points::Site site{
        static_cast<std::int16_t>(place.site[0]), static_cast<std::int16_t>(place.site[1]),
        static_cast<std::int16_t>(place.site[2]), static_cast<std::int16_t>(place.body)};
    const Vec3 middle = body.node_position(site.x >> 1, site.y >> 1, site.z >> 1);
    float in_cell[3], slope[9];
    for (int a = 0; a < 3; ++a) {
      in_cell[a] = static_cast<float>((place.at[a] - middle[a]) / body.cell_size);
    }
    const AxisWeights weights(in_cell);
    slopes_at(in_cell, slope);
    for (float& s : slope) s /= static_cast<float>(body.cell_size);
    for (int k = 0; k < 27; ++k) {
      const int node = s_.fields->node(body, site, k), x = k % 3, y = 3 + k / 3 % 3, z = 6 + k / 9;
      const float *w = weights.of, *s = slope;
      stencil.add(node,
                  EdgeStencil::Weights{w[x] * w[y] * w[z], s[x] * w[y] * w[z], w[x] * s[y] * w[z],
                                       w[x] * w[y] * s[z]},
                  s_.nodes.inv_mass[node]);
    }
    stencil.place = place.reference();
    const Material& material = body.material_of(s_.points, body.point(site.x, site.y, site.z));
    stencil.toughness = material.toughness;
    stencil.young_modulus = material.young_modulus;
    stencil.poisson_ratio = material.poisson_ratio;
  }

  void motion(std::int32_t node, float (&u)[3], float (&v)[3]) const {
    for (int a = 0; a < 3; ++a) {
      u[a] = s_.nodes.u[a][node];
      v[a] = s_.nodes.v[a][node];
    }
  }

  void push(std::int32_t node, float weight, const Vec3& impulse) const {
    const float share = weight * s_.nodes.inv_mass[node];
    for (int a = 0; a < 3; ++a) s_.nodes.v[a][node] += share * static_cast<float>(impulse[a]);
  }

  /// It stays with the same point a little beyond its half cell: between the two faces of a cut it
  /// would change sides.
  bool put(const Vec3& X, EdgePlace& place) const {
    constexpr double kStays = 0.6;  // half cells
    const LatticeBody& body = s_.bodies[place.body];
    const Vec3 at = in_sites(body, X);
    for (int a = 0; a < 3; ++a) {
      place.at[a] = X[a];
      if (std::fabs(at[a] - place.site[a]) <= kStays) continue;
      if (!(std::fabs(at[a]) < 30000)) return false;
      place.site[a] = static_cast<std::int32_t>(std::lround(at[a]));
    }
    return body.point(place.site[0], place.site[1], place.site[2]) >= 0;
  }

  /// Along a line of points, of the four around it, along the axis that is most across the plane:
  /// of bonds none is cut near where the plane crosses it.
  bool is_whole(const EdgePlace& place, const Vec3& X, const Vec3& normal) const {
    constexpr double kNear = 0.3;  // half cells: of a cut between points one bond or the other is
    const LatticeBody& body = s_.bodies[place.body];
    const Vec3 at = in_sites(body, X);
    if (!(at.cwiseAbs().maxCoeff() < 30000)) return false;
    int a = 0;
    normal.cwiseAbs().maxCoeff(&a);
    const int b = (a + 1) % 3, c = (a + 2) % 3;
    for (int line = 0; line < 4; ++line) {
      int site[3];
      site[b] = static_cast<int>(std::floor(at[b])) + (line & 1);
      site[c] = static_cast<int>(std::floor(at[c])) + (line >> 1);
      const double off =
          -(normal[b] * (site[b] - at[b]) + normal[c] * (site[c] - at[c])) / normal[a];
      const double crossing = at[a] + std::max(-1.0, std::min(off, 1.0));
      bool any = false, cut = false;
      for (int k = static_cast<int>(std::floor(crossing - kNear));
           k <= static_cast<int>(std::floor(crossing + kNear)); ++k) {
        site[a] = k;
        const std::int32_t p = body.point(site[0], site[1], site[2]);
        ++site[a];
        if (p < 0 || body.point(site[0], site[1], site[2]) < 0) continue;
        any = true;
        cut = cut || (s_.points.bonds[p] >> (kForwardBond + a) & 1) == 0;
      }
      if (any && !cut) return true;
    }
    return false;
  }

  bool look_near(const Box& box) {
    const float low[3] = {float(box.min[0]), float(box.min[1]), float(box.min[2])};
    const float high[3] = {float(box.max[0]), float(box.max[1]), float(box.max[2])};
    for (std::size_t i = 0; i < s_.blocks.all.size(); ++i) {
      const Box& of_block = s_.motion[i].box;
      if ((of_block.min.array() > box.max.array()).any() ||
          (of_block.max.array() < box.min.array()).any()) {
        continue;
      }
      const Block& block = *s_.blocks.all[i];
      if (s_.edges.distant != nullptr) s_.edges.distant->bring_motion(nodes_of(block));
      BlockScratch& scratch = s_.scratch.local();
      const std::size_t lanes = block.lane_count();
      if (scratch.values.size() < 3 * lanes) scratch.values.resize(3 * lanes);
      if (scratch.lanes.size() < lanes) scratch.lanes.resize(lanes);
      float* x = scratch.values.data();
      s_.kernels->positions(block, block_field(s_, block), s_.nodes.u, scratch, x);
      const int count = s_.kernels->lanes_in_box(x, lanes, low, high, scratch.lanes.data());
      for (int k = 0; k < count; ++k) {
        const std::int32_t lane = scratch.lanes[k], p = block.point[lane];
        if (p < 0) continue;
        near_.push_back({Vec3(x[lane], x[lanes + lane], x[2 * lanes + lane]), p});
        add(near_.back().x, near_box_);
      }
    }
    return !near_.empty();
  }

  /// From the nearest point on, by Newton's method.
  bool find(const Vec3& x, EdgePlace& place) const {
    const Near* nearest = nullptr;
    double least = cell_size() * cell_size();
    if (distance2(near_box_, x) > least) return false;
    for (const Near& n : near_) {
      const double d = (n.x - x).squaredNorm();
      if (d < least) least = d, nearest = &n;
    }
    if (nearest == nullptr) return false;
    const Points::Site& site = s_.points.site[nearest->point];
    const LatticeBody& body = s_.bodies[site.body];
    place.body = site.body;
    place.site[0] = site.x, place.site[1] = site.y, place.site[2] = site.z;
    Vec3 X = body.site_position(site.x, site.y, site.z);
    for (int i = 0; i < 4; ++i) {
      std::copy(X.data(), X.data() + 3, place.at);
      const EdgeSupport at = support_at(*this, place);
      if (!(std::fabs(at.F.determinant()) > 1e-3)) return false;
      X += at.F.inverse() * (x - at.x);
    }
    for (int& s : place.site) s = -1000;  // the nearest point, whatever it was
    return X.allFinite() && put(X, place);
  }

 private:
  struct Near {
    Vec3 x;
    std::int32_t point;
  };
  TouchingTissue& s_;
  std::vector<Near> near_;
  Box near_box_;  // of these
};

}  // namespace

void look_for_edges(TouchingTissue& s, const FrameInput& input, double begin) {
  if (s.edges.pieces.empty()) return;
  LatticeEdges tissue(s);
  look_for_edges(tissue, input, begin, s.edges);
}

std::unique_ptr<EdgePushes> edge_pushes(TouchingTissue& s) {
  if (!s.edges.any_holds()) return nullptr;
  return std::make_unique<PushingEdges<LatticeEdges>>(LatticeEdges(s), s.colliders, s.edges);
}

std::vector<BladePath> held_paths(TouchingTissue& s, const FrameInput& input, double end) {
  return held_paths(LatticeEdges(s), input, end, s.edges);
}

}  // namespace tissue_sim
