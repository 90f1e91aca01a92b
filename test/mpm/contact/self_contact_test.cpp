// A body that is whole touches itself. On the CPU and, where there is one, on the GPU.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/cut_scenes.h"
#include "support/either_device.h"
#include "support/fixed_substeps.h"
#include "support/measured.h"

namespace tissue_sim {
namespace {

constexpr double kCell = 0.002, kThick = 2 * kCell, kLong = 60 * kCell;  // [m]
constexpr double kRadius = 3 * kCell, kBend = kRadius * EIGEN_PI / 2;    // of the bend, half of it
constexpr double kGap = 2 * kRadius - kThick;

/// A bar that lies along x.
Scene bar() { return inviscid(free_box(Vec3(kLong, kThick, 6 * kCell), kCell)); }

/// Grips its middle and bends it to a U whose prongs, free of stress, fly at one another.
template <class T>
void bend(T& tissue, double speed) {
  pull(tissue);
  MpmState& s = tissue.state();
  grip(s, [](const Vec3& x, double margin) {
    return std::fabs(x[0] - kLong / 2) < kBend + kCell + margin;
  });
  s.bodies[0].for_each_node([&](int node, int x, int y, int z) {
    const Vec3 home = s.bodies[0].node_position(x, y, z);
    const double along = home[0] - kLong / 2, side = along < 0 ? -1 : 1;
    const double in = home[1] - kThick / 2, up = std::max(0.0, std::fabs(along) - kBend);
    const double angle = std::min(std::fabs(along), kBend) / kRadius;
    const double place[3] = {side * (kRadius - in) * std::sin(angle),
                             kRadius - (kRadius - in) * std::cos(angle) + up, home[2]};
    for (int a = 0; a < 3; ++a) s.nodes.u[a][node] = static_cast<float>(place[a] - home[a]);
    if (s.nodes.inv_mass[node] == 0) return;
    s.nodes.v[0][node] = static_cast<float>(-side * speed * up / (kLong / 2 - kBend));
  });
  push(tissue);
}

/// From the inner layer of points at the end of one prong to the other's, less the half cell that
/// they are from the faces [m].
template <class T>
double gap(T& tissue) {
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  const auto* points = reinterpret_cast<const Point*>(cloud.data());
  double right = 0, left = 0;
  int of_each = 0;
  for (int i = 0; i < count; ++i) {
    const Points::Site& site = tissue.state().points.site[points[i].id];
    if (site.y < 3) continue;
    if (site.x < 4) left += points[i].x, ++of_each;
    if (site.x >= 116) right += points[i].x;
  }
  return (right - left) / of_each - kCell / 2;
}

template <class T>
using SelfContactOf = OnEitherDevice<T>;
TYPED_TEST_SUITE(SelfContactOf, Tissues, DeviceName);

TYPED_TEST(SelfContactOf, ProngsOfABodyMeetPushOneAnotherBackAndThatIsAllThatTheyDo) {
  TypeParam tissue(bar());
  bend(tissue, 0.2);
  ASSERT_NEAR(gap(tissue), kGap, 1e-5);
  advance_by(tissue, 0, 1e-4f, {});
  FrameResult r = tissue.finish();
  const double energy = r.kinetic_energy + r.elastic_energy;
  double closest = kGap;
  int most = 0;
  for (int i = 0; i < 80; ++i) {
    const int n = static_cast<int>(std::ceil(1e-3 / tissue.stable_substep()));
    advance_by(tissue, n, static_cast<float>(1e-3 / n), {});
    r = tissue.finish();
    pull(tissue);
    closest = std::min(closest, gap(tissue));
    most = std::max(most, touching(tissue.state()));
    EXPECT_LT(r.kinetic_energy + r.elastic_energy, 1.02 * energy);
  }
  std::printf("%.3f mm apart at the closest, %d contacts touch; then %.3f mm apart\n",
              1e3 * closest, most, 1e3 * gap(tissue));
  // Half of what points are apart.
  EXPECT_TRUE(
      is_at_most("prongs of a U that meet: depth", -1e3 * closest, 1e3 * 0.25 * kCell, "mm"));
  EXPECT_LT(closest, 0.1 * kCell);
  EXPECT_GT(most, 30);
  EXPECT_GT(gap(tissue), kCell / 2) << "they parted again";
}

}  // namespace
}  // namespace tissue_sim
