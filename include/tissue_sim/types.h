// Small types that the whole public API shares. SI units; poses and vectors in double precision.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

namespace tissue_sim {

using Vec3 = Eigen::Vector3d;
using Quat = Eigen::Quaterniond;

/// A rigid placement: x_world = orientation * x_local + position [m].
struct Pose {
  Vec3 position = Vec3::Zero();         ///< [m]
  Quat orientation = Quat::Identity();  ///< unit quaternion

  Vec3 operator*(const Vec3& local) const { return orientation * local + position; }
};

/// Force and moment about a stated point, in stated axes.
struct Wrench {
  Vec3 force = Vec3::Zero();   ///< [N]
  Vec3 torque = Vec3::Zero();  ///< [N m]
};

/// Axis-aligned box; empty when made by default.
struct Box {
  Vec3 min = Vec3::Constant(1e300);   ///< [m]
  Vec3 max = Vec3::Constant(-1e300);  ///< [m]
};

/// A view of `size()` contiguous elements that somebody else owns (std::span is C++20).
template <class T>
class Span {
 public:
  Span() = default;
  Span(T* data, std::size_t size) : data_(data), size_(size) {}
  template <class Container>
  Span(Container& c) : data_(c.data()), size_(c.size()) {}  // NOLINT: implicit like std::span

  T* begin() const { return data_; }
  T* end() const { return data_ + size_; }
  T& operator[](std::size_t i) const { return data_[i]; }
  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace tissue_sim
