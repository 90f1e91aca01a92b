// Contact of tissue with tissue on the GPU, one substep at a time. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <algorithm>
#include <cmath>
#include <iterator>

#include "compute/cuda_check.h"
#include "mpm/contact/face_places.h"
#include "mpm/contact/face_search.h"
#include "reference/mpm_reference.h"
#include "support/cuda_mpm_tissue.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"

namespace tissue_sim {
namespace {

class FaceContactOnGpu : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
    if (GetParam() != nullptr) setenv("TISSUE_SIM_CUDA_SHAPE", GetParam(), 1);
  }
  void TearDown() override { unsetenv("TISSUE_SIM_CUDA_SHAPE"); }
};

/// Nodes rush towards the middle, so that all cuts close and press.
void implode(CudaMpmTissue& tissue, const Vec3& middle, double rate) {
  tissue.pull();
  MpmState& s = tissue.state();
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int lattice_node, int x, int y, int z) {
      const Vec3 home = b.node_position(x, y, z);
      const auto set = [&](int node) {
        for (int a = 0; a < 3; ++a) {
          s.nodes.v[a][node] = static_cast<float>(-rate * (home[a] - middle[a]));
        }
      };
      set(lattice_node);
      const NodeFields::Split* split = s.fields->split(lattice_node);
      if (split == nullptr) return;
      for (const auto& field : split->fields) set(field.node);
    });
  }
  tissue.push();
}

/// A deformed body, cut crosswise, whose pieces press on one another, between two looks.
void press(CudaMpmTissue& tissue, float dt) {
  const Vec3 middle(0.0155, 0.0145, 0.0085);
  deform(tissue.state());
  tissue.push();
  cut_now(tissue, plane_cut(middle, Vec3(1, 0.4, 0.2)));
  cut_now(tissue, plane_cut(middle, Vec3(-0.3, 1, 0.1)));
  implode(tissue, middle, 10);
  const FaceContacts& faces = tissue.state().faces;
  for (int i = 0; i < 12 || faces.until_look < dt || faces.until_search < dt; ++i) {
    ASSERT_LT(i, 60);
    advance_by(tissue, 1, dt, {});
    ASSERT_FALSE(tissue.finish().blew_up);
    tissue.pull();
  }
}

TEST_P(FaceContactOnGpu, OneSubstepAgreesWithTheCpusContactsAndBruteForce) {
  CudaMpmTissue tissue(inviscid(free_box(Vec3(0.031, 0.029, 0.017), 0.002)));
  const float dt = 0.5f * tissue.stable_substep();
  press(tissue, dt);
  if (HasFatalFailure()) return;
  tissue.pull();
  MpmState& s = tissue.state();
  shake(s, 5, 2e-5);
  tissue.push();
  std::vector<FaceContact> contacts;
  for (const std::int32_t i : s.faces.active) contacts.push_back(s.faces.all[i]);
  reference::Step expected = reference::substep(s, dt);
  double largest = 0, force_scale = 0, v_scale = 0;
  int touching = 0;
  for (FaceContact& c : contacts) {
    push_faces(s, c, dt);
    const Vec3 force(c.force[0], c.force[1], c.force[2]);
    largest = std::max(largest, force.norm());
    touching += force.norm() > 0 ? 1 : 0;
    for (int k = 0; k < 27; ++k) {
      const auto give = [&](const CellNodes& cell, const AxisWeights& weights, double sign) {
        const int n = cell.lowest[k / 9 * cell.plane + k / 3 % 3 * cell.pitch + k % 3];
        if (s.nodes.inv_mass[n] == 0) return;
        const double w = weights.of[k % 3] * weights.of[3 + k / 3 % 3] * weights.of[6 + k / 9];
        const Vec3 impulse = sign * dt * w * force / expected.mass[n];
        expected.force[n] += sign * w * force;
        expected.v[n] += impulse;
        expected.u[n] += dt * impulse;
      };
      give(c.nodes, c.weights, 1);
      give(c.other_nodes, c.other_weights, -1);
    }
  }
  EXPECT_GT(touching, 50);
  advance_by(tissue, 1, dt, {});
  tissue.finish();
  tissue.pull();
  ASSERT_EQ(s.faces.active.size(), contacts.size()) << "nothing was looked at";
  double worst = 0, worst_hold = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const FaceContact &a = contacts[i], &b = s.faces.all[s.faces.active[i]];
    worst = std::max(
        worst,
        Vec3(a.force[0] - b.force[0], a.force[1] - b.force[1], a.force[2] - b.force[2]).norm());
    for (int c = 0; c < 3; ++c) {
      worst_hold = std::max<double>(worst_hold, std::fabs(a.hold[c] - b.hold[c]));
    }
  }
  std::printf("%d contacts push, with up to %.3g N; off by %.2e of it, their holds by %.1e cells\n",
              touching, largest, worst / largest, worst_hold);
  // Sums of displacements of some millimetres round by half a nanometre, in another order here and
  // there, of 50 micrometres of depth; the damper feels it once more.
  EXPECT_LT(worst, 1e-4 * largest);
  EXPECT_LT(worst_hold, 1e-5);
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    force_scale = std::max(force_scale, expected.force[i].norm());
    v_scale = std::max(v_scale, expected.v[i].norm());
  }
  for (std::size_t i = 0; i < expected.u.size(); ++i) {
    if (s.nodes.inv_mass[i] == 0) continue;
    const Vec3 v(s.nodes.v[0][i], s.nodes.v[1][i], s.nodes.v[2][i]);
    const double v_bound =
        (2e-6 * force_scale + 1e-4 * largest) * dt / expected.mass[i] + 1e-6 * v_scale;
    ASSERT_LT((v - expected.v[i]).norm(), v_bound) << "node " << i;
  }
}

