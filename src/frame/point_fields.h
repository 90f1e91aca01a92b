// What points of a cloud carry behind their Point, written once for all methods.
#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <vector>

#include "compute/for_each.h"
#include "tissue_sim/point.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// What PointField names, of one point.
struct PointFields {
  float rest[3], u[3], v[3], volume;
  float stress[6] = {};
};

/// Without a stress.
inline PointFields point_fields(const Vec3& rest, const Vec3& place, const Vec3& velocity,
                                double volume) {
  PointFields of;
  for (int a = 0; a < 3; ++a) {
    of.rest[a] = static_cast<float>(rest[a]);
    of.u[a] = static_cast<float>(place[a] - rest[a]);
    of.v[a] = static_cast<float>(velocity[a]);
  }
  of.volume = static_cast<float>(volume);
  return of;
}

/// Throws std::invalid_argument where `selection` asks for more than `has`.
inline void check_fields(const PointSelection& selection, unsigned has) {
  if ((selection.fields & ~has) == 0) return;
  throw std::invalid_argument(
      "fields of points: this method has no stress tensor of them (Point::stress is von Mises'), "
      "leave stress_tensor out, or take method mpm");
}

/// Widens a cloud of `count` Points by the fields that `selection` asks for; `place[p]` is where
/// point p is in it, -1 for none, and fields_of(p) what it has.
template <class FieldsOf>
void add_fields(const PointSelection& selection, const std::vector<std::int32_t>& place, int count,
                Cpu& cpu, std::vector<std::uint8_t>& cloud, const FieldsOf& fields_of) {
  const unsigned fields = selection.fields;
  if (fields == 0) return;
  const std::size_t size = selection.point_size();
  cloud.resize(size * count);
  for (int i = count; i-- > 0;) {  // from the end: what is to move is not overwritten
    std::memmove(cloud.data() + size * i, cloud.data() + sizeof(Point) * i, sizeof(Point));
  }
  cpu.for_each(
      static_cast<int>(place.size()),
      [&](int p) {
        if (place[p] < 0) return;
        const PointFields of = fields_of(p);
        std::uint8_t* to = cloud.data() + size * place[p] + sizeof(Point);
        const auto put = [&](PointField field, const float* values, int n) {
          if ((fields & field) == 0) return;
          std::memcpy(to, values, n * sizeof(float));
          to += n * sizeof(float);
        };
        put(kRestPosition, of.rest, 3);
        put(kDisplacement, of.u, 3);
        put(kVelocity, of.v, 3);
        put(kVolume, &of.volume, 1);
        put(kStressTensor, of.stress, 6);
      },
      256);
}

}  // namespace tissue_sim
