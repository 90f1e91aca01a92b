#include <Eigen/Eigenvalues>
#include <algorithm>

#include "mpm/fragment_features.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

namespace s = surroundings;

/// Neighbours 1 to 6, of `count` of which excess and broken bonds are put into order.
void put(const float* all, int (&neighbours)[4], int count, float* excess, float* broken) {
  std::sort(neighbours, neighbours + count, [&](int a, int b) {
    const float of_a = all[s::kExcess + a], of_b = all[s::kExcess + b];
    return of_a != of_b ? of_a > of_b : all[s::kBroken + a - 1] > all[s::kBroken + b - 1];
  });
  for (int i = 0; i < count; ++i) {
    excess[i] = all[s::kExcess + neighbours[i]];
    broken[i] = all[s::kBroken + neighbours[i] - 1];
  }
}

}  // namespace

int parting_features(const MpmState& state, const Pieces& pieces,
                     const FragmentSurroundings& around, std::int32_t point, float* x) {
  float all[kAllFeatureCount];
  fragment_features(state, point, all);
  surrounding_features(state, pieces, around, point, all);
  Eigen::Matrix3d F;
  for (int i = 0; i < 9; ++i) F(i / 3, i % 3) = all[i];
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(F.transpose() * F);
  const Vec3 direction = solver.eigenvectors().col(2);
  int axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);

  std::copy_n(all + s::kExcess, 1, x + parting::kExcess);
  std::copy_n(all + s::kOther, 3, x + parting::kOther);  // and the rate
  x[parting::kBrokenInside] = all[s::kBrokenInside];
  int along[4] = {1 + 2 * axis, 2 + 2 * axis}, beside[4], count = 0;
  for (int n = 1; n < kFeatureCells; ++n) {
    if ((n - 1) / 2 != axis) beside[count++] = n;
  }
  const auto there = [&](const int* neighbours, int of) {
    return std::count_if(neighbours, neighbours + of,
                         [&](int n) { return all[n * kFeaturesOfCell + 9] > 0; });
  };
  x[parting::kThere] = 0.5f * static_cast<float>(there(along, 2));
  x[parting::kThere + 1] = 0.25f * static_cast<float>(there(beside, 4));
  put(all, along, 2, x + parting::kAlong, x + parting::kBrokenAlong);
  put(all, beside, 4, x + parting::kBeside, x + parting::kBrokenBeside);
  static_assert(parting::kTearLength - parting::kAround == s::kEnd - s::kRegion, "all are taken");
  std::copy_n(all + s::kRegion, s::kEnd - s::kRegion, x + parting::kAround);
  const LatticeBody& body = state.bodies[state.points.site[point].body];
  const Material& material = body.material_of(state.points, point);
  x[parting::kTearLength] = static_cast<float>(
      material.tear_length > 0 ? material.tear_length / body.cell_size : kTipBehind);
  x[parting::kLimit] = static_cast<float>(material.tear_stretch - 1);
  x[parting::kAligned] = static_cast<float>(direction[axis] * direction[axis]);
  return axis;
}

}  // namespace tissue_sim
