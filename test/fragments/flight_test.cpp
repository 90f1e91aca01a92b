// Fragments that fly: what taking off, flight and landing keep, and who flies.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "fragments/torn_bar.h"
#include "mpm/fragment_flight.h"
#include "mpm/fragment_forecast.h"
#include "mpm/tear/debris.h"
#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/network_text.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

constexpr double kGap = 0.004;

/// A box in two parts, the one at +x some way off; both deformed and shaken. Returns its id.
int part(MpmTissue& tissue) {
  cut_now(tissue, plane_cut(Vec3(0.010, 0.006, 0.004), Vec3(1, 0, 0)));
  EXPECT_EQ(tissue.fragment_count(), 2);
  MpmState& s = tissue.state();
  const LatticeBody& body = s.bodies[0];
  const int id = tissue.fragment_of(body.point(2 * body.nx - 1, 4, 4));
  deform(s);
  shake(s, 3, 1e-4);
  std::vector<std::uint8_t> moved(s.nodes.size(), 0);
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    if (tissue.fragment_of(p) != id) continue;
    for (int k = 0; k < 27; ++k) {
      const int n = s.fields->node(body, s.points.site[p], k);
      if (moved[n] == 0) s.nodes.u[0][n] += static_cast<float>(kGap);
      moved[n] = 1;
    }
  }
  measure_motion(s);
  return id;
}

Scene parted_box() {
  Scene scene = free_box(Vec3(0.016, 0.012, 0.008), 0.002);
  scene.device = Device::kCpu;
  scene.threads = 1;
  return scene;
}

Eigen::Matrix3d some_deformation() {
  Eigen::Matrix3d F;
  F << 1.05, 0.2, -0.1, -0.15, 0.95, 0.05, 0.1, -0.02, 1.02;
  return F;
}

void expect_same(const Momentum& a, const Momentum& b) {
  const double speed = a.linear.norm() / a.mass + 0.1;
  EXPECT_LT((a.centre - b.centre).norm(), 1e-8);
  EXPECT_LT((a.linear - b.linear).norm(), 1e-6 * a.mass * speed);
  EXPECT_LT((a.angular - b.angular).norm(), 2e-6 * a.mass * speed * 0.01);
}

TEST(FragmentFlight, TakesOffWithTheDeformationAndKeepsMomentum) {
  MpmTissue tissue(parted_box());
  const int id = part(tissue);
  MpmState& s = tissue.state();
  const Eigen::Matrix3d F = some_deformation();
  const Momentum before = tissue.momentum();
  const std::vector<float> other(s.nodes.u[1].begin(), s.nodes.u[1].end());
  ASSERT_TRUE(take_off(s, tissue.pieces(), id, F));
  EXPECT_GT(before.angular.norm(), 1e-9);
  expect_same(before, tissue.momentum());
  int points = 0;
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    if (tissue.fragment_of(p) != id) continue;
    ++points;
    const Points::Site& site = s.points.site[p];
    EXPECT_LT((deformation_gradient(s.bodies[0], site, *s.fields, s.nodes) - F).norm(), 1e-4);
  }
  EXPECT_GT(points, 50);
  ASSERT_EQ(s.flights.size(), 1u);
  for (std::size_t n = 0; n < other.size(); ++n) {  // nobody else moves
    if (s.flight_of_node[n] < 0) {
      EXPECT_EQ(s.nodes.u[1][n], other[n]);
    }
  }
}

