// The fragment network says what NumPy says of the same weights, and refuses files that are not
// whole.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "fragments/network_file.h"
#include "mpm/fragment_features.h"
#include "support/cut_scenes.h"
#include "support/network_text.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

const TemporaryFolder folder;
const std::string kFile = folder.write("network.yaml", network_text());

TEST(FragmentNetwork, SaysWhatNumpySays) {  // of the same weights, in double, for x_i = sin i
  const FragmentNetwork network(kFile);
  float x[kPartingFeatureCount], out[kOutputs];
  for (int i = 0; i < kPartingFeatureCount; ++i) x[i] = static_cast<float>(std::sin(i));
  run_network(network.weights(), x, out);
  EXPECT_NEAR(out[0], -0.05491508, 5e-6);
  EXPECT_NEAR(out[1], 0.11494144, 5e-6);
  EXPECT_NEAR(network.horizon(), 1.0 / 120, 1e-9);
}

TEST(FragmentNetwork, TanhIsTanh) {
  for (double x = -12; x <= 12; x += 0.001) {
    EXPECT_NEAR(hidden_tanh(static_cast<float>(x)), std::tanh(static_cast<float>(x)), 4e-7) << x;
  }
}

std::string why_refused(const std::string& text) {
  const std::string path = folder.write("changed.yaml", text);
  try {
    FragmentNetwork network(path);
  } catch (const std::invalid_argument& e) {
    EXPECT_EQ(std::string(e.what()).find(path), 0u) << "names the file";
    return e.what();
  }
  return "";
}

TEST(FragmentNetwork, RefusesFilesThatAreNotWhole) {
  const std::string whole = network_text();
  EXPECT_EQ(why_refused(whole), "");
  const auto changed = [&](const std::string& from, const std::string& to) {
    std::string text = whole;
    text.replace(text.find(from), from.size(), to);
    return why_refused(text);
  };
  const auto says = [](const std::string& why, const char* what) {
    EXPECT_NE(why.find(what), std::string::npos) << why;
  };
  says(changed("version: 3", "version: 2"), "version 3");
  says(changed("shape: [36, 54, 2]", "shape: [36, 50, 2]"), "shape");
  says(changed("hidden_weights: [", "hidden_weights: [0.5, "), "it must be 1944");
  says(changed("hidden_biases: [\n    ", "hidden_biases: [\n    1"), "checksum");
  says(changed("classifier:", "other:"), "classifier is missing");
  says(why_refused(""), "version 3");
  says(why_refused("[1, 2"), "no fragment network");
  EXPECT_THROW(FragmentNetwork("/no/such/file"), std::invalid_argument);
}

/// A body whose nodes follow u = (A - 1) X.
void stretch(MpmTissue& tissue, const Eigen::Matrix3d& A) {
  MpmState& s = tissue.state();
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      const Vec3 u = (A - Eigen::Matrix3d::Identity()) * b.node_position(i, j, k);
      for (int a = 0; a < 3; ++a) s.nodes.u[a][node] = static_cast<float>(u[a]);
    });
  }
  measure_motion(s);
}

Scene tearing_box() {
  Scene scene = free_box(Vec3(0.016, 0.012, 0.008), 0.002);
  Material m;
  m.name = "torn";
  m.tear_stretch = 1.3;
  scene.materials = {m};
  scene.bodies[0].material = "torn";
  return scene;
}

TEST(FragmentFeatures, AreGradientAndMassOfSevenCells) {
  MpmTissue tissue(tearing_box());
  Eigen::Matrix3d A;
  A << 1.2, 0.1, -0.05, 0.02, 0.9, 0.07, -0.03, 0.04, 1.1;
  stretch(tissue, A);
  const LatticeBody& body = tissue.state().bodies[0];
  for (const auto& [x, expected] : std::vector<std::pair<int, double>>{{8, 1}, {0, 0}}) {
    float f[kFeatureCount];
    fragment_features(tissue.state(), body.point(x, 6, 4), f);
    for (int cell = 0; cell < kFeatureCells; ++cell) {
      const bool missing = cell == 1 && expected == 0;  // beyond the body's end
      for (int i = 0; i < 9; ++i) {
        const double F = missing ? i % 4 == 0 : A(i / 3, i % 3);
        EXPECT_NEAR(f[10 * cell + i], F, 2e-5) << x << " " << cell << " " << i;
      }
      EXPECT_NEAR(f[10 * cell + 9], missing ? 0 : 1, 1e-5) << x << " " << cell;
    }
  }
}

TEST(FragmentFeatures, SeeNothingAcrossACut) {
  MpmTissue tissue(tearing_box());
  cut_now(tissue, plane_cut(Vec3(0.008, 0.006, 0.004), Vec3(1, 0, 0)));
  const LatticeBody& body = tissue.state().bodies[0];
  float f[kFeatureCount];
  fragment_features(tissue.state(), body.point(8, 6, 4), f);
  EXPECT_EQ(f[19], 0);          // at -x, where the cut is
  EXPECT_NEAR(f[29], 1, 1e-5);  // at +x
}

