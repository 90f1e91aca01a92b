#include "geometry/nearest_surface.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <unordered_map>

#include "geometry/on_triangle.h"

namespace tissue_sim {
namespace {

constexpr double kTie = 1e-6;  // of the distance to a face, against its direction [m]

/// A flat face of a shape at coordinate `at` of an axis, on the side `sign`, as seen from p.
struct Face {
  int axis;
  double sign, distance;
};

SurfacePoint on_box(const Vec3& p, const Vec3& half, const Vec3& towards) {
  const Vec3 inside = p.cwiseMax(-half).cwiseMin(half);
  const Vec3 off = p - inside;
  if (off.norm() > 1e-9 * half.norm()) {
    // Outside: the nearest place; its normal is that of the face, or between those of an edge.
    return {inside, off.normalized()};
  }
  Face best{0, 1, 1e30};
  double least = 1e30;
  for (int a = 0; a < 3; ++a) {
    for (const double sign : {-1.0, 1.0}) {
      const double distance = half[a] - sign * p[a];
      const double counts = distance - kTie * sign * towards[a];
      if (counts < least) least = counts, best = {a, sign, distance};
    }
  }
  SurfacePoint s{p, Vec3::Zero()};
  s.place[best.axis] = best.sign * half[best.axis];
  s.normal[best.axis] = best.sign;
  return s;
}

SurfacePoint on_cylinder(const Vec3& p, double radius, double half, const Vec3& towards) {
  const double r = p.head<2>().norm();
  const Vec3 out = r > 0 ? Vec3(p.x() / r, p.y() / r, 0) : Vec3::UnitX();
  const Vec3 inside(out.x() * std::min(r, radius), out.y() * std::min(r, radius),
                    std::clamp(p.z(), -half, half));
  const Vec3 off = p - inside;
  if (off.norm() > 1e-9 * radius) return {inside, off.normalized()};
  const double up = p.z() < 0 ? -1 : 1;
  const double to_side = radius - r - kTie * out.dot(towards);
  const double to_end = half - std::abs(p.z()) - kTie * up * towards.z();
  if (to_side < to_end) return {Vec3(out.x() * radius, out.y() * radius, p.z()), out};
  return {Vec3(p.x(), p.y(), up * half), Vec3(0, 0, up)};
}

/// Nearest place p = r^2 x / (t + r^2) on an ellipsoid (Eberly, Distance from a point to an
/// ellipsoid): t by bisection.
SurfacePoint on_ellipsoid(const Vec3& x, const Vec3& radii) {
  const Vec3 r2 = radii.cwiseAbs2();
  const auto at = [&](double t) -> Vec3 {
    return r2.cwiseProduct(x).cwiseQuotient((r2.array() + t).matrix());
  };
  double low = -r2.minCoeff() * (1 - 1e-9), high = x.norm() * radii.maxCoeff();
  for (int i = 0; i < 80; ++i) {
    const double t = 0.5 * (low + high);
    (at(t).cwiseQuotient(radii).squaredNorm() > 1 ? low : high) = t;
  }
  Vec3 p = at(0.5 * (low + high));
  p /= p.cwiseQuotient(radii).norm();
  return {p, p.cwiseQuotient(r2).normalized()};
}

}  // namespace

Vec3 on_triangle(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  Vec3 place;
  on_triangle(p.data(), a.data(), b.data(), c.data(), place.data());
  return place;
}

/// The triangles of a mesh in a hash grid as wide as the reach.
class NearestSurface::Triangles {
 public:
  Triangles(TriangleMesh mesh, double reach) : mesh_(std::move(mesh)), reach_(reach) {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      Box box;
      for (const int v : mesh_.triangles[t]) {
        box.min = box.min.cwiseMin(mesh_.vertices[v]);
        box.max = box.max.cwiseMax(mesh_.vertices[v]);
      }
      for_each_cell(box.min, box.max,
                    [&](std::uint64_t key) { cells_[key].push_back(static_cast<int>(t)); });
    }
  }

  bool find(const Vec3& x, SurfacePoint& found) const {
    double least = reach_ * reach_;
    Vec3 normal = Vec3::Zero();
    bool any = false;
    const Vec3 around = Vec3::Constant(reach_);
    for_each_cell(x - around, x + around, [&](std::uint64_t key) {
      const auto cell = cells_.find(key);
      if (cell == cells_.end()) return;
      for (const int t : cell->second) {
        const auto& of = mesh_.triangles[t];
        const Vec3 &a = mesh_.vertices[of[0]], &b = mesh_.vertices[of[1]],
                   &c = mesh_.vertices[of[2]];
        const Vec3 p = on_triangle(x, a, b, c);
        const double d2 = (x - p).squaredNorm();
        if (d2 > least) continue;
        least = d2;
        any = true;
        found.place = p;
        normal = (b - a).cross(c - a);
      }
    });
    if (!any) return false;
    // From an edge or corner the way there is the normal, where it tells.
    const Vec3 off = x - found.place;
    const double side = off.dot(normal);
    found.normal = off.norm() > 1e-3 * reach_ ? Vec3((side < 0 ? -1 : 1) * off.normalized())
                                              : Vec3(normal.normalized());
    return true;
  }

 private:
  template <class F>
  void for_each_cell(const Vec3& min, const Vec3& max, const F& f) const {
    std::int64_t lo[3], hi[3];
    for (int a = 0; a < 3; ++a) {
      lo[a] = static_cast<std::int64_t>(std::floor(min[a] / reach_));
      hi[a] = static_cast<std::int64_t>(std::floor(max[a] / reach_));
    }
    for (std::int64_t z = lo[2]; z <= hi[2]; ++z) {
      for (std::int64_t y = lo[1]; y <= hi[1]; ++y) {
        for (std::int64_t x = lo[0]; x <= hi[0]; ++x) {
          constexpr std::int64_t kMask = (1 << 21) - 1;
          f(static_cast<std::uint64_t>((x & kMask) | (y & kMask) << 21 | (z & kMask) << 42));
        }
      }
    }
  }

  TriangleMesh mesh_;
  double reach_;
  std::unordered_map<std::uint64_t, std::vector<int>> cells_;
};

NearestSurface::NearestSurface(const Body& body, double reach)
    : body_(body), to_local_(body.pose.orientation.normalized().toRotationMatrix().transpose()) {
  if (!is_meshed(body)) return;
  triangles_ = std::make_unique<Triangles>(load_solid(body, nullptr), reach);
}

NearestSurface::~NearestSurface() = default;

bool NearestSurface::find(const Vec3& x, const Vec3& towards, SurfacePoint& found) const {
  if (triangles_ != nullptr) return triangles_->find(x, found);
  const Vec3 p = to_local_ * (x - body_.pose.position), t = to_local_ * towards;
  switch (body_.shape) {
    case Shape::kBox:
      found = on_box(p, body_.size / 2, t);
      break;
    case Shape::kCylinder:
      found = on_cylinder(p, body_.radius, body_.height / 2, t);
      break;
    case Shape::kBall:
      found.normal = p.norm() > 0 ? Vec3(p.normalized()) : Vec3(Vec3::UnitZ());
      found.place = body_.radius * found.normal;
      break;
    default:
      found = on_ellipsoid(p, body_.radii);
  }
  found.place = to_local_.transpose() * found.place + body_.pose.position;
  found.normal = to_local_.transpose() * found.normal;
  return true;
}

}  // namespace tissue_sim