TEST(FragmentFlight, FollowsAParabolaAndKeepsItsSpin) {
  Scene scene = parted_box();
  scene.gravity = Vec3(0.5, 0, -9.81);
  MpmTissue tissue(scene);
  const int id = part(tissue);
  MpmState& s = tissue.state();
  for (auto& v : s.nodes.v) v.assign(v.size(), 0.0f);
  for (std::size_t n = 0; n < s.nodes.size(); ++n) s.nodes.v[0][n] = 0;
  const LatticeBody& body = s.bodies[0];
  std::vector<std::uint8_t> seen(s.nodes.size(), 0);
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    if (tissue.fragment_of(p) != id) continue;
    for (int k = 0; k < 27; ++k) seen[s.fields->node(body, s.points.site[p], k)] = 1;
  }
  body.for_each_node([&](int, int i, int j, int k) {
    const NodeFields::Split* split = s.fields->split(body.node(i, j, k));
    const Vec3 x = body.node_position(i, j, k);
    const auto spin = [&](int n) {
      if (seen[n] == 0) return;
      s.nodes.v[0][n] = static_cast<float>(2 - 30 * x.y());  // away, turning about z and y
      s.nodes.v[1][n] = static_cast<float>(30 * x.x());
      s.nodes.v[2][n] = static_cast<float>(-15 * x.x());
    };
    if (split == nullptr) return spin(body.node(i, j, k));
    for (const auto& f : split->fields) spin(f.node);
  });
  measure_motion(s);
  ASSERT_TRUE(take_off(s, tissue.pieces(), id, some_deformation()));
  const FragmentFlight before = s.flights[0];
  constexpr float kStep = 1e-4f;
  constexpr int kSteps = 400;
  advance_by(tissue, kSteps, kStep, {});
  tissue.finish();
  ASSERT_EQ(s.flights.size(), 1u) << "nothing is in its way";
  const FragmentFlight& after = s.flights[0];
  const double t = kSteps * static_cast<double>(kStep);
  const Vec3 expected =
      before.centre + t * before.velocity + 0.5 * t * (t + kStep) * scene.gravity;  // leapfrog
  EXPECT_LT((after.centre - expected).norm(), 1e-7);
  EXPECT_LT((after.velocity - before.velocity - t * scene.gravity).norm(), 1e-5);
  EXPECT_LT((after.angular - before.angular).norm(), 1e-12 * before.angular.norm());
  EXPECT_LT((after.rotation * after.rotation.transpose() - Eigen::Matrix3d::Identity()).norm(),
            1e-9);
  EXPECT_GT((after.rotation - Eigen::Matrix3d::Identity()).norm(), 0.5);
  const auto energy = [](const FragmentFlight& f) {  // of the spin
    const Eigen::Matrix3d inertia = f.rotation * f.inertia * f.rotation.transpose();
    return 0.5 * f.angular.dot(inertia.ldlt().solve(f.angular));
  };
  EXPECT_NEAR(energy(after), energy(before), 1e-4 * energy(before));
  for (std::int32_t p = 0; p < s.points.size(); ++p) {  // as it was, but turned
    if (tissue.fragment_of(p) != id) continue;
    const Eigen::Matrix3d F = deformation_gradient(body, s.points.site[p], *s.fields, s.nodes);
    EXPECT_LT((F - after.rotation * some_deformation()).norm(), 2e-4);
  }
}

TEST(FragmentFlight, EndsOnTheGroundAndAgainstTissue) {
  Scene scene = parted_box();
  scene.ground.enabled = true;
  scene.gravity = Vec3(0, 0, -9.81);
  scene.bodies[0].pose.position.z() += 0.01;
  MpmTissue tissue(scene);
  const int id = part(tissue);
  MpmState& s = tissue.state();
  ASSERT_TRUE(take_off(s, tissue.pieces(), id, Eigen::Matrix3d::Identity()));
  int flew = 0;
  while (!s.flights.empty() && flew < 60) {
    tissue.advance(1.0 / 240, {});
    ASSERT_FALSE(tissue.finish().blew_up);
    ++flew;
  }
  EXPECT_GT(flew, 1);
  EXPECT_TRUE(s.flights.empty());
  for (int frame = 0; frame < 20; ++frame) tissue.advance(1.0 / 240, {});
  for (const Fragment& f : tissue.fragments()) EXPECT_GT(f.box.min.z(), -0.001);

  MpmTissue thrown(parted_box());  // at the other part
  const int thrown_id = part(thrown);
  for (std::int32_t p = 0; p < thrown.state().points.size(); ++p) {
    if (thrown.fragment_of(p) != thrown_id) continue;
    for (int k = 0; k < 27; ++k) {
      const MpmState& t = thrown.state();
      const int n = t.fields->node(t.bodies[0], t.points.site[p], k);
      thrown.state().nodes.v[0][n] = -1;
    }
  }
  measure_motion(thrown.state());
  const Momentum before = thrown.momentum();
  ASSERT_TRUE(take_off(thrown.state(), thrown.pieces(), thrown_id, Eigen::Matrix3d::Identity()));
  for (int frame = 0; frame < 10; ++frame) thrown.advance(1.0 / 240, {});
  EXPECT_TRUE(thrown.state().flights.empty());
  EXPECT_LT((thrown.momentum().linear - before.linear).norm(), 1e-4 * before.linear.norm());
}

/// The part at +x thrown off, turning.
void throw_off(MpmTissue& tissue, int id) {
  MpmState& s = tissue.state();
  std::vector<std::uint8_t> seen(s.nodes.size(), 0);
  for (std::int32_t p = 0; p < s.points.size(); ++p) {
    const Points::Site& site = s.points.site[p];
    if (tissue.fragment_of(p) != id) continue;
    for (int k = 0; k < 27; ++k) {
      const int n = s.fields->node(s.bodies[0], site, k);
      if (seen[n] != 0) continue;
      seen[n] = 1;
      s.nodes.v[0][n] += 1;
      s.nodes.v[1][n] += 60 * 0.001f * static_cast<float>(site.x - 12);
    }
  }
  measure_motion(s);
}

