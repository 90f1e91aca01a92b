#include "mls/anchors.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissue_sim {
namespace {

constexpr double kNearest = 0.25;    // that a free node may be to a face [spacings]
constexpr double kFarthest = 0.75;   // that a held node is moved to it [spacings]
constexpr double kMostWeight = 16;   // of a pair across a face, over what it was
constexpr double kFirst = 1.3;       // a node nearer to a face is the first [spacings]
constexpr int kSamplesOfShare = 16;  // along each axis, of a share that a face may cut

using Anchors = std::vector<Anchor>;

bool is_within(const Anchors& anchors, const Vec3& x) {
  return std::any_of(anchors.begin(), anchors.end(),
                     [&](const Anchor& a) { return a.contains(x); });
}

/// Where a place within a region meets, straight ahead, the face that the way to one outside leaves
/// it by.
Vec3 face_towards(const Region& region, const Vec3& x, const Vec3& outside) {
  if (region.kind != Region::Kind::kBox) {
    const bool ball = region.kind == Region::Kind::kBall;
    return ball && x == region.center ? nearest_of(region, outside) : nearest_of(region, x);
  }
  Vec3 face = x;
  double first = 2;
  for (int a = 0; a < 3; ++a) {
    const double bound = outside[a] > region.max[a] ? region.max[a] : region.min[a];
    if (outside[a] >= region.min[a] && outside[a] <= region.max[a]) continue;
    const double t = (bound - x[a]) / (outside[a] - x[a]);
    if (t >= first) continue;
    first = t;
    face = x;
    face[a] = bound;
  }
  return face;
}

/// How much of a cube lies outside of all anchors.
double free_share(const Anchors& anchors, const Vec3& middle, double edge) {
  const auto at = [&](int n, int x, int y, int z) {
    return Vec3(middle + edge * (Vec3(x + 0.5, y + 0.5, z + 0.5) / n - Vec3::Constant(0.5)));
  };
  const auto share = [&](int n) {
    int outside = 0;
    for (int k = 0; k < n * n * n; ++k) {
      outside += is_within(anchors, at(n, k % n, k / n % n, k / n / n)) ? 0 : 1;
    }
    return static_cast<double>(outside) / (n * n * n);
  };
  const double rough = share(4);
  return rough == 0 || rough == 1 ? rough : share(kSamplesOfShare);
}

}  // namespace

Vec3 nearest_of(const Region& region, const Vec3& x) {
  switch (region.kind) {
    case Region::Kind::kBox:
      return x.cwiseMax(region.min).cwiseMin(region.max);
    case Region::Kind::kBall:
      return region.center + region.radius * (x - region.center).normalized();
    case Region::Kind::kBelow:
      break;
  }
  return Vec3(x[0], x[1], region.z);
}

std::vector<MlsAnchorPose> mls_anchors_at(const Scene& scene, const FrameInput& input,
                                          double share) {
  std::vector<MlsAnchorPose> poses;
  if (input.anchors.empty()) return poses;
  for (const Body& body : scene.bodies) {
    for (const Anchor& anchor : body.anchors) {
      const AnchorMotion& m = input.anchors[poses.size()];
      const Quat turned =
          share >= 1 ? m.end.orientation : m.begin.orientation.slerp(share, m.end.orientation);
      const Vec3 place = share >= 1 ? m.end.position
                                    : Vec3((1 - share) * m.begin.position + share * m.end.position);
      const Eigen::Matrix3d turn = turned.toRotationMatrix();
      const Vec3 shift = place - turn * anchor.origin();
      MlsAnchorPose pose;
      for (int a = 0; a < 3; ++a) {
        for (int b = 0; b < 3; ++b) {
          pose.turn[3 * a + b] = static_cast<float>(turn(a, b) - (a == b ? 1 : 0));
        }
        pose.shift[a] = static_cast<float>(shift[a]);
      }
      poses.push_back(pose);
    }
  }
  return poses;
}

std::vector<Wrench> mls_anchor_loads(const Scene& scene, const FrameInput& input,
                                     const MlsNodes& nodes, const float* u, const float* impulse,
                                     double duration) {
  std::vector<Vec3> origins;
  for (const Body& body : scene.bodies) {
    for (const Anchor& anchor : body.anchors) {
      const std::size_t number = origins.size();
      origins.push_back(input.anchors.empty() ? anchor.origin()
                                              : input.anchors[number].end.position);
    }
  }
  std::vector<Wrench> loads(origins.size());
  if (!(duration > 0)) return loads;
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    const int anchor = nodes.anchor[i];
    if (anchor < 0) continue;
    const float *J = impulse + 4 * static_cast<std::size_t>(i),
                *moved = u + 4 * static_cast<std::size_t>(i);
    const Vec3 force = Vec3(J[0], J[1], J[2]) / duration;
    const Vec3 arm = nodes.place[i] + Vec3(moved[0], moved[1], moved[2]) - origins[anchor];
    loads[anchor].force += force;
    loads[anchor].torque += arm.cross(force);
  }
  return loads;
}

