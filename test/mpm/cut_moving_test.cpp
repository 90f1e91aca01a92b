// Cuts through tissue that is strongly deformed, that moves, and by several blades at once.
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "mpm/lattice/bonds.h"
#include "support/cut_kinds.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

const Vec3 kSize(0.04, 0.03, 0.02);
const Vec3 kMiddle = 0.5 * kSize;

/// Components of the lattice's neighbours where nothing lies between sites of unlike `side`.
std::vector<int> parts_by_side(const MpmState& s, const std::vector<int>& side) {
  std::vector<int> part(side.size(), -1);
  std::vector<int> stack;
  for (std::size_t start = 0; start < side.size(); ++start) {
    if (part[start] >= 0) continue;
    part[start] = static_cast<int>(start);
    stack.push_back(static_cast<int>(start));
    while (!stack.empty()) {
      const int p = stack.back();
      stack.pop_back();
      const Points::Site& site = s.points.site[p];
      for (int k = 0; k < kBondCount; ++k) {
        const BondOffset o = bond_offset(k);
        const int q = s.bodies[site.body].point(site.x + o.x, site.y + o.y, site.z + o.z);
        if (q < 0 || side[q] != side[p] || part[q] >= 0) continue;
        part[q] = part[p];
        stack.push_back(q);
      }
    }
  }
  return in_order(part);
}

TEST(CutMoving, ThroughStronglyDeformedTissuePartsWhatIsOnItsSidesNow) {
  for (const double twist : {0.0, 40.0, 80.0}) {  // [rad/m]
    MpmTissue tissue(free_box(kSize, 0.002));
    MpmState& s = tissue.state();
    const LatticeBody& b = s.bodies[0];
    for (int z = -1; z <= b.nz; ++z) {
      for (int y = -1; y <= b.ny; ++y) {
        for (int x = -1; x <= b.nx; ++x) {
          const Vec3 X = b.node_position(x, y, z) - kMiddle;
          // Twice as long, thinner, sheared, twisted and bent.
          const Vec3 stretched(2 * X.x(), 0.7 * X.y() + 0.5 * X.x(), 0.7 * X.z());
          Vec3 to = Eigen::AngleAxisd(twist * X.x(), Vec3::UnitX()) * stretched;
          to.z() += 0.006 * std::sin(50 * to.x());
          for (int a = 0; a < 3; ++a) {
            s.nodes.u[a][b.node(x, y, z)] = static_cast<float>(to[a] - X[a]);
          }
        }
      }
    }
    measure_motion(s);
    const std::vector<Vec3> x = positions(tissue);
    std::vector<int> side(x.size(), 0);
    const Vec3 normals[] = {{1, 0.4, 0.2}, {0.1, 0.3, 1}, {-0.3, 1, 0.4}};
    for (int i = 0; i < 3; ++i) {
      const Vec3 place = kMiddle + Vec3(1e-4, 2e-4, 3e-4);
      for (std::size_t p = 0; p < x.size(); ++p) {
        side[p] |= int((x[p] - place).dot(normals[i]) > 0) << i;
      }
      cut_now(tissue, plane_cut(place, normals[i]));
      EXPECT_EQ(labels(tissue), parts_by_side(s, side)) << "twist " << twist << ", cut " << i;
      EXPECT_GE(tissue.fragments().size(), 2u << i);
    }
  }
}

/// Sets the body flying and spinning about its middle.
void spin(MpmState& s, const Vec3& flight, const Vec3& spin) {
  const LatticeBody& b = s.bodies[0];
  for (int z = -1; z <= b.nz; ++z) {
    for (int y = -1; y <= b.ny; ++y) {
      for (int x = -1; x <= b.nx; ++x) {
        const Vec3 v = flight + spin.cross(b.node_position(x, y, z) - kMiddle);
        for (int a = 0; a < 3; ++a) s.nodes.v[a][b.node(x, y, z)] = static_cast<float>(v[a]);
      }
    }
  }
  measure_motion(s);
}

std::vector<int> labels_at_rest(const std::vector<BladePath>& cuts) {
  MpmTissue tissue(free_box(kSize, 0.002));
  for (const BladePath& path : cuts) cut_now(tissue, path);
  return labels(tissue);
}

TEST(CutMoving, InFlightPartsWhatTheSameSurfacePartsAtRest) {
  const std::vector<BladePath> cuts = {plane_cut(Vec3(0.02, 0.015, 0.01), Vec3::UnitX()),
                                       upright_blade({Vec3(-0.01, 0.018, 0), Vec3(0.02, 0.018, 0)}),
                                       plane_cut(Vec3(0.02, 0.015, 0.006), Vec3::UnitZ())};
  MpmTissue tissue(free_box(kSize, 0.002));
  const std::vector<Vec3> X = positions(tissue);
  spin(tissue.state(), Vec3(0.3, -0.2, 0.5), Vec3(4, -6, 5));
  advance_by(tissue, 400, tissue.stable_substep(), {});
  ASSERT_FALSE(tissue.finish().blew_up);
  // Where the body has turned to, as a rigid one.
  const std::vector<Vec3> x = positions(tissue);
  Eigen::Matrix3Xd from(3, X.size()), to(3, X.size());
  for (std::size_t p = 0; p < X.size(); ++p) from.col(p) = X[p], to.col(p) = x[p];
  const Eigen::Isometry3d placed(Eigen::umeyama(from, to, false));
  EXPECT_GT(Eigen::AngleAxisd(placed.linear()).angle(), 0.6);
  std::vector<BladePath> moved = cuts;
  for (BladePath& path : moved) {
    for (Pose& pose : path.poses) {
      pose = {placed * pose.position, Quat(placed.linear()) * pose.orientation};
    }
  }
  advance_by(tissue, 20, tissue.stable_substep(), {{}, moved});
  EXPECT_FALSE(tissue.finish().blew_up);
  EXPECT_EQ(labels(tissue), labels_at_rest(cuts));
  EXPECT_EQ(tissue.fragments().size(), 6u);
}