TEST(FragmentFlight, ByFramesIsTheSameAsBySubsteps) {
  Scene scene = parted_box();
  scene.gravity = Vec3(0.5, 0, -9.81);
  MpmTissue substeps(scene), frames(scene);
  for (MpmTissue* t : {&substeps, &frames}) {
    const int id = part(*t);
    throw_off(*t, id);
    ASSERT_TRUE(take_off(t->state(), t->pieces(), id, some_deformation()));
  }
  constexpr float kStep = 1e-4f;
  constexpr int kSteps = 40;
  MpmState& s = frames.state();
  for (int frame = 0; frame < 8; ++frame) {
    advance_by(substeps, kSteps, kStep, {});
    substeps.finish();
    std::vector<FragmentFlight> flights = std::move(s.flights);  // as where substeps do not fly
    s.flights.clear();
    index_flights(s);
    advance_by(frames, kSteps, kStep, {});
    frames.finish();
    s.flights = std::move(flights);
    index_flights(s);
    EXPECT_FALSE(fly_frame(s, kSteps * static_cast<double>(kStep), kSteps).empty());
    ASSERT_EQ(s.flights.size(), 1u) << frame;
  }
  const FragmentFlight &a = substeps.state().flights[0], &b = s.flights[0];
  EXPECT_LT((a.centre - b.centre).norm(), 2e-6);
  EXPECT_LT((a.velocity - b.velocity).norm(), 1e-4);
  EXPECT_LT((a.angular - b.angular).norm(), 5e-3 * a.angular.norm());
  EXPECT_GT((a.rotation - Eigen::Matrix3d::Identity()).norm(), 0.1);
  EXPECT_LT((a.rotation - b.rotation).norm(), 5e-3);
}

TEST(FragmentFlight, ByFramesEndsWhereSomethingWasTouched) {
  MpmTissue tissue(parted_box());
  const int id = part(tissue);
  throw_off(tissue, id);
  MpmState& s = tissue.state();
  ASSERT_TRUE(take_off(s, tissue.pieces(), id, Eigen::Matrix3d::Identity()));
  for (const std::int32_t n : s.flights[0].nodes) s.nodes.v[0][n] -= 0.05f;  // pushed by something
  const std::vector<float> before(s.nodes.u[0].begin(), s.nodes.u[0].end());
  EXPECT_TRUE(fly_frame(s, 1e-3, 10).empty());
  EXPECT_TRUE(s.flights.empty());
  EXPECT_TRUE(std::equal(before.begin(), before.end(), s.nodes.u[0].begin()));
}

TEST(FragmentFlight, NumbersAreNormal) {
  double sum = 0, squares = 0, product = 0, last = 0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const double x = standard_normal(7, i);
    sum += x;
    squares += x * x;
    product += x * last;
    last = x;
  }
  EXPECT_NEAR(sum / kCount, 0, 0.02);
  EXPECT_NEAR(squares / kCount, 1, 0.03);
  EXPECT_NEAR(product / kCount, 0, 0.02);
  EXPECT_EQ(standard_normal(7, 5), standard_normal(7, 5));
  EXPECT_NE(standard_normal(7, 5), standard_normal(8, 5));
}

const TemporaryFolder folder;
const std::string kNetwork = folder.write("network.yaml", network_text());

struct Flown {
  int flown = 0;
  Momentum before, after;
  std::vector<std::uint64_t> checksums;
};

Flown fly_bar(float probability, int threads, bool restored = false) {
  Scene scene = torn_bar(kNetwork);
  scene.threads = threads;
  auto tissue = std::make_unique<MpmTissue>(scene);
  const FragmentClassifier classifier = [=](const MpmState&, std::int32_t, const float*) {
    return probability;
  };
  tissue->foresight().classifier = classifier;
  set_going(tissue->state());
  measure_motion(tissue->state());
  Flown result;
  result.before = tissue->momentum();
  for (int frame = 0; frame < 30; ++frame) {
    if (restored && tissue->foresight().flown > 0) {
      const std::vector<std::uint8_t> saved = tissue->save();
      tissue = std::make_unique<MpmTissue>(scene);
      tissue->foresight().classifier = classifier;
      tissue->restore({saved.data(), saved.size()});
      restored = false;
    }
    tissue->advance(1.0 / 960, {});
    EXPECT_FALSE(tissue->finish().blew_up);
    result.checksums.push_back(tissue->checksum());
  }
  result.after = tissue->momentum();
  result.flown = tissue->foresight().flown;
  return result;
}

TEST(FragmentFlight, ForeseenPiecesFlyAndMomentumStays) {
  const Flown expected = fly_bar(0.9f, 1), unexpected = fly_bar(0.1f, 1);
  EXPECT_GT(expected.flown, 0);
  EXPECT_EQ(unexpected.flown, 0);
  EXPECT_NE(expected.checksums, unexpected.checksums);
  for (const Flown* f : {&expected, &unexpected}) {
    EXPECT_LT((f->after.linear - f->before.linear).norm(), 1e-4 * f->before.mass * 0.1);
    EXPECT_LT((f->after.angular - f->before.angular).norm(), 2e-3 * f->before.angular.norm());
  }
}

TEST(FragmentFlight, BitsAreTheSame) {
  const Flown one = fly_bar(0.9f, 1), two = fly_bar(0.9f, 2), restored = fly_bar(0.9f, 1, true);
  EXPECT_EQ(one.checksums, two.checksums);
  EXPECT_EQ(one.checksums, restored.checksums);
}

}  // namespace
}  // namespace tissue_sim
