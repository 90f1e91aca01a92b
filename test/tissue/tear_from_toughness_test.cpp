// Limits of tearing that come from toughness and the size of cells (`tear: measured`), by what is
// known of strips that part.
#include <algorithm>
#include <cmath>
#include <string>

#include "material/tear_limit.h"
#include "support/measured.h"
#include "tissue/each_method.h"

namespace tissue_sim {
namespace {

/// A strip two cells thick between two grips, notched along x in the middle of its height. Its
/// height comes to an even number of cells of each size, and its notch to the same place in one.
struct Strip {
  double young_modulus = 1e5, toughness = 100;  ///< [Pa], [J/m^2]
  double cell = 0.0016;                         ///< [m]
  double width = 0.04, height = 0.024;          ///< between the grips [m]
  double notch = 0.014;                         ///< about so deep [m]
};
constexpr double kGrip = 0.004;  // [m]

std::string numbers(double a, double b, double c) {
  return "[" + std::to_string(a) + ", " + std::to_string(b) + ", " + std::to_string(c) + "]";
}

Scene scene_of(const Strip& s, const MethodOnDevice& on) {
  std::string anchors;
  for (const double side : {-1.0, 1.0}) {
    const double at = 0.5 * side * s.height;
    anchors += (side < 0 ? "{name: bottom, box: {min: " : ", {name: top, box: {min: ") +
               numbers(-1, -1, side < 0 ? -1 : at) + ", max: " + numbers(1, 1, side < 0 ? at : 1) +
               "}}";
  }
  return scene_from_yaml(
      std::string("method: ") + name_of(on.method, kMethodNames) + "\ndevice: " +
      name_of(on.device, kDeviceNames) + "\nthreads: 1\ncell_size: " + std::to_string(s.cell) +
      "\nframe_rate: 1000\ndamping: 50\ngravity: [0, 0, 0]\nground: {enabled: false}\n"
      "materials: [{name: gel, poisson_ratio: 0.3, density: 1000, viscosity: 1, young_modulus: " +
      std::to_string(s.young_modulus) + ", toughness: " + std::to_string(s.toughness) +
      ", tear: measured}]\nbodies: [{material: gel, size: " +
      numbers(s.width, 2 * s.cell, s.height + 2 * kGrip) + ", anchors: [" + anchors + "]}]");
}

/// How a strip parted.
struct Parting {
  double force = 0;    ///< the largest [N]
  double stretch = 1;  ///< of its height, then
};

Parting pull_apart(const Strip& strip, const MethodOnDevice& on) {
  const Scene scene = scene_of(strip, on);
  Simulation simulation(scene);
  // Past the middle between two columns of points.
  const double column = 0.5 * strip.cell;
  const double notch = (std::round(strip.notch / column) + 0.25) * column;
  FrameRequest request;
  BladePath path;
  path.edge = {Vec3(0, -strip.cell * 2, 0), Vec3(0, strip.cell * 2, 0)};
  for (const double x : {-1e-3, notch}) {
    path.poses.push_back({Vec3(x - 0.5 * strip.width, 0, 0), Quat::Identity()});
  }
  request.cuts = {path};
  const Pose start = simulation.anchor(1);
  Parting parting;
  const double wave = std::sqrt(strip.young_modulus / 1000);  // [m/s]
  for (int i = 1; i < 2000; ++i) {
    Pose top = start;
    const double way = 0.015 * wave / scene.frame_rate * i;
    top.position.z() += way;
    request.anchors = {std::nullopt, top};
    const FrameResult r = simulation.advance_frame(request).result;
    request.cuts.clear();
    const double force = -r.anchor_loads[1].force.z();
    if (force > parting.force) parting = {force, 1 + way / strip.height};
    if (simulation.tissue().fragment_count() > 1 && force < 0.1 * parting.force) break;
  }
  EXPECT_GE(simulation.tissue().fragment_count(), 2) << "it parted";
  return parting;
}

/// The stretch at which a strip in pure shear has J for each area in its height [J/m^2 / m], by
/// its energy free to become thinner.
double pure_shear_stretch(const Strip& strip) {
  const Material m = scene_of(strip, {Method::kMpm, Device::kCpu}).materials[0];
  const double mu = lame_mu(m), lambda = lame_lambda(m);
  const auto energy = [&](double stretch) {
    double x = 1;  // fixed corotated, P_22 = 0
    for (int i = 0; i < 50; ++i) {
      x -= (2 * mu * (x - 1) + lambda * (stretch * x - 1) * stretch) /
           (2 * mu + lambda * stretch * stretch);
    }
    return mu * ((stretch - 1) * (stretch - 1) + (x - 1) * (x - 1)) +
           0.5 * lambda * (stretch * x - 1) * (stretch * x - 1);
  };
  double low = 1, high = 10;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (energy(middle) * strip.height < strip.toughness ? low : high) = middle;
  }
  return high;
}

class TearFromToughness : public EachMethod {
 protected:
  void SetUp() override {
    EachMethod::SetUp();
    if (IsSkipped()) return;
    if (GetParam().method == Method::kPbd) GTEST_SKIP() << "toughness is refused there";
  }
};
FOR_EACH_METHOD(TearFromToughness);

// Rivlin and Thomas 1953: what a crack in a wide strip releases for each area is the energy in the
// strip's height far ahead of it, wherever its tip is. From gel to rubber.
TEST_P(TearFromToughness, AWideStripTearsWhereItsHeightHoldsThatEnergy) {
  for (const auto& [young_modulus, toughness] :
       {std::pair<double, double>{2e4, 10}, {1e5, 100}, {1e6, 5000}}) {
    Strip strip;
    strip.young_modulus = young_modulus;
    strip.toughness = toughness;
    const double theory = pure_shear_stretch(strip);
    EXPECT_TRUE(is_within("wide strip, gel to rubber: strain at which it tears",
                          (pull_apart(strip, GetParam()).stretch - 1) / (theory - 1) - 1, 0.15))
        << toughness << " J/m^2, " << young_modulus << " Pa";
  }
}

TEST_P(TearFromToughness, ANotchedStripBearsTheSameInCellsOfAnySize) {
  Strip strip;
  strip.width = 0.024;
  strip.height = 0.056;
  strip.notch = 0.008;
  double least = 1e9, most = 0;
  for (const double cell : {0.002, 0.0016, 4e-3 / 3}) {
    strip.cell = cell;
    const double force = pull_apart(strip, GetParam()).force / (2 * cell);
    least = std::min(least, force);
    most = std::max(most, force);
  }
  EXPECT_TRUE(is_within("notched strip: force that breaks it, cells of 1.3 to 2 mm",
                        most / least - 1, 0.1));
}

TEST(TearLimit, StoresToughnessInItsHeight) {
  Material m;
  m.toughness = 100;
  for (const Law law : {Law::kFixedCorotated, Law::kNeoHookean}) {
    m.law = law;
    m.young_modulus = 1e8;  // small strain: E e^2 / 2 * 5/4
    const double strain = std::sqrt(2 * m.toughness / 1.25 / 0.01 / m.young_modulus);
    EXPECT_NEAR(tear_stretch_of(m, 0.01) - 1, strain, 0.02 * strain);
    m.young_modulus = 1e4;
    const double limit = tear_stretch_of(m, 0.01);
    EXPECT_NEAR(energy_of_pull(m, limit) * (0.5 + 0.75 / limit) * 0.01, m.toughness, 1e-6);
    EXPECT_NEAR(energy_of_pull(m, 1), 0, 1e-12);
  }
}

}  // namespace
}  // namespace tissue_sim
