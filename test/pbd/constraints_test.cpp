// Constraints against double precision, and packed lanes against one at a time.
#include "pbd/constraints.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <random>

#include "compute/simd.h"
#include "pbd/project.h"
#include "tissue_sim/types.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Random vertices some 1 apart, inverse masses between 0.5 and 2.
template <int N>
void scatter_vertices(std::mt19937& random, Vertex<float> (&v)[N]) {
  std::uniform_real_distribution<float> within(-0.3f, 0.3f), w(0.5f, 2);
  constexpr float kAt[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int i = 0; i < N; ++i) {
    v[i] = {kAt[i][0] + within(random), kAt[i][1] + within(random), kAt[i][2] + within(random),
            w(random)};
  }
}

template <int N>
float& coordinate(Vertex<float> (&v)[N], int i, int a) {
  return a == 0 ? v[i].x : a == 1 ? v[i].y : v[i].z;
}

template <int N>
float moved_by(const Vertex<float> (&v)[N], int i, int a) {
  return a == 0 ? v[i].moved.x : a == 1 ? v[i].moved.y : v[i].moved.z;
}

/// A projection moves vertices by w grad C dlambda: what it moves, over w, against the difference
/// quotient of C, up to one factor; and with the factor that XPBD asks for.
template <class Kind, class Value>
void expect_gradient(const float (&number)[Kind::kNumbers], const Value& value,
                     double factor_within, double most = 1e9, double most_of_step = 1e9) {
  std::mt19937 random(7);
  for (int round = 0; round < 50; ++round) {
    Vertex<float> v[Kind::kVertices];
    scatter_vertices(random, v);
    double gradient[Kind::kVertices][3], sum = 0;
    for (int i = 0; i < Kind::kVertices; ++i) {
      for (int a = 0; a < 3; ++a) {
        constexpr float kStep = 2e-3f;
        const float at = coordinate(v, i, a);
        coordinate(v, i, a) = at + kStep;
        const double up = value(v);
        coordinate(v, i, a) = at - kStep;
        const double down = value(v);
        coordinate(v, i, a) = at;
        gradient[i][a] = (up - down) / (2 * kStep);
        sum += v[i].w * gradient[i][a] * gradient[i][a];
      }
    }
    const double c = std::max(-most, std::min<double>(most, value(v))), inverse_h2 = 10;
    const double expected = -c / (sum + std::max(number[1] * inverse_h2, sum / most_of_step));
    Vertex<float> moved[Kind::kVertices];
    std::copy(v, v + Kind::kVertices, moved);
    float lambda[1] = {0};
    Kind::project(moved, number, static_cast<float>(inverse_h2), lambda);
    EXPECT_NEAR(lambda[0], expected, factor_within * std::fabs(expected) + 1e-6);
    for (int i = 0; i < Kind::kVertices; ++i) {
      for (int a = 0; a < 3; ++a) {
        const double by = moved_by(moved, i, a);
        EXPECT_NEAR(by, v[i].w * gradient[i][a] * expected, 2e-3 * std::fabs(expected) + 2e-6)
            << "vertex " << i << ", axis " << a;
      }
    }
  }
}

TEST(Constraint, DistanceFollowsItsGradient) {
  const float number[2] = {0.8f, 0.05f};
  expect_gradient<Distance>(
      number, [&](const Vertex<float>(&v)[2]) { return Distance::value(v, number); }, 1e-3);
}

TEST(Constraint, BendingFollowsItsGradient) {
  const float number[2] = {0.3f, 0.05f};
  expect_gradient<Bending>(
      number, [&](const Vertex<float>(&v)[4]) { return Bending::value(v, number); }, 3e-3,
      Bending::kMost, Bending::kMostOfStep);
}

TEST(Constraint, BendingIsTheArccosOfThePaper) {
  std::mt19937 random(3);
  for (int round = 0; round < 100; ++round) {
    Vertex<float> v[4];
    scatter_vertices(random, v);
    const auto at = [&v](int i) { return Vec3(v[i].x, v[i].y, v[i].z); };
    const Vec3 n0 = (at(2) - at(0)).cross(at(3) - at(0)), n1 = (at(3) - at(1)).cross(at(2) - at(1));
    const double cosine = n0.dot(n1) / (n0.norm() * n1.norm());
    EXPECT_NEAR(std::fabs(Bending::parts(v).angle), std::acos(cosine), 2e-4);
  }
}

