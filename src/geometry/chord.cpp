#include "geometry/chord.h"

#include <algorithm>
#include <cmath>

namespace tissue_sim {
namespace {

Vec3 half_extents(const Body& body) {
  switch (body.shape) {
    case Shape::kBox:
      return body.size / 2;
    case Shape::kBall:
      return Vec3::Constant(body.radius);
    case Shape::kEllipsoid:
      return body.radii;
    case Shape::kCylinder:
      return Vec3(body.radius, body.radius, body.height / 2);
    case Shape::kMesh:
      break;
  }
  return Vec3::Zero();
}

// Keeps the part of the interval where |p + t d| <= half.
bool clip_slab(double p, double d, double half, Interval& interval) {
  if (std::abs(d) < 1e-12) return std::abs(p) <= half;  // parallel, but for rounding
  const double a = (-half - p) / d, b = (half - p) / d;
  interval.begin = std::max(interval.begin, std::min(a, b));
  interval.end = std::min(interval.end, std::max(a, b));
  return interval.begin < interval.end;
}

// Keeps the part where a t^2 + 2 b t + c <= 0, a >= 0.
bool clip_quadric(double a, double b, double c, Interval& interval) {
  if (a < 1e-24) return c <= 0;
  const double discriminant = b * b - a * c;
  if (discriminant <= 0) return false;
  const double root = std::sqrt(discriminant);
  interval.begin = std::max(interval.begin, (-b - root) / a);
  interval.end = std::min(interval.end, (-b + root) / a);
  return interval.begin < interval.end;
}

}  // namespace

Box bounding_box(const Body& body) {
  const Eigen::Matrix3d r = body.pose.orientation.normalized().toRotationMatrix();
  const Vec3 half = half_extents(body);
  Vec3 reach;
  if (body.shape == Shape::kBox) {
    reach = r.cwiseAbs() * half;
  } else if (body.shape == Shape::kCylinder) {
    reach = half.x() * r.leftCols<2>().rowwise().norm() + half.z() * r.col(2).cwiseAbs();
  } else {
    reach = (r * half.asDiagonal()).rowwise().norm();
  }
  Box box;
  box.min = body.pose.position - reach;
  box.max = body.pose.position + reach;
  return box;
}

double exact_volume(const Body& body) {
  const Vec3 half = half_extents(body);
  if (body.shape == Shape::kBox) return 8 * half.prod();
  if (body.shape == Shape::kCylinder) return 2 * M_PI * half.prod();
  return 4 * M_PI / 3 * half.prod();
}

Solid::Solid(const Body& body)
    : shape_(body.shape),
      half_(half_extents(body)),
      position_(body.pose.position),
      to_local_(body.pose.orientation.normalized().toRotationMatrix().transpose()) {}

bool Solid::chord(double y, double z, Interval& interval) const {
  // Local coordinates of the line: p + t d, t the distance from the body's centre along world x.
  const Vec3 p = to_local_ * Vec3(0, y - position_.y(), z - position_.z());
  const Vec3 d = to_local_.col(0);
  interval = {-1e30, 1e30};
  bool hit = false;
  if (shape_ == Shape::kBox) {
    hit = clip_slab(p.x(), d.x(), half_.x(), interval) &&
          clip_slab(p.y(), d.y(), half_.y(), interval) &&
          clip_slab(p.z(), d.z(), half_.z(), interval);
  } else if (shape_ == Shape::kCylinder) {
    const auto p2 = p.head<2>(), d2 = d.head<2>();
    hit = clip_slab(p.z(), d.z(), half_.z(), interval) &&
          clip_quadric(d2.squaredNorm(), p2.dot(d2), p2.squaredNorm() - half_.x() * half_.x(),
                       interval);
  } else {
    const Vec3 ps = p.cwiseQuotient(half_), ds = d.cwiseQuotient(half_);
    hit = clip_quadric(ds.squaredNorm(), ps.dot(ds), ps.squaredNorm() - 1, interval);
  }
  interval.begin += position_.x();
  interval.end += position_.x();
  return hit && interval.begin < interval.end;
}

}  // namespace tissue_sim
