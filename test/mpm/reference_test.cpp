// One substep against brute force in double precision, on random deformed states.
#include <gtest/gtest.h>

#include <cstdlib>

#include "reference/mpm_reference.h"
#include "support/cut_scenes.h"

namespace tissue_sim {
namespace {

struct Case {
  const char* name;
  Law law;
  double viscosity;
  int cuts;
  const char* instruction_set;
  enum { kOne, kOneLaw, kBothLaws } materials = kOne;
  bool uniform = false;  // blocks of one side and material, as the GPU has them
};

std::ostream& operator<<(std::ostream& out, const Case& c) {
  return out << c.name << " " << c.instruction_set;
}

class Substep : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override { setenv("TISSUE_SIM_INSTRUCTION_SET", GetParam().instruction_set, 1); }
  void TearDown() override { unsetenv("TISSUE_SIM_INSTRUCTION_SET"); }
};

Scene scene_of(const Case& c, Shape shape) {
  Scene scene = free_body(c.law, c.viscosity, shape);
  if (c.materials != Case::kOne) add_inclusions(scene, c.materials == Case::kBothLaws);
  return scene;
}

void make_uniform_blocks(MpmState& s) {
  s.blocks = make_blocks(s, {16, 4, 4, true}, *s.cpu);
  s.work.force.resize(s.blocks.force_size);
  s.contacts.touching.assign(s.blocks.all.size(), {});
  s.contacts.near.assign(s.blocks.all.size(), {});
  list_facets(s);
  measure_motion(s);
}

TEST_P(Substep, AgreesWithBruteForce) {
  for (const Shape shape : {Shape::kBox, Shape::kEllipsoid}) {
    MpmTissue tissue(scene_of(GetParam(), shape));
    MpmState& state = tissue.state();
    if (GetParam().uniform) make_uniform_blocks(state);
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
    state.front = {};  // where a cut ends: front_test.cpp
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
      all.push_back({"by material, cut", Law::kFixedCorotated, 2, 3, set, materials, true});
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