void hold_at_faces(const Scene& scene, double support_factor, MlsNodes& nodes, MlsPairs& pairs) {
  nodes.free_volume = nodes.volume;
  std::vector<std::size_t> first_anchor(1, 0);  // by body
  for (const Body& body : scene.bodies) {
    first_anchor.push_back(first_anchor.back() + body.anchors.size());
  }
  std::vector<Vec3> moved = nodes.place;
  const Array<std::uint8_t> within = nodes.anchored;
  const auto each_neighbour = [&](std::int32_t i, const auto& f) {
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) f(pairs.other[e]);
  };
  const auto spacing = [&](std::int32_t i) { return pairs.support[i] / support_factor; };
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    const Anchors& anchors = scene.bodies[nodes.body[i]].anchors;
    if (anchors.empty()) continue;
    nodes.free_volume[i] *= static_cast<float>(
        free_share(anchors, nodes.place[i], std::cbrt(static_cast<double>(nodes.volume[i]))));
    if (within[i] != 0) continue;
    bool beside = false;
    each_neighbour(i, [&](std::int32_t j) { beside = beside || within[j] != 0; });
    double nearest = kNearest * spacing(i);
    for (std::size_t k = 0; k < anchors.size(); ++k) {
      const Vec3 face = nearest_of(anchors[k], nodes.place[i]);
      const double distance = (face - nodes.place[i]).norm();
      if (!beside || distance >= nearest) continue;
      nearest = distance;
      moved[i] = face;
      nodes.anchored[i] = 1;
      nodes.anchor[i] = static_cast<std::int16_t>(first_anchor[nodes.body[i]] + k);
    }
  }
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    if (within[i] == 0) continue;
    const Anchors& own = scene.bodies[nodes.body[i]].anchors;
    if (!is_within(own, nodes.place[i])) {  // of an anchor at the body's own face
      moved[i] = nearest_of(own[nodes.anchor[i] - first_anchor[nodes.body[i]]], nodes.place[i]);
      continue;
    }
    double nearest = kFarthest * spacing(i);
    for (const Anchor& a : own) {
      if (!a.contains(nodes.place[i])) continue;
      each_neighbour(i, [&](std::int32_t j) {
        if (nodes.anchored[j] != 0 || a.contains(nodes.place[j])) return;
        const Vec3 face = face_towards(a, nodes.place[i], nodes.place[j]);
        const double distance = (face - nodes.place[i]).norm();
        if (distance >= nearest) return;
        nearest = distance;
        moved[i] = face;
      });
    }
  }
  // For a bar of nodes h apart, the first of them d h from the face and with a share v h outside of
  // it, uniform stress leaves it in balance where w r^2 across the face is a = (2 v + 1) d / (d +
  // 1) of what it is elsewhere: of M_1 = (1 + a) w h^2, N_0 + N_1 = (d + 1/2) h / M_1 and w_01 d =
  // a w / d. A lattice is such a bar in each direction across a face.
  for (std::int32_t i = 0; i < nodes.count(); ++i) {
    if (nodes.anchored[i] != 0) continue;
    for (std::int32_t e = pairs.begin[i]; e < pairs.begin[i + 1]; ++e) {
      const std::int32_t j = pairs.other[e];
      const Vec3 by = moved[j] - nodes.place[j];
      const double before = by.dot(nodes.place[i] - nodes.place[j]);
      const double now = by.dot(nodes.place[i] - moved[j]);
      if (!(before * now > 0)) continue;
      const double d = std::fabs(now) / (by.norm() * spacing(i));
      const double v = nodes.volume[i] > 0 ? nodes.free_volume[i] / nodes.volume[i] : 1;
      const double a = d < kFirst ? (2 * v + 1) * d / (d + 1) : 1;
      pairs.whole[e] *= static_cast<float>(std::min(kMostWeight, a * std::pow(before / now, 2)));
      pairs.whole[pairs.twin[e]] = pairs.whole[e];
    }
  }
  pairs.weight = pairs.whole;
  nodes.place = std::move(moved);
}

}  // namespace tissue_sim
