#include "mls/cutting_edges.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "cutting/edge_forces.h"

namespace tissue_sim {
namespace {

/// The nodes to cutting/edge_forces.h. A hold's site is the node as which it sees the tissue:
/// moving least squares of that and of its neighbours, up to linear ones, so that forces keep
/// linear and angular momentum.
class NodeEdges {
 public:
  /// `looks`: is_whole() looks at pairs, which holds for a frame.
  NodeEdges(MlsState& state, bool looks) : s_(state), looks_(looks) {}

  double cell_size() const { return mls_spacing(s_.scene); }
  /// Set by how deep finite elements have a blade in before it cuts: docs/cutting.md.
  double spread() const { return 2.75 * cell_size(); }
  template <class F>
  void each(int count, const F& f, int grain) const {
    s_.cpu->for_each(count, f, grain);
  }

  void see(const EdgePlace& place, EdgeStencil& stencil) const {
    const std::int32_t i = place.site[0];
    const Vec3 X = place.reference();
    stencil.place = X;
    const Material& material = s_.nodes.material_of(i);
    stencil.toughness = material.toughness;
    stencil.young_modulus = material.young_modulus;
    stencil.poisson_ratio = material.poisson_ratio;
    const double reach2 = s_.pairs.support[i] * s_.pairs.support[i], edge = s_.edge[i];
    struct Near {
      std::int32_t node;
      Eigen::Vector4d weighed;
    };
    std::vector<Near> near;
    Eigen::Matrix4d moment = Eigen::Matrix4d::Zero();
    const auto add = [&](std::int32_t j) {
      const Vec3 r = s_.nodes.place[j] - X;
      const double left = 1 - r.squaredNorm() / reach2;
      if (!(left > 0)) return;
      const Eigen::Vector4d basis(1, r[0] / edge, r[1] / edge, r[2] / edge);
      near.push_back({j, left * left * left * basis});
      moment += near.back().weighed * basis.transpose();
    };
    add(i);
    for (std::int32_t e = s_.pairs.begin[i]; e < s_.pairs.begin[i + 1]; ++e) {
      if (s_.pairs.crossed[e] == 0) add(s_.pairs.other[e]);
    }
    const Eigen::LDLT<Eigen::Matrix4d> solver(moment);
    constexpr double kFlat = 1e-4;
    const bool spans =
        near.size() > 3 && solver.vectorD().minCoeff() > kFlat * solver.vectorD().maxCoeff();
    if (!spans) {
      stencil.add(i, EdgeStencil::Weights{1, 0, 0, 0}, s_.inv_mass[i]);
      return;
    }
    Eigen::Matrix4d inverse = solver.solve(Eigen::Matrix4d::Identity());
    inverse.bottomRows<3>() /= edge;
    for (const Near& n : near) {
      const Eigen::Vector4f c = (inverse * n.weighed).cast<float>();
      stencil.add(n.node, EdgeStencil::Weights{c[0], c[1], c[2], c[3]}, s_.inv_mass[n.node]);
    }
  }

  void motion(std::int32_t node, float (&u)[3], float (&v)[3]) const {
    for (int a = 0; a < 3; ++a) {
      u[a] = s_.u[4 * node + a];
      v[a] = s_.v[4 * node + a];
    }
  }

  void push(std::int32_t node, float weight, const Vec3& impulse) const {
    for (int a = 0; a < 3; ++a) {
      s_.v[4 * node + a] += static_cast<float>(weight * s_.inv_mass[node] * impulse[a]);
    }
  }