FragmentCandidates candidates_of(MpmTissue& tissue) {
  return fragment_candidates(tissue.state(), tissue.pieces(),
                             find_strained(tissue.state(), kRegionLevels[0]));
}

TEST(FragmentFeatures, CandidatesAreNearTheirLimitOrStrainedBesideBrokenBonds) {
  MpmTissue tissue(tearing_box());
  EXPECT_EQ(candidates_of(tissue).groups(), 0);
  Eigen::Matrix3d A = Eigen::Matrix3d::Identity();
  A(0, 0) = 1.22;  // 0.73 of the limit's strain
  stretch(tissue, A);
  const FragmentCandidates all = candidates_of(tissue);
  EXPECT_EQ(all.points.size(), static_cast<std::size_t>(tissue.point_count()));
  EXPECT_EQ(all.groups(), 8 * 6 * 4) << "one a cell";
  A(0, 0) = 1.19;  // 0.63
  stretch(tissue, A);
  EXPECT_EQ(candidates_of(tissue).groups(), 0);
  MpmTissue notched(tearing_box());
  cut_now(notched, upright_blade({{0.0081, -0.01, 0}, {0.0081, 0.006, 0}}));
  EXPECT_EQ(candidates_of(notched).groups(), 0) << "at rest";
  stretch(notched, A);
  std::set<std::int32_t> near_limit;  // the faces of the notch, which it did not move
  for (const StrainedPoint& p : find_strained(notched.state(), kCandidateShare)) {
    near_limit.insert(p.point);
  }
  const FragmentCandidates beside = candidates_of(notched);
  EXPECT_GT(beside.points.size(), 20u);
  for (int g = 0; g < beside.groups(); ++g) {
    for (int i = beside.first[g]; i < beside.first[g + 1]; ++i) {
      const std::int32_t p = beside.points[i];
      const MpmState& s = notched.state();
      EXPECT_TRUE(s.points.bonds[p] != whole_bonds(s.bodies[0], s.points.site[p]) ||
                  near_limit.count(p) > 0);
      // All of a group see the same, but for what lies across a crack from some of them.
      float one[kFeatureCount], other[kFeatureCount];
      fragment_features(s, beside.points[beside.first[g]], one);
      fragment_features(s, p, other);
      for (int k = 0; k < kFeaturesOfCell; ++k) EXPECT_NEAR(one[k], other[k], 0.02);
    }
  }
}

/// Displacements of a box that is stretched more and more along x up to a place, past which it is
/// at rest: what lies beyond hangs on by the tissue at that place.
void stretch_up_to(MpmTissue& tissue, double place, double most) {
  MpmState& s = tissue.state();
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      const double x = std::min(place, b.node_position(i, j, k).x());
      s.nodes.u[0][node] = static_cast<float>(0.5 * most * x * x / place);
    });
  }
  measure_motion(s);
}

TEST(FragmentFeatures, RegionsHangOnByWhatIsNearItsLimit) {
  using namespace surroundings;
  MpmTissue tissue(tearing_box());  // 8 x 6 x 4 cells
  stretch_up_to(tissue, 0.012, 0.29);
  MpmState& s = tissue.state();
  const LatticeBody& body = s.bodies[0];
  const FragmentSurroundings around =
      fragment_surroundings(s, tissue.pieces(), find_strained(s, kRegionLevels[0]));
  const auto features = [&](int x) {
    std::vector<float> f(kAllFeatureCount);
    fragment_features(s, body.point(x, 6, 4), f.data());
    surrounding_features(s, tissue.pieces(), around, body.point(x, 6, 4), f.data());
    return f;
  };
  const std::vector<float> tip = features(15), middle = features(10), root = features(1);
  EXPECT_NEAR(tip[kRegion + 2], 0.3, 0.1) << "the end beyond the place";
  EXPECT_EQ(tip[kRegion + 6], 1) << "nothing is past its limit";
  EXPECT_LT(root[kRegion + 2], 0.75);
  EXPECT_GT(root[kRegion + 2], 0.4);
  EXPECT_NEAR(tip[kRegion + 3], 0.25 * std::log1p(tip[kRegion + 2] * 8 * 6 * 4), 1e-4);
  EXPECT_EQ(tip[kPiece], 1);
  EXPECT_GT(middle[kExcess], 0.6);
  EXPECT_LT(root[kExcess], 0.3);
  EXPECT_GT(root[kExcess + 2], root[kExcess + 1] + 0.05) << "more strain at +x";
  EXPECT_LT(root[kAlongGradient], -1) << "it lies behind the centre, seen along the gradient";
  EXPECT_NEAR(root[kAlongStretch], root[kAlongGradient], 0.01);
  EXPECT_EQ(middle[kRate], 0);
  EXPECT_EQ(middle[kBrokenInside], 0);
  for (std::size_t n = 0; n < s.nodes.size(); ++n) s.nodes.v[0][n] = 5 * s.nodes.u[0][n];
  std::vector<float> moving(kAllFeatureCount);
  const FragmentSurroundings then =
      fragment_surroundings(s, tissue.pieces(), find_strained(s, kRegionLevels[0]));
  fragment_features(s, body.point(15, 6, 4), moving.data());
  surrounding_features(s, tissue.pieces(), then, body.point(15, 6, 4), moving.data());
  EXPECT_GT(moving[kParting], 0) << "it leaves the rest behind";
  EXPECT_NEAR(moving[kParting], moving[kSpeed], 0.1 * moving[kSpeed]);
  fragment_features(s, body.point(10, 6, 4), moving.data());
  surrounding_features(s, tissue.pieces(), then, body.point(10, 6, 4), moving.data());
  const double c = wave_speed(s.scene.materials[0]);
  EXPECT_NEAR(moving[kRate], 5 * middle[kExcess] * 0.002 / c, 1e-3 * moving[kRate]);
}