TEST(Constraint, AngleIsWithinItsBound) {
  for (int i = -1000; i <= 1000; ++i) {
    const double angle = 3.14159 * i / 1000;
    const auto y = static_cast<float>(std::sin(angle)), x = static_cast<float>(std::cos(angle));
    EXPECT_NEAR(angle_of(y, x), angle, 1.2e-5);
  }
  EXPECT_EQ(angle_of(0.0f, 0.0f), 0);
}

/// Unit tetrahedron: Q is the identity.
void fill_identity(float* number) {
  std::fill(number, number + 9, 0.0f);
  number[0] = number[4] = number[8] = 1;
}

TEST(Constraint, StrainProjectionsEndAtARotation) {
  std::mt19937 random(5);
  float number[11];
  fill_identity(number);
  number[9] = number[10] = 1;
  for (int round = 0; round < 20; ++round) {
    Vertex<float> v[4];
    scatter_vertices(random, v);
    float none[1];
    for (int i = 0; i < 200; ++i) Strain::project(v, number, 1.0f, none);
    for (int i = 0; i < 3; ++i) {
      for (int j = i; j < 3; ++j) EXPECT_NEAR(Strain::value(v, number, i, j), 0, 1e-4);
    }
  }
}

TEST(Constraint, AnElasticTetrahedronAtRestStaysThere) {
  float number[11];
  fill_identity(number);
  for (const float stiff : {1e-3f, 1.0f, 1e3f}) {
    number[9] = 1 / (1.7e3f * stiff);
    number[10] = 1 / (1.2e4f * stiff);
    Vertex<float> v[4] = {{0, 0, 0, 1}, {1, 0, 0, 2}, {0, 1, 0, 3}, {0, 0, 1, 0.5f}};
    float lambda[2] = {0, 0};
    Elastic::project(v, number, 1.0f, lambda);
    for (int i = 0; i < 4; ++i) {
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(moved_by(v, i, a), 0, 1e-6) << stiff;
    }
  }
}

/// With a compliance so large that nothing moves far, multipliers are stresses: forces are those of
/// the energy.
TEST(Constraint, ElasticForcesAreTheEnergysSlope) {
  std::mt19937 random(11);
  float number[11];
  fill_identity(number);
  const double mu = 2, bulk = 9;
  number[9] = static_cast<float>(1 / mu);
  number[10] = static_cast<float>(1 / bulk);
  const auto energy = [&](const Vertex<float>(&v)[4]) {
    Eigen::Matrix3d f;
    for (int i = 0; i < 3; ++i) {
      f.col(i) = Vec3(v[i + 1].x - v[0].x, v[i + 1].y - v[0].y, v[i + 1].z - v[0].z);
    }
    const double j = f.determinant();
    return 0.5 * mu * (f.squaredNorm() - 3 * std::pow(j, 2.0 / 3)) + 0.5 * bulk * (j - 1) * (j - 1);
  };
  for (int round = 0; round < 20; ++round) {
    Vertex<float> v[4], moved[4];
    scatter_vertices(random, v);
    std::copy(v, v + 4, moved);
    float lambda[2] = {0, 0};
    constexpr float kInverseH2 = 1e4f;
    Elastic::project(moved, number, kInverseH2, lambda);
    for (int i = 0; i < 4; ++i) {
      for (int a = 0; a < 3; ++a) {
        constexpr float kStep = 2e-3f;
        const float at = coordinate(v, i, a);
        coordinate(v, i, a) = at + kStep;
        const double up = energy(v);
        coordinate(v, i, a) = at - kStep;
        const double down = energy(v);
        coordinate(v, i, a) = at;
        const double force = -(up - down) / (2 * kStep);
        const double push = moved_by(moved, i, a) / v[i].w * kInverseH2;
        EXPECT_NEAR(push, force, 0.02 * std::fabs(force) + 0.05);
      }
    }
  }
}

// Flattened to sheets, needles and points, and turned inside out: slivers are, when tissue lands.
TEST(Constraint, NoShapeMakesAnElasticTetrahedronGrow) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> within(-1, 1), w(0.5f, 2);
  float number[11];
  fill_identity(number);
  number[9] = number[10] = 0;
  for (int round = 0; round < 300; ++round) {
    Vertex<float> v[4];
    for (Vertex<float>& at : v) at = {within(random), within(random), within(random), w(random)};
    const float flat[] = {1, 0.1f, 1e-3f, -1};
    for (Vertex<float>& at : v) {
      at.x *= 3 * flat[round % 4];
      at.y *= 3 * flat[round / 4 % 4];
    }
    float largest = 0;
    for (int k = 0; k < 400; ++k) {
      float lambda[2] = {0, 0};
      Elastic::project(v, number, 1.0f, lambda);
      for (int i = 0; i < 4; ++i) {
        for (int a = 0; a < 3; ++a) {
          largest = std::max(largest, std::fabs(coordinate(v, i, a) + moved_by(v, i, a)));
        }
      }
    }
    EXPECT_LT(largest, 8) << round;
  }
}