  /// It stays with the same node where another is hardly nearer: between the two faces of a cut it
  /// would change sides.
  bool put(const Vec3& X, EdgePlace& place) const {
    constexpr double kNearer = 0.8;  // squared
    for (bool moved = true; moved;) {
      moved = false;
      const std::int32_t i = place.site[0];
      double least = kNearer * (s_.nodes.place[i] - X).squaredNorm();
      for (std::int32_t e = s_.pairs.begin[i]; e < s_.pairs.begin[i + 1]; ++e) {
        const std::int32_t j = s_.pairs.other[e];
        const double d = (s_.nodes.place[j] - X).squaredNorm();
        if (d < least) least = d, place.site[0] = j, moved = true;
      }
    }
    std::copy(X.data(), X.data() + 3, place.at);
    const auto beside = [&](std::int32_t node) {
      return (X - s_.nodes.place[node]).cwiseAbs().maxCoeff() / s_.edge[node];
    };
    // Shares of nodes are cubes; between graded ones there is no gap.
    const std::int32_t i = place.site[0];
    if (beside(i) <= (s_.nodes.surface[i] != 0 ? 0.5 : 1.5)) return true;
    for (std::int32_t e = s_.pairs.begin[i]; e < s_.pairs.begin[i + 1]; ++e) {
      if (beside(s_.pairs.other[e]) <= 0.5) return true;
    }
    return false;
  }

  /// Of pairs near it.
  bool is_whole(const EdgePlace& place, const Vec3& X, const Vec3& normal) const {
    if (!looks_) return true;
    constexpr double kNear = 0.6;  // spacings: at a side of the body pairs are half of one away
    const std::int32_t i = place.site[0];
    const double near2 = kNear * kNear * s_.edge[i] * s_.edge[i];
    const auto any_whole = [&](std::int32_t k) {
      const Vec3 a = s_.nodes.place[k] - X;
      const double above = a.dot(normal);
      for (std::int32_t e = s_.pairs.begin[k]; e < s_.pairs.begin[k + 1]; ++e) {
        const Vec3 b = s_.nodes.place[s_.pairs.other[e]] - X;
        const double under = b.dot(normal);
        if (s_.pairs.crossed[e] != 0 || (above < 0) == (under < 0)) continue;
        if ((a + above / (above - under) * (b - a)).squaredNorm() < near2) return true;
      }
      return false;
    };
    if (any_whole(i)) return true;
    for (std::int32_t e = s_.pairs.begin[i]; e < s_.pairs.begin[i + 1]; ++e) {
      if (any_whole(s_.pairs.other[e])) return true;
    }
    return false;
  }

  bool look_near(const Box& box) {
    for (std::int32_t i = 0; i < s_.count(); ++i) {
      const Vec3 x = s_.position(i);
      if ((x.array() < box.min.array()).any() || (x.array() > box.max.array()).any()) continue;
      near_.push_back(i);
      add(x, near_box_);
    }
    return !near_.empty();
  }

  /// From the nearest node on, by Newton's method.
  bool find(const Vec3& x, EdgePlace& place) const {
    double least = cell_size() * cell_size();
    if (distance2(near_box_, x) > least) return false;
    for (const std::int32_t i : near_) {
      const double d = (s_.position(i) - x).squaredNorm();
      if (d < least) least = d, place.site[0] = i, place.body = s_.nodes.body[i];
    }
    if (place.body < 0) return false;
    Vec3 X = s_.nodes.place[place.site[0]];
    for (int k = 0; k < 4; ++k) {
      std::copy(X.data(), X.data() + 3, place.at);
      const EdgeSupport at = support_at(*this, place);
      if (!(std::fabs(at.F.determinant()) > 1e-3)) return false;
      X += at.F.inverse() * (x - at.x);
    }
    return X.allFinite() && put(X, place);
  }

 private:
  MlsState& s_;
  bool looks_;
  std::vector<std::int32_t> near_;
  Box near_box_;  // of these
};

}  // namespace

void look_for_edges(MlsState& s, const FrameInput& input, double begin) {
  if (s.edges.pieces.empty()) return;
  NodeEdges tissue(s, true);
  look_for_edges(tissue, input, begin, s.edges);
}

std::unique_ptr<EdgePushes> edge_pushes(MlsState& s) {
  if (!s.edges.any_holds()) return nullptr;
  return std::make_unique<PushingEdges<NodeEdges>>(NodeEdges(s, false), s.colliders, s.edges);
}

std::vector<BladePath> held_paths(MlsState& s, const FrameInput& input, double end) {
  return held_paths(NodeEdges(s, false), input, end, s.edges);
}

}  // namespace tissue_sim