TEST(FragmentFeatures, CountBrokenBonds) {
  using namespace surroundings;
  MpmTissue tissue(tearing_box());
  cut_now(tissue, plane_cut(Vec3(0.008, 0.006, 0.004), Vec3(1, 0, 0)));  // between two cells
  const MpmState& s = tissue.state();
  const FragmentSurroundings around = fragment_surroundings(s, tissue.pieces(), {});
  std::vector<float> f(kAllFeatureCount);
  fragment_features(s, s.bodies[0].point(8, 6, 4), f.data());
  surrounding_features(s, tissue.pieces(), around, s.bodies[0].point(8, 6, 4), f.data());
  EXPECT_EQ(f[kBroken], 1) << "to -x";
  for (int n = 1; n < 6; ++n) EXPECT_EQ(f[kBroken + n], 0) << n;
  EXPECT_EQ(f[kBrokenInside], 0);
  EXPECT_NEAR(f[kPiece], 0.5, 1e-6);
  EXPECT_NEAR(f[kRegion], 0.5, 1e-6);
}

/// Features of the middle of a box that is stretched along one axis and notched along the next.
std::vector<float> features_along(int axis) {
  const auto in_axes = [&](double x, double y, double z) {
    Vec3 v;
    v[axis] = x;
    v[(axis + 1) % 3] = y;
    v[(axis + 2) % 3] = z;
    return v;
  };
  Scene scene = tearing_box();
  scene.bodies[0].size = in_axes(0.016, 0.012, 0.012);
  scene.bodies[0].pose.position = in_axes(0.008, 0.006, 0.006);
  MpmTissue tissue(scene);
  MpmState& s = tissue.state();
  const LatticeBody& body = s.bodies[0];
  for (int y = 0; y < 4; ++y) {  // a notch from its side, between two cells
    for (int z = 0; z < 12; ++z) {
      const Vec3 at = in_axes(7, y, z), other = in_axes(8, y, z);
      const auto point = [&](const Vec3& v) {
        return body.point(static_cast<int>(v.x()), static_cast<int>(v.y()),
                          static_cast<int>(v.z()));
      };
      break_bond(kForwardBond + axis, s.points.bonds[point(at)], s.points.bonds[point(other)]);
    }
  }
  body.for_each_node([&](int node, int i, int j, int k) {
    const double x = body.node_position(i, j, k)[axis];
    s.nodes.u[axis][node] = static_cast<float>(0.1 * x + 10 * x * x);
  });
  measure_motion(s);
  std::vector<float> x(kPartingFeatureCount);
  const Vec3 at = in_axes(8, 4, 6);
  const std::int32_t point =
      body.point(static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z()));
  const FragmentSurroundings around =
      fragment_surroundings(s, tissue.pieces(), find_strained(s, kRegionLevels[0]));
  EXPECT_EQ(parting_features(s, tissue.pieces(), around, point, x.data()), axis);
  return x;
}

TEST(FragmentFeatures, AreTheSameAlongEachAxis) {
  const std::vector<float> x = features_along(0);
  EXPECT_GT(x[parting::kExcess], 0.5);
  EXPECT_GT(x[parting::kAlong], x[parting::kAlong + 1]) << "the more strained first";
  EXPECT_NEAR(x[parting::kAligned], 1, 1e-3);
  EXPECT_NEAR(x[parting::kLimit], 0.3, 1e-6);
  EXPECT_EQ(x[parting::kTearLength], 1.5);
  for (const int axis : {1, 2}) {
    const std::vector<float> other = features_along(axis);
    for (int i = 0; i < kPartingFeatureCount; ++i) EXPECT_NEAR(x[i], other[i], 2e-4) << i;
  }
}

TEST(FragmentNetwork, IsRefusedWhereItCannotBe) {
  Scene scene = tearing_box();
  scene.fragment_network = "/no/such/file.yaml";
  EXPECT_THROW(Simulation{scene}, std::invalid_argument);
  scene.fragment_network = kFile;
  scene.device = Device::kAuto;
  EXPECT_NO_THROW(Simulation{scene});
  scene.method = Method::kMls;
  EXPECT_THROW(Simulation{scene}, std::invalid_argument);
  scene.method = Method::kMpm;
  scene.fragment_network = "";
  EXPECT_THROW(Simulation{scene}, std::invalid_argument);
}

}  // namespace
}  // namespace tissue_sim