TEST(Colours, NeighboursDiffer) {
  std::mt19937 random(1);
  std::vector<std::int32_t> vertices;
  for (int i = 0; i < 4000; ++i) vertices.push_back(static_cast<std::int32_t>(random() % 70));
  std::vector<std::int16_t> colour(1000, -1);
  const int count = find_colours(vertices, 4, 70, colour);
  EXPECT_GT(count, 64);  // more than a word of bits
  std::vector<std::vector<bool>> taken(count, std::vector<bool>(70, false));
  for (int c = 0; c < 1000; ++c) {
    std::vector<std::int32_t> own(vertices.begin() + 4 * c, vertices.begin() + 4 * c + 4);
    std::sort(own.begin(), own.end());
    own.erase(std::unique(own.begin(), own.end()), own.end());
    for (const std::int32_t v : own) {
      EXPECT_FALSE(taken[colour[c]][v]);
      taken[colour[c]][v] = true;
    }
  }
}

/// Each instruction set's lanes against the plain function.
template <class Kind, class Fill>
void expect_lanes(Project<Kind> Projections::*kind, const Fill& fill) {
  std::mt19937 random(9);
  for (const InstructionSet set :
       {InstructionSet::kSse2, InstructionSet::kAvx2, InstructionSet::kAvx512}) {
    if (set > instruction_set()) continue;
    constexpr int kCount = 37;  // not a multiple of the lanes
    ConstraintSet<Kind> constraints;
    Array<float> x, moved;
    std::vector<std::array<Vertex<float>, Kind::kVertices>> expected(kCount);
    for (int c = 0; c < kCount; ++c) {
      Vertex<float> v[Kind::kVertices];
      scatter_vertices(random, v);
      typename ConstraintSet<Kind>::Vertices at;
      for (int i = 0; i < Kind::kVertices; ++i) {
        at[i] = Kind::kVertices * c + i;
        for (const float f : {v[i].x, v[i].y, v[i].z, v[i].w}) x.push_back(f);
      }
      typename ConstraintSet<Kind>::Numbers number;
      fill(number.data());
      constraints.add(at, number);
      float plain[Kind::kNumbers], lambda[ConstraintSet<Kind>::kMultipliers] = {};
      std::copy(number.begin(), number.end(), plain);
      project_kind<Kind, false>(v, plain, 3.0f, lambda);
      std::copy(v, v + Kind::kVertices, expected[c].begin());
    }
    const int vertices = kCount * Kind::kVertices;
    x.resize(4 * (vertices + 4 * kLanes), 0.0f);
    for (int lane = 0; lane < kLanes; ++lane) {
      for (int k = 1; k < 4; ++k) x[4 * (vertices + 4 * lane + k) + k - 1] = 1;
    }
    moved.resize(x.size(), 0.0f);
    constraints.pack(vertices);
    ASSERT_EQ(constraints.begin.size(), 2u) << "one colour";
    (projections(set).*kind)(constraints.blocks.data(), static_cast<int>(constraints.blocks.size()),
                             3.0f, x.data(), moved.data(), nullptr);
    for (int c = 0; c < kCount; ++c) {
      for (int i = 0; i < Kind::kVertices; ++i) {
        const float* by = &moved[4 * (Kind::kVertices * c + i)];
        EXPECT_NEAR(by[0], expected[c][i].moved.x, 2e-5f) << name(set) << " " << c;
        EXPECT_NEAR(by[1], expected[c][i].moved.y, 2e-5f);
        EXPECT_NEAR(by[2], expected[c][i].moved.z, 2e-5f);
      }
    }
  }
}

TEST(Lanes, ProjectAsOneByOne) {
  expect_lanes<Distance>(&Projections::distance, [](float* n) { n[0] = 0.8f, n[1] = 0.02f; });
  expect_lanes<Bending>(&Projections::bending, [](float* n) { n[0] = 0.3f, n[1] = 0.02f; });
  expect_lanes<Strain>(&Projections::strain, [](float* n) {
    fill_identity(n);
    n[9] = 0.7f, n[10] = 0.4f;
  });
  expect_lanes<Elastic>(&Projections::elastic, [](float* n) {
    fill_identity(n);
    n[9] = 0.5f, n[10] = 0.1f;
  });
}

}  // namespace
}  // namespace pbd
}  // namespace tissue_sim