/// Of each facet, those that it may touch.
using Near = std::vector<std::vector<std::int32_t>>;

Near near_on_cpu(const FaceContacts& faces) {
  Near near(faces.block_of.size());
  for (std::size_t i = 0; i < faces.all.size(); ++i) {
    near[faces.all[i].facet].assign(faces.near.begin() + faces.first_near[i],
                                    faces.near.begin() + faces.first_near[i + 1]);
  }
  return near;
}

/// How many entries only one of them has.
std::size_t difference(const Near& a, const Near& b) {
  std::size_t count = 0;
  for (std::size_t f = 0; f < a.size(); ++f) {
    std::vector<std::int32_t> of_one;
    std::set_symmetric_difference(a[f].begin(), a[f].end(), b[f].begin(), b[f].end(),
                                  std::back_inserter(of_one));
    count += of_one.size();
  }
  return count;
}

TEST_P(FaceContactOnGpu, ASearchAndALookAgreeWithTheCpus) {
  CudaMpmTissue tissue(inviscid(free_box(Vec3(0.031, 0.029, 0.017), 0.002)));
  const float dt = 0.5f * tissue.stable_substep();
  press(tissue, dt);
  if (HasFatalFailure()) return;
  MpmState& s = tissue.state();
  for (int round = 0; round < 3; ++round) {
    tissue.pull();
    FaceContacts& faces = s.faces;
    faces.motion.resize(faces.block_of.size());
    faces.listed.clear();
    faces.until_search = 0;
    const int before = static_cast<int>(faces.all.size());
    find_face_contacts(s, tissue.pieces(), dt);
    FaceContacts expected = faces;
    for (const std::int32_t i : expected.active) push_faces(s, expected.all[i], dt);
    tissue.search_anew();
    advance_by(tissue, 1, dt, {});
    tissue.finish();
    tissue.pull();
    const Near cpu = near_on_cpu(expected), gpu = tissue.near_facets();
    std::size_t entries = 0;
    for (const auto& list : cpu) entries += list.size();
    EXPECT_GT(entries, 500u);
    EXPECT_LE(difference(cpu, gpu), entries / 500) << "of " << entries;
    int same = 0, other = 0, touching = 0;
    double worst_hold = 0, worst_apart = 0, worst_depth = 0, worst_stiffness = 0;
    std::vector<const FaceContact*> of_facet(faces.block_of.size(), nullptr);
    for (const std::int32_t i : faces.active) of_facet[faces.all[i].facet] = &faces.all[i];
    for (const std::int32_t i : expected.active) {
      const FaceContact& a = expected.all[i];
      const FaceContact* b = of_facet[a.facet];
      if (b == nullptr || b->other != a.other || b->touching != a.touching) {
        ++other;
        continue;
      }
      ++same;
      touching += a.touching ? 1 : 0;
      worst_depth = std::max<double>(worst_depth, std::fabs(a.depth - b->depth));
      worst_stiffness =
          std::max<double>(worst_stiffness, std::fabs(a.stiffness / b->stiffness - 1));
      for (int c = 0; c < 3; ++c) {
        worst_hold = std::max<double>(worst_hold, std::fabs(a.hold[c] - b->hold[c]));
        worst_apart = std::max<double>(worst_apart, std::fabs(a.apart[c] - b->apart[c]));
      }
    }
    std::printf(
        "%d contacts before; %d the same, %d touch, %d not; depths off by %.1e, holds by %.1e "
        "cells, apart by %.1e m, stiffness by %.1e\n",
        before, same, touching, other, worst_depth, worst_hold, worst_apart, worst_stiffness);
    EXPECT_GT(touching, 50);
    EXPECT_LE(other, same / 50) << "where two facets fit alike, or depths are zero";
    EXPECT_LT(worst_depth, 1e-4);
    EXPECT_LT(worst_hold, 1e-3);
    EXPECT_LT(worst_apart, 1e-6);
    EXPECT_LT(worst_stiffness, 1e-4);
    advance_by(tissue, 7, dt, {});
    ASSERT_FALSE(tissue.finish().blew_up);
  }
}

