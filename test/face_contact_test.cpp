// Tissue against tissue: faces of cuts, pieces among themselves, folds.
#include <gtest/gtest.h>

#include <iostream>

#include "cut_scenes.h"
#include "momentum.h"

namespace tissue_sim {
namespace {

constexpr double kFrame = 1.0 / 60;

FrameResult advance_frame(MpmTissue& tissue) {
  const int n = static_cast<int>(std::ceil(kFrame / tissue.stable_substep()));
  tissue.advance(n, static_cast<float>(kFrame / n), {});
  return tissue.finish();
}

/// Gives the points of each piece a velocity: of the nodes by the piece that sees them.
template <class Velocity>
void throw_pieces(MpmTissue& tissue, const Velocity& velocity) {
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  for (int p = 0; p < s.points.size(); ++p) {
    const LatticeBody& b = s.bodies[s.points.site[p].body];
    for (int k = 0; k < 27; ++k) {
      const int node = s.fields->node(b, s.points.site[p], k);
      const Vec3 v = velocity(tissue.fragment_of(p), home[node]);
      for (int a = 0; a < 3; ++a) s.nodes.v[a][node] = static_cast<float>(v[a]);
    }
  }
  measure_motion(s);
}

double largest_force(const MpmState& s) {
  double largest = 0;
  for (const std::int32_t i : s.faces.active) {
    const float* f = s.faces.all[i].force;
    largest = std::max(largest, Vec3(f[0], f[1], f[2]).norm());
  }
  return largest;
}

TEST(FaceContact, FreshCutIsFreeOfStress) {
  for (const Vec3& normal : {Vec3(1, 0, 0), Vec3(1, 0.6, 0.3), Vec3(1, 1, 1)}) {
    MpmTissue tissue(free_box(Vec3(0.03, 0.03, 0.03), 0.002));
    MpmState& s = tissue.state();
    deform(s);
    cut_now(tissue, plane_cut(Vec3(0.02, 0.0171, 0.02), normal));
    ASSERT_EQ(tissue.fragments().size(), 2u);
    find_face_contacts(s, tissue.pieces(), 1e-6);
    double strongest = 0;
    int faces = 0;
    for (const std::int32_t i : s.faces.active) {
      push_faces(s, s.faces.all[i], 1e-6f);
      faces += s.faces.all[i].depth > -0.01f;
      strongest = std::max(strongest, double(s.faces.all[i].stiffness) * 0.002);
    }
    EXPECT_GT(faces, 15 * 15) << "they are found";
    std::cout << "faces " << faces << " active " << s.faces.active.size() << " force "
              << largest_force(s) << " of " << strongest << "\n";
    EXPECT_LT(largest_force(s), 1e-3 * strongest);
  }
}

TEST(FaceContact, KeepsMomentumOfPiecesThatCollideAndScrape) {
  Scene scene = free_box(Vec3(0.03, 0.02, 0.02), 0.002);
  MpmTissue tissue(scene);
  cut_now(tissue, plane_cut(Vec3(0.0151, 0.01, 0.01), Vec3(1, 0.3, 0.1)));
  throw_pieces(tissue, [](int piece, const Vec3& x) -> Vec3 {
    return Vec3((piece == 0 ? -0.1 : 0.1), (piece == 0 ? 0.05 : -0.05), 0) + Vec3(2, 1, 3).cross(x);
  });
  // towards one another?
  MpmState& s = tissue.state();
  const std::vector<Vec3> home = homes(s);
  const Momentum start = momentum(s, home);
  double energy = 1e9;
  for (int f = 0; f < 20; ++f) {
    const FrameResult r = advance_frame(tissue);
    const Momentum now = momentum(s, home);
    const double total = r.kinetic_energy + r.elastic_energy;
    std::cout << f << " lin "
              << (now.linear - start.linear).norm() / (start.linear.norm() + 0.1 * 0.012) << " ang "
              << (now.angular - start.angular).norm() / start.angular.norm() << " energy "
              << r.kinetic_energy << " + " << r.elastic_energy << " = " << total << " touching "
              << s.faces.active.size() << " F " << largest_force(s) << "\n";
    energy = total;
    if (f == 10)
      for (const std::int32_t i : s.faces.active) {
        const FaceContact& c = s.faces.all[i];
        if (!c.touching) continue;
        const auto show = [&](std::int32_t id) {
          const Block& b = *s.blocks.all[s.faces.block_of[id]];
          const Facet& q = b.facets[id - s.faces.first_facet[s.faces.block_of[id]]];
          const auto& st = s.points.site[q.point];
          std::cout << " site " << st.x << "," << st.y << "," << st.z << " dir " << int(q.direction)
                    << " n " << q.normal[0] << "," << q.normal[1] << "," << q.normal[2] << " piece "
                    << tissue.fragment_of(q.point) << " area " << q.area * 1e6 << " ext "
                    << q.extent[0] << q.extent[1] << q.extent[2] << " ctr " << q.center[0] << ","
                    << q.center[1] << "," << q.center[2];
        };
        show(c.facet);
        std::cout << " |";
        show(c.other);
        std::cout << " depth " << c.depth << "\n";
      }
  }
  (void)energy;
}

TEST(FaceContact, Slide) {
  for (const double degrees : {10.0, 15.0, 18.0, 22.0}) {
    Scene scene = free_box(Vec3(0.04, 0.02, 0.01), 0.002);
    scene.bodies[0].anchors.emplace_back();
    scene.bodies[0].anchors[0].z = 0.0025;
    scene.materials.push_back(Material());
    scene.materials[0].name = "m";
    scene.materials[0].viscosity = 5;
    scene.bodies[0].material = "m";
    Body top = scene.bodies[0];
    top.anchors.clear();
    top.name = "top";
    top.size = Vec3(0.016, 0.012, 0.008);
    top.pose.position = Vec3(0.01, 0.01, 0.0141);
    scene.bodies.push_back(top);
    const double a = degrees * M_PI / 180;
    scene.gravity = 9.81 * Vec3(std::sin(a), 0, -std::cos(a));
    MpmTissue tissue(scene);
    double x0 = 0, v0 = 0;
    for (int f = 0; f < 18; ++f) {
      const FrameResult r = advance_frame(tissue);
      const Fragment& t = tissue.fragments()[1];
      if (f == 8) x0 = t.centroid[0], v0 = t.velocity[0];
      if (f == 17) {
        const double expected = 9.81 * (std::sin(a) - 0.3 * std::cos(a));
        std::cout << degrees << " deg: v " << v0 << " -> " << t.velocity[0] << " x " << x0 << " -> "
                  << t.centroid[0] << " z " << t.centroid[2] << " acc "
                  << (t.velocity[0] - v0) / (9 * kFrame) << " expected " << std::max(0.0, expected)
                  << " KE " << r.kinetic_energy << "\n";
      }
    }
  }
}

}  // namespace
}  // namespace tissue_sim
