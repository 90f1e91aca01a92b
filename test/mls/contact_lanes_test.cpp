// What faces that touch compute is one code for a CPU's vectors and a GPU's floats: both agree.
#include <gtest/gtest.h>

#include <random>

#include "mls/face_contact.h"

namespace tissue_sim {
namespace {

constexpr int kLanes = 8;
using Lanes = Vec<kLanes>;
using Mask = decltype(less(Lanes{}, Lanes{}));

struct Random {
  std::mt19937 engine{1};
  float operator()(float low = -1, float high = 1) {
    return std::uniform_real_distribution<float>(low, high)(engine);
  }
  void unit(float* n) {
    do {
      for (int a = 0; a < 3; ++a) n[a] = (*this)();
    } while (mls_contact::dot(n, n) < 0.01f);
    const float length = std::sqrt(mls_contact::dot(n, n));
    for (int a = 0; a < 3; ++a) n[a] /= length;
  }
};

/// So many numbers of each lane.
template <int N>
struct Numbers {
  float lane[kLanes][N] = {};
  Lanes all[N] = {};
  const Lanes* together() {
    for (int l = 0; l < kLanes; ++l) {
      for (int k = 0; k < N; ++k) all[k][l] = lane[l][k];
    }
    return all;
  }
};

TEST(MlsContactLanes, GapsAreThoseOfFloats) {
  Random random;
  for (int round = 0; round < 2000; ++round) {
    Numbers<3> rest, now, normal_low, normal_high;
    Numbers<4> face_low, face_high;
    for (int l = 0; l < kLanes; ++l) {
      for (int a = 0; a < 3; ++a) {
        rest.lane[l][a] = random();
        now.lane[l][a] = rest.lane[l][a] + 0.3f * random();
      }
      random.unit(face_low.lane[l]);
      random.unit(face_high.lane[l]);
      face_low.lane[l][3] = random(0.2f, 0.4f);
      face_high.lane[l][3] = random(0.2f, 0.4f);
      random.unit(normal_low.lane[l]);
      random.unit(normal_high.lane[l]);
      for (int a = 0; a < 3; ++a) {  // of one kind each: unknown, opposed, both unknown
        if (l == 1 || l == 3) normal_low.lane[l][a] = 0;
        if (l == 2 || l == 3) normal_high.lane[l][a] = 0;
        if (l == 4) normal_high.lane[l][a] = -normal_low.lane[l][a];
      }
    }
    const float edge = random(0.3f, 0.9f);
    Lanes n[3];
    const Lanes gap =
        mls_gap(rest.together(), now.together(), face_low.together(), face_high.together(),
                normal_low.together(), normal_high.together(), all_lanes<Lanes>(edge), n);
    for (int l = 0; l < kLanes; ++l) {
      float n_of[3];
      const float one = mls_gap(rest.lane[l], now.lane[l], face_low.lane[l], face_high.lane[l],
                                normal_low.lane[l], normal_high.lane[l], edge, n_of);
      ASSERT_NEAR(gap[l] / one, 1, std::fabs(one) > 1 ? 1e-5 : 1e-5 / std::fabs(one)) << l;
      for (int a = 0; a < 3; ++a) ASSERT_NEAR(n[a][l], n_of[a], 1e-5) << l;
    }
  }
}

TEST(MlsContactLanes, FacesTurnAsThoseOfFloats) {
  Random random;
  for (int round = 0; round < 2000; ++round) {
    Numbers<9> F;
    Numbers<4> face;
    Mask bears, knows;
    for (int l = 0; l < kLanes; ++l) {
      const float most = l < 4 ? 0.3f : 1.0f;  // the latter are turned inside out, too
      for (int k = 0; k < 9; ++k) F.lane[l][k] = (k % 4 == 0 ? 1.0f : 0.0f) + most * random();
      random.unit(face.lane[l]);
      bears[l] = l % 2 == 0 ? -1 : 0;
      knows[l] = l % 4 != 3 ? -1 : 0;
    }
    Lanes deformation[9], inverse[9], normal[3], couples;
    turn_mls_face(F.together(), face.together(), bears, knows, deformation, inverse, normal,
                  couples);
    for (int l = 0; l < kLanes; ++l) {
      MlsContactFace one;
      turn_mls_face(F.lane[l], face.lane[l], bears[l] != 0, knows[l] != 0, one.deformation,
                    one.inverse, one.normal, one.couples);
      ASSERT_EQ(couples[l], one.couples) << l;
      for (int k = 0; k < 9; ++k) {
        ASSERT_EQ(deformation[k][l], one.deformation[k]) << l;
        ASSERT_NEAR(inverse[k][l], one.inverse[k], 1e-4 * (1 + std::fabs(one.inverse[k]))) << l;
      }
      for (int a = 0; a < 3; ++a) ASSERT_NEAR(normal[a][l], one.normal[a], 1e-5) << l;
    }
  }
}

TEST(MlsContactLanes, PushesAreThoseOfFloats) {
  Random random;
  int slid = 0;
  for (int round = 0; round < 2000; ++round) {
    Numbers<3> d, n, held, apart;
    Numbers<7> of;  // gap, before, stiffness, damping, friction, couples
    for (int l = 0; l < kLanes; ++l) {
      random.unit(n.lane[l]);
      for (int a = 0; a < 3; ++a) {
        d.lane[l][a] = 1e-3f * random();
        held.lane[l][a] = 1e-4f * random();
        apart.lane[l][a] = held.lane[l][a] + 1e-5f * random();
      }
      const float before[] = {kMlsApart, -1e-5f, -1e-4f, 1e-5f};
      const float of_lane[] = {-random(1e-6f, 2e-4f),
                               before[l % 4],
                               random(1, 100),
                               random(0, 0.01f),
                               random(0, 0.8f),
                               l < 6 ? 1.0f : 0.0f,
                               l % 2 == 0 && l != 6 ? 1.0f : 0.0f};
      std::copy_n(of_lane, 7, of.lane[l]);
    }
    const Lanes* o = of.together();
    MlsPush<Lanes, Mask> push;
    apart.together();
    Mask holds{};
    for (int l = 0; l < kLanes; ++l) holds[l] = random() > 0.8f ? 0 : -1;
    push_mls_faces(d.together(), n.together(), o[0], o[1], held.together(), holds,
                   MlsSpringOfFaces<Lanes>{o[2], o[3], o[4], o[5], o[6]}, 1e-4f, apart.all, push);
    for (int l = 0; l < kLanes; ++l) {
      const float* x = of.lane[l];
      MlsPush<float, bool> one;
      push_mls_faces(d.lane[l], n.lane[l], x[0], x[1], held.lane[l], holds[l] != 0,
                     MlsSpringOfFaces<float>{x[2], x[3], x[4], x[5], x[6]}, 1e-4f, apart.lane[l],
                     one);
      ASSERT_EQ(push.begins[l] != 0, one.begins) << l;
      ASSERT_EQ(push.slides[l] != 0, one.slides) << l;
      slid += one.slides ? 1 : 0;
      for (int a = 0; a < 3; ++a) {
        ASSERT_NEAR(push.force[a][l], one.force[a], 1e-7 + 1e-4 * std::fabs(one.force[a])) << l;
        ASSERT_NEAR(push.at[a][l], one.at[a], 1e-9) << l;
        ASSERT_NEAR(push.slide[a][l], one.slide[a], 1e-9) << l;
        ASSERT_NEAR(apart.all[a][l], apart.lane[l][a], 1e-9) << l;
      }
    }
  }
  EXPECT_GT(slid, 1000);
}

// It comes from behind, through the other's side: what lies that deep does not push it through.
TEST(MlsContactLanes, WhatComesFromBehindIsNotThrownOut) {
  const float edge = 0.006f, place[2][3] = {{0, 0, 0}, {0.05f, 0, 0}};
  const float face[2][4] = {{0, 0, 1, 0.003f}, {0, 0, -1, 0.003f}};
  MlsContactFace of[2];
  MlsSlip slip = {};
  slip.gap = kMlsApart;
  const float F[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double most = 0;
  for (int step = 0; step < 130; ++step) {
    // From aside, behind the face by most of an edge, to the middle, and out along the normal.
    const float aside = 0.01f - 2e-4f * std::min(step, 50), out = 2e-4f * std::max(0, step - 50);
    const float u[2][3] = {{0, 0, 0}, {aside - 0.05f, 0, out - 0.005f}};
    for (int k = 0; k < 2; ++k) {
      set_mls_contact_face(F, face[k], kMlsBearsCouples, of[k]);
      of[k].weights = 1;
    }
    const auto side = [&](int k) {
      return MlsContactSide{place[k], u[k], face[k], &of[k], {10, 1e-9f}, edge, 0};
    };
    float force[3], at[3];
    if (!touch_mls_faces(side(0), side(1), 1e-4f, slip, force, at)) continue;
    most = std::max<double>(most, std::fabs(force[2]));
  }
  EXPECT_LT(most, 1e-6);
  // And pushes as any other when it comes back along the normal.
  float force[3], at[3];
  const float u[2][3] = {{0, 0, 0}, {-0.05f, 0, 0.0055f}};
  ASSERT_TRUE(touch_mls_faces({place[0], u[0], face[0], &of[0], {10, 1e-9f}, edge, 0},
                              {place[1], u[1], face[1], &of[1], {10, 1e-9f}, edge, 0}, 1e-4f, slip,
                              force, at));
  EXPECT_NEAR(
      force[2],
      -5 * 0.0005 * std::pow(1 - (0.0055 * 0.0055 - 0.006 * 0.006) / std::pow(1.1 * edge, 2), 2),
      1e-4);
}

// Each is squeezed flat and springs back in turn, and each time the faces slide a little.
TEST(MlsContactLanes, PlacesHeldByNodesThatAreSqueezedFlatStayWhereTheyTouch) {
  const float edge = 0.006f, place[2][3] = {{0, 0, 0}, {0, 0, 0.0059f}};
  const float face[2][4] = {{0, 0, 1, 0.003f}, {0, 0, -1, 0.003f}};
  MlsContactFace of[2];
  MlsSlip slip = {};
  slip.gap = kMlsApart;
  double farthest = 0;
  for (int step = 0; step < 200; ++step) {
    const float u[2][3] = {{0, 0, 0}, {1e-4f * (step % 3), 0, -0.001f}};
    for (int k = 0; k < 2; ++k) {
      const float flat = step % 2 == k ? 0.1f : 1.0f, F[9] = {flat, 0, 0, 0, 1, 0, 0, 0, 1};
      set_mls_contact_face(F, face[k], kMlsBearsCouples, of[k]);
      of[k].weights = 1;
    }
    const auto side = [&](int k) {
      return MlsContactSide{place[k], u[k], face[k], &of[k], {10, 1e-9f}, edge, 0.3f};
    };
    float force[3], at[3];
    ASSERT_TRUE(touch_mls_faces(side(0), side(1), 1e-4f, slip, force, at)) << step;
    for (int a = 0; a < 3; ++a) {
      const float low = std::fabs(slip.low[a]), high = std::fabs(slip.high[a]);
      farthest = std::max<double>(farthest, std::max(low, high));
      ASSERT_TRUE(std::isfinite(force[a])) << step;
    }
  }
  EXPECT_LT(farthest, 100 * edge);
}

}  // namespace
}  // namespace tissue_sim