/// What friction holds on to.
std::vector<float> holds(const FaceContacts& faces) {
  std::vector<float> result;
  for (const std::int32_t i : faces.active) {
    const FaceContact& c = faces.all[i];
    result.insert(result.end(), {float(c.facet), float(c.other), float(c.touching)});
    result.insert(result.end(), c.hold, c.hold + 3);
    result.insert(result.end(), c.force, c.force + 3);
  }
  return result;
}

TEST_P(FaceContactOnGpu, SameBitsRunAfterRun) {
  std::vector<std::uint64_t> checksums[2];
  std::vector<float> held[2];
  for (int run = 0; run < 2; ++run) {
    CudaMpmTissue tissue(inviscid(free_box(Vec3(0.031, 0.029, 0.017), 0.002)));
    const float dt = 0.5f * tissue.stable_substep();
    press(tissue, dt);
    if (HasFatalFailure()) return;
    for (int f = 0; f < 10; ++f) {
      advance_by(tissue, 20, dt, {});
      EXPECT_FALSE(tissue.finish().blew_up);
      checksums[run].push_back(tissue.checksum());
      tissue.pull();
      const std::vector<float> now = holds(tissue.state().faces);
      held[run].insert(held[run].end(), now.begin(), now.end());
    }
  }
  EXPECT_EQ(checksums[0], checksums[1]);
  EXPECT_GT(held[0].size(), 9u * 100);
  EXPECT_EQ(held[0], held[1]);
}

TEST_P(FaceContactOnGpu, TheEndOfAFrameSearchesForTheNext) {
  CudaMpmTissue tissue(inviscid(free_box(Vec3(0.031, 0.029, 0.017), 0.002)));
  const int n = static_cast<int>(std::ceil(kHorizon / tissue.stable_substep()));
  for (int frame = 0; frame < 3; ++frame) {
    advance_by(tissue, n, static_cast<float>(kHorizon / n), {});
    EXPECT_FALSE(tissue.finish().blew_up);
    EXPECT_NEAR(tissue.state().faces.until_search, kHorizon, 1e-5);
  }
}

INSTANTIATE_TEST_SUITE_P(Shapes, FaceContactOnGpu,
                         testing::Values(nullptr, "4 4 4 32 0", "16 4 1 128 1", "6 5 8 32 0"));

}  // namespace
}  // namespace tissue_sim
#else
TEST(FaceContactOnGpu, NeedsABuildWithNvcc) { GTEST_SKIP() << "built without nvcc"; }
#endif
