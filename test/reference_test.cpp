// One substep against brute force in double precision, on random deformed states.
#include <gtest/gtest.h>

#include <cstdlib>

#include "cut_scenes.h"
#include "reference/mpm_reference.h"

namespace tissue_sim {
namespace {

struct Case {
  const char* name;
  Law law;
  double viscosity;
  int cuts;
  const char* instruction_set;
  enum { kOne, kOneLaw, kBothLaws } materials = kOne;
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.name << " " << c.instruction_set;
}

class Substep : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override { setenv("TISSUE_SIM_INSTRUCTION_SET", GetParam().instruction_set, 1); }
  void TearDown() override { unsetenv("TISSUE_SIM_INSTRUCTION_SET"); }
};

/// Four further materials: two balls, one of them within the other, a box and a layer.
void add_inclusions(const Case& c, Scene& scene) {
  const double stiffer[] = {3, 0.4, 1.7, 6}, denser[] = {1.2, 0.7, 1.5, 0.9};
  Body& body = scene.bodies[0];
  for (int i = 0; i < 4; ++i) {
    Material m = scene.materials[0];
    m.name += std::to_string(i);
    m.young_modulus *= stiffer[i];
    m.poisson_ratio = 0.1 + 0.1 * i;
    m.density *= denser[i];
    m.viscosity *= i;
    if (c.materials == Case::kBothLaws && i % 2 == 0) {
      m.law = c.law == Law::kNeoHookean ? Law::kFixedCorotated : Law::kNeoHookean;
    }
    scene.materials.push_back(m);
    Inclusion inclusion;
    inclusion.material = m.name;
    inclusion.region.kind = i < 2 ? Region::Kind::kBall : Region::Kind::kBox;
    inclusion.region.center = Vec3(0.017 + 0.001 * i, 0.015, 0.009);
    inclusion.region.radius = i == 0 ? 0.009 : 0.004;
    inclusion.region.min = i == 2 ? Vec3(0.02, 0.002, 0.001) : Vec3(-1, 0.0221, -1);
    inclusion.region.max = i == 2 ? Vec3(0.026, 0.012, 0.011) : Vec3::Ones();
    body.inclusions.push_back(inclusion);
  }
}

Scene scene_of(const Case& c, Shape shape) {
  Scene scene = free_box(Vec3(0.031, 0.029, 0.017), 0.002);
  scene.gravity = Vec3(0.3, -0.2, -9.81);
  scene.bodies[0].shape = shape;
  scene.bodies[0].radii = Vec3(0.016, 0.014, 0.009);
  Region held;
  held.kind = Region::Kind::kBox;
  held.min = Vec3(-0.01, -0.01, -0.01);
  held.max = Vec3(0.006, 0.1, 0.1);
  scene.bodies[0].anchors.push_back(held);
  Material m;
  m.name = "test";
  m.law = c.law;
  m.viscosity = c.viscosity;
  scene.materials.push_back(m);
  scene.bodies[0].material = "test";
  if (c.materials != Case::kOne) add_inclusions(c, scene);
  return scene;
}

TEST_P(Substep, AgreesWithBruteForce) {
  for (const Shape shape : {Shape::kBox, Shape::kEllipsoid}) {
    MpmTissue tissue(scene_of(GetParam(), shape));
    MpmState& state = tissue.state();
    deform(state);
    const Vec3 middle(0.0155, 0.0145, 0.0085);
    if (GetParam().cuts > 0) {
      ASSERT_GT(cut_now(tissue, plane_cut(middle, Vec3(1, 0.4, 0.2))).bonds_broken, 0);
    }
    if (GetParam().cuts > 1) cut_now(tissue, plane_cut(middle, Vec3(-0.3, 1, 0.1)));
    if (GetParam().cuts > 2) {  // one that ends inside
      cut_now(tissue, upright_blade({Vec3(-0.01, 0.006, 0), Vec3(0.012, 0.008, 0)}));
    }
    for (int i = 3; i < GetParam().cuts; ++i) {  // small pieces, among them points alone
      const Vec3 normal(std::sin(1.0 * i), std::sin(2.3 * i), std::cos(3.1 * i));
      cut_now(tissue, plane_cut(middle + 0.004 * std::sin(5.0 * i) * normal, normal));
    }
    shake(state, 7, 8e-5);
    const float dt = 1e-4f;
    const reference::Step expected = reference::substep(state, dt);
    EXPECT_GT(expected.largest_strain, 0.1) << "the state must be deformed to tell anything";
    std::vector<ColliderLoad> loads(state.colliders.size());
    substep(state, dt, loads);
    double force_scale = 0, v_scale = 0;
    for (std::size_t i = 0; i < expected.u.size(); ++i) {
      force_scale = std::max(force_scale, expected.force[i].norm());
      v_scale = std::max(v_scale, expected.v[i].norm());
    }
    for (std::size_t i = 0; i < expected.u.size(); ++i) {
      ASSERT_NEAR(state.nodes.mass[i], expected.mass[i], 1e-6 * expected.mass[i] + 1e-20);
      if (state.nodes.inv_mass[i] == 0) continue;
      const Vec3 v(state.nodes.v[0][i], state.nodes.v[1][i], state.nodes.v[2][i]);
      const Vec3 u(state.nodes.u[0][i], state.nodes.u[1][i], state.nodes.u[2][i]);
      // In float, forces are right to some 1e-6 of the largest; a light node turns that into more
      // velocity than a heavy one.
      const double v_bound = 2e-6 * force_scale * dt / expected.mass[i] + 1e-6 * v_scale;
      ASSERT_LT((v - expected.v[i]).norm(), v_bound) << "node " << i;
      ASSERT_LT((u - expected.u[i]).norm(), dt * v_bound + 1e-8) << "node " << i;
    }
  }
}

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const char* set : {"sse2", "avx2", "avx512"}) {
    all.push_back({"fixed corotated", Law::kFixedCorotated, 0, 0, set});
    all.push_back({"neo-Hookean", Law::kNeoHookean, 0, 0, set});
    all.push_back({"viscous", Law::kFixedCorotated, 3, 0, set});
    all.push_back({"cut", Law::kFixedCorotated, 0, 1, set});
    all.push_back({"cut crosswise, viscous", Law::kNeoHookean, 2, 2, set});
    all.push_back({"cut crosswise and in part", Law::kFixedCorotated, 0, 3, set});
    all.push_back({"shattered, viscous", Law::kFixedCorotated, 2, 16, set});
    for (const auto materials : {Case::kOneLaw, Case::kBothLaws}) {
      const bool both = materials == Case::kBothLaws;
      for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
        const char* name = both ? "materials of both laws" : "materials";
        all.push_back({name, law, 0, 0, set, materials});
      }
      all.push_back({"materials, viscous", Law::kFixedCorotated, 3, 0, set, materials});
      all.push_back({"materials, cut crosswise", Law::kNeoHookean, 2, 2, set, materials});
      all.push_back({"materials, shattered", Law::kFixedCorotated, 2, 16, set, materials});
    }
  }
  const InstructionSet best = instruction_set();
  while (all.back().instruction_set != std::string("sse2") && best < InstructionSet::kAvx512) {
    const bool has_avx2 = best == InstructionSet::kAvx2;
    if (has_avx2 && all.back().instruction_set == std::string("avx2")) break;
    all.pop_back();
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(All, Substep, testing::ValuesIn(cases()));

}  // namespace
}  // namespace tissue_sim
