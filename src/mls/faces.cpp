#include "mls/faces.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

constexpr double kOneSided = 0.1;     // of neighbours all on one side of a plane some 0.4
constexpr double kFits = 0.5;         // share of a plane in where cuts pass; 1 of a flat cut
constexpr double kMostMagnified = 4;  // of forces; at flat faces 1 to 2, at corners some 4

Vec3 way_to(const MlsState& s, std::int32_t i, std::int32_t e) {
  return s.nodes.place[s.pairs.other[e]] - s.nodes.place[i];
}

/// Outward at the surface of the whole body, 0 where there is no direction. Given nodes lie at the
/// surface itself and know none: away from their neighbours.
Vec3 surface_normal(const MlsState& s, std::int32_t i) {
  if (!s.nodes.normal[i].isZero()) return s.nodes.normal[i];
  Vec3 sum = Vec3::Zero();
  double lengths = 0;
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const Vec3 r = way_to(s, i, e);
    sum -= s.pairs.whole[e] * r;
    lengths += s.pairs.whole[e] * r.norm();
  }
  if (!(sum.norm() > kOneSided * lengths)) return Vec3::Zero();
  return sum.normalized();
}

/// Plane n . (x - X_i) = depth that fits where cuts pass the node's pairs; untouched where none
/// does.
void fit_cut(const MlsState& s, std::int32_t i, Vec3& normal, double& depth) {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Vec3 sum = Vec3::Zero();
  int count = 0;
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    if (s.pairs.crossed[e] == 0) continue;
    const Vec3 q = crossing_place(s.pairs.crossed[e]) * way_to(s, i, e);
    squares += q * q.transpose();
    sum += q;
    ++count;
  }
  const double size = squares.trace();
  if (!(size > 0)) return;
  squares.diagonal().array() += 1e-5 * size;
  const Vec3 m = squares.inverse() * sum;  // least sum of (m . q - 1)^2
  if (!(m.dot(sum) > kFits * count)) return;
  depth = 1 / m.norm();
  normal = depth * m;
}

}  // namespace

void remake_face(MlsState& s, std::int32_t i) {
  Vec3 normal = s.nodes.surface[i] != 0 ? surface_normal(s, i) : Vec3::Zero();
  double depth = s.nodes.depth[i];
  if (s.cut[i] != 0) {
    normal = Vec3::Zero();
    fit_cut(s, i, normal, depth);
  }
  const double edge = s.edge[i];
  for (int a = 0; a < 3; ++a) s.face[4 * i + a] = static_cast<float>(normal[a]);
  s.face[4 * i + 3] = static_cast<float>(std::max(0.0, std::min(edge, depth)));
}

MlsKnowsFace knows_face(const MlsState& s, std::int32_t i) {
  if (s.sprung[i] != 0) return kMlsKnowsNothing;
  Eigen::Matrix3d inverse;
  const auto m = [&](int k) { return static_cast<double>(s.inverse_moment[k][i]); };
  inverse << m(0), m(3), m(4), m(3), m(1), m(5), m(4), m(5), m(2);
  double sum = 0;
  Vec3 own = Vec3::Zero();
  for (std::int32_t e = s.pairs.begin[i]; e < s.pairs.begin[i + 1]; ++e) {
    const Vec3 share = s.pairs.weight[e] * (inverse * way_to(s, i, e));
    sum += share.squaredNorm();
    own += share;
  }
  const double edge = s.edge[i];
  return (sum + own.squaredNorm()) * edge * edge < kMostMagnified ? kMlsBearsCouples
                                                                  : kMlsKnowsNormal;
}

}  // namespace tissue_sim