/// A long thin scalpel.
Tool scalpel(const std::string& name) {
  Tool tool;
  tool.name = name;
  tool.type = ToolType::kScalpel;
  tool.blade_length = 0.1;
  tool.blade_width = 0.004;
  tool.blade_thickness = 0.0002;
  tool.friction = 0;
  return tool;
}
/// It cuts along `forward`, its flats face along `normal`.
Quat facing(const Vec3& forward, const Vec3& normal) {
  Eigen::Matrix3d r;
  r << forward, normal, forward.cross(normal);
  return Quat(r);
}

/// Where the tip is when the edge, upright, reaches from 5 cm above the body's middle to 5 cm
/// below.
double tip_z(const Quat& q) { return (q * Vec3::UnitZ()).z() > 0 ? 0.06 : -0.04; }

TEST(CutMoving, ByAScalpelThroughASpinningBodyPartsWhatItPartsAtRest) {
  Scene scene = free_box(kSize, 0.002);
  scene.tools = {scalpel("scalpel")};
  MpmTissue tissue(scene);
  // About the normal of the cut: the blade stays in the same material plane.
  spin(tissue.state(), Vec3(0, 0.05, 0), Vec3(10, 0, 0));
  const double x = 0.016;
  const Quat q = facing(Vec3::UnitY(), Vec3::UnitX());
  const auto at = [&](double s) { return Pose{Vec3(x, -0.02 + 0.08 * s, tip_z(q)), q}; };
  constexpr int kFrames = 40;
  for (int i = 0; i < kFrames; ++i) {
    ToolMotion motion;
    motion.present = true;
    motion.begin = at(double(i) / kFrames);
    motion.end = at((i + 1.0) / kFrames);
    advance_by(tissue, 20, tissue.stable_substep(), {{&motion, 1}, {}});
    ASSERT_FALSE(tissue.finish().blew_up);
  }
  EXPECT_EQ(labels(tissue), labels_at_rest({plane_cut(Vec3(x, 0, 0), Vec3::UnitX())}));
}

TEST(CutMoving, ByTwoScalpelsThatCrossInOneFrameMakesFourPieces) {
  Scene scene = free_box(kSize, 0.002);
  scene.tools = {scalpel("left"), scalpel("right")};
  Simulation simulation(scene);
  const Quat along_y = facing(Vec3::UnitY(), Vec3::UnitX());
  const Quat along_x = facing(Vec3::UnitX(), Vec3::UnitY());
  simulation.set_tool(0, {Vec3(0.018, -0.03, tip_z(along_y)), along_y});
  simulation.set_tool(1, {Vec3(-0.03, 0.014, tip_z(along_x)), along_x});
  simulation.advance_frame();
  simulation.set_tool(0, {Vec3(0.018, 0.06, tip_z(along_y)), along_y});
  simulation.set_tool(1, {Vec3(0.07, 0.014, tip_z(along_x)), along_x});
  const FrameReport report = simulation.advance_frame();
  EXPECT_FALSE(report.result.blew_up);
  EXPECT_EQ(report.result.blade_report.new_fragments, (std::vector<int>{1, 2, 3}));
  std::vector<int> sizes = piece_sizes(simulation.tissue());
  EXPECT_EQ(sizes, (std::vector<int>{22 * 16 * 20, 22 * 14 * 20, 18 * 16 * 20, 18 * 14 * 20}));
}

TEST(CutMoving, SlowByAnInstrumentPartsWhatItPartsInOneFrame) {
  const auto cut_in = [](int frames) {
    Scene scene = free_box(kSize, 0.002);
    scene.tools = {scalpel("scalpel")};
    Region held;  // one end stays where it is
    held.max.x() = 0.004;
    held.min = -0.1 * Vec3::Ones();
    held.max.y() = held.max.z() = 0.1;
    held.kind = Region::Kind::kBox;
    scene.bodies[0].anchors = {held};
    auto tissue = std::make_unique<MpmTissue>(scene);
    const Quat q = facing(Vec3::UnitY(), Vec3::UnitX());
    for (int i = 0; i < frames; ++i) {
      ToolMotion motion;
      motion.present = true;
      const auto at = [&](double s) { return Pose{Vec3(0.026, -0.02 + 0.06 * s, tip_z(q)), q}; };
      motion.begin = at(double(i) / frames);
      motion.end = at((i + 1.0) / frames);
      advance_by(*tissue, 4, tissue->stable_substep(), {{&motion, 1}, {}});
      EXPECT_FALSE(tissue->finish().blew_up);
    }
    return tissue;
  };
  const auto fast = cut_in(1), slow = cut_in(400);
  EXPECT_EQ(fast->fragments().size(), 2u);
  EXPECT_EQ(labels(*slow), labels(*fast));
  EXPECT_EQ(slow->state().points.bonds, fast->state().points.bonds);
}

}  // namespace
}  // namespace tissue_sim
