// Cuts of meshes: what comes apart, volumes, momentum, and how thin triangles get.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <random>
#include <set>
#include <string>
#include <vector>

#include "pbd/model.h"
#include "pbd/pbd_pieces.h"
#include "pbd/pbd_tissue.h"
#include "tissue_sim/simulation.h"
#include "tools/tool_motion.h"

namespace tissue_sim {
namespace {

/// An ellipsoid about the origin in free space.
Scene lobe(PbdModel model) {
  Scene scene;
  scene.method = Method::kPbd;
  scene.pbd.model = model;
  scene.cell_size = model == PbdModel::kSurface ? 0.003 : 0.005;
  scene.gravity = Vec3::Zero();
  scene.ground.enabled = false;
  scene.bodies.resize(1);
  scene.bodies[0].shape = Shape::kEllipsoid;
  scene.bodies[0].radii = Vec3(0.055, 0.031, 0.020);
  return scene;
}

BladePath stroke(const Vec3& a, const Vec3& b, const std::vector<Vec3>& places) {
  BladePath path;
  path.edge = {a, b};
  for (const Vec3& place : places) path.poses.push_back({place, Quat::Identity()});
  return path;
}

const Vec3 kUp(0, 0, 0.1);

BladePath plane_at(double x) { return stroke(-kUp, kUp, {Vec3(x, -0.1, 0), Vec3(x, 0.1, 0)}); }

/// Share of the lobe beyond x.
double share_beyond(double x) {
  const double s = x / 0.055;
  return (2 - 3 * s + s * s * s) / 4;
}

double whole_volume(Tissue& tissue) {
  double sum = 0;
  for (const Fragment& f : tissue.fragments()) sum += f.volume;
  return sum;
}

struct Thinnest {
  double edge = 1e9, angle = 4;  ///< [m], [rad]
};

Thinnest thinnest(const pbd::State& s) {
  Thinnest least;
  for (const pbd::Triangle& t : s.triangles) {
    for (int i = 0; i < 3; ++i) {
      const Vec3& x = s.vertices.reference[t[i]];
      const Vec3 a = s.vertices.reference[t[(i + 1) % 3]] - x;
      const Vec3 b = s.vertices.reference[t[(i + 2) % 3]] - x;
      least.edge = std::min(least.edge, a.norm());
      least.angle =
          std::min(least.angle,
                   std::acos(std::max(-1.0, std::min(1.0, a.normalized().dot(b.normalized())))));
    }
  }
  return least;
}

/// Pieces whose surface has a hole of more than a hundredth of itself: what it encloses depends on
/// where it is looked at from. The lips of a slit lie on one another and make no hole.
struct Leaks {
  int pieces = 0;
  double volume = 0;  ///< of those pieces [m^3]
};

Leaks leaks(const pbd::State& s) {
  UnionFind linked = pbd::joined(s);
  std::map<std::int32_t, std::pair<Vec3, double>> skin;  // twice the sum of area times normal; area
  for (const pbd::Triangle& t : s.triangles) {
    const auto& x = s.vertices.reference;
    const Vec3 n = (x[t[1]] - x[t[0]]).cross(x[t[2]] - x[t[0]]);
    auto& of = skin.try_emplace(linked.root(t[0]), Vec3::Zero(), 0.0).first->second;
    of.first += n;
    of.second += n.norm();
  }
  Leaks found;
  std::set<std::int32_t> open;
  for (const auto& [piece, of] : skin) {
    const double hole = of.first.norm() / of.second;
    if (hole > 0.01) open.insert(piece);
  }
  found.pieces = static_cast<int>(open.size());
  for (int i = 0; i < s.vertices.size(); ++i) {
    if (open.count(linked.root(i)) != 0) found.volume += s.vertices.volume[i];
  }
  return found;
}

class CutMeshes : public testing::TestWithParam<PbdModel> {
 protected:
  void expect_sound(Simulation& simulation, double volume) {
    auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
    EXPECT_NEAR(whole_volume(tissue) / volume, 1, 0.01);
    for (int f = 0; f < 30; ++f) {
      const FrameResult r = simulation.advance_frame().result;
      ASSERT_FALSE(r.blew_up);
      EXPECT_LT(r.max_speed, 1e-3);
    }
    EXPECT_LT(tissue.momentum().linear.norm(), 1e-5 * tissue.momentum().mass);
  }
};

TEST_P(CutMeshes, APlanePartsInTwo) {
  Simulation simulation(lobe(GetParam()));
  const double volume = whole_volume(simulation.tissue());
  simulation.cut(plane_at(0.0151));
  const CutReport report = simulation.advance_frame().result.cut_reports[0];
  EXPECT_EQ(report.new_fragments.size(), 1u);
  ASSERT_EQ(simulation.tissue().fragments().size(), 2u);
  EXPECT_NEAR(simulation.tissue().fragments()[1].volume / volume, share_beyond(0.0151), 0.01);
  expect_sound(simulation, volume);
}

TEST_P(CutMeshes, HalfACutPartsNothingAndTheOtherHalfDoes) {
  Simulation simulation(lobe(GetParam()));
  const double volume = whole_volume(simulation.tissue());
  simulation.cut(stroke(-kUp, kUp, {Vec3(-0.01, -0.1, 0), Vec3(-0.01, 0.001, 0)}));
  EXPECT_GT(simulation.advance_frame().result.cut_reports[0].bonds_broken, 0);
  EXPECT_EQ(simulation.tissue().fragments().size(), 1u);
  simulation.cut(stroke(-kUp, kUp, {Vec3(-0.01, 0, 0), Vec3(-0.01, 0.1, 0)}));
  simulation.advance_frame();
  ASSERT_EQ(simulation.tissue().fragments().size(), 2u);
  EXPECT_NEAR(simulation.tissue().fragments()[1].volume / volume, share_beyond(0.01), 0.02);
  expect_sound(simulation, volume);
}

TEST_P(CutMeshes, AWaveAndALevelCutMakeFour) {
  Simulation simulation(lobe(GetParam()));
  const double volume = whole_volume(simulation.tissue());
  std::vector<Vec3> wave;
  for (int i = 0; i <= 30; ++i) {
    const double u = i / 30.0;
    wave.push_back(Vec3(0.006 * std::sin(12 * u), 0.1 * (u - 0.5), 0));
  }
  simulation.cut(stroke(-kUp, kUp, wave));
  simulation.advance_frame();
  EXPECT_EQ(simulation.tissue().fragments().size(), 2u);
  simulation.cut(
      stroke(Vec3(-0.1, 0, 0), Vec3(0.1, 0, 0), {Vec3(0, -0.1, 0.002), Vec3(0, 0.1, 0)}));
  simulation.advance_frame();
  EXPECT_EQ(simulation.tissue().fragments().size(), 4u);
  expect_sound(simulation, volume);
}

// What closes a wound is the sheet that the blade swept, not the flattest one across.
TEST_P(CutMeshes, ABentCutPartsWhatLiesBehindIt) {
  const auto bent = [](double y) { return 0.008 + 0.008 * std::cos(40 * y); };
  std::vector<Vec3> places;
  for (int i = 0; i <= 40; ++i) {
    const double y = 0.0025 * (i - 20);
    places.push_back(Vec3(bent(y), y, 0));
  }
  Simulation simulation(lobe(GetParam()));
  const double volume = whole_volume(simulation.tissue());
  simulation.cut(stroke(-kUp, kUp, places));
  simulation.advance_frame();
  ASSERT_EQ(simulation.tissue().fragments().size(), 2u);
  int count = 0, all = 0;  // places of the ellipsoid, evenly
  for (double z = -0.0195; z < 0.02; z += 0.001) {
    for (double y = -0.0305; y < 0.031; y += 0.001) {
      for (double x = -0.0545; x < 0.055; x += 0.001) {
        if (Vec3(x / 0.055, y / 0.031, z / 0.020).squaredNorm() > 1) continue;
        ++all;
        count += x > bent(y) ? 1 : 0;
      }
    }
  }
  EXPECT_NEAR(simulation.tissue().fragments()[1].volume / volume, static_cast<double>(count) / all,
              0.005);
  expect_sound(simulation, volume);
}

// An instrument's blade: two millimetres a frame, and it waits on its way.
TEST_P(CutMeshes, AScalpelThatStopsAndGoesOnPartsInTwo) {
  Scene scene = lobe(GetParam());
  scene.tools.resize(1);
  scene.tools[0].type = ToolType::kScalpel;
  scene.tools[0].blade_length = 0.09;
  scene.bodies[0].anchors.resize(1);  // or the blade's flats would carry it along
  scene.bodies[0].anchors[0].kind = Region::Kind::kBox;
  scene.bodies[0].anchors[0].min = Vec3(-0.06, -0.04, -0.03);
  scene.bodies[0].anchors[0].max = Vec3(-0.03, 0.04, 0.03);
  Simulation simulation(scene);
  const double volume = whole_volume(simulation.tissue());
  const Quat cutting_along_y(Eigen::AngleAxisd(std::acos(-1) / 2, Vec3::UnitZ()));
  for (int f = 0; f <= 50; ++f) {
    const double y = -0.045 + 0.002 * (f < 20 ? f : f < 28 ? 20 : f - 8);
    simulation.set_tool(0, {Vec3(0.02, y, 0.045), cutting_along_y});
    ASSERT_FALSE(simulation.advance_frame().result.blew_up);
  }
  double largest_new = 0;
  for (const Fragment& f : simulation.tissue().fragments()) {
    if (f.parent >= 0) largest_new = std::max(largest_new, f.volume);
  }
  EXPECT_NEAR(largest_new / volume, share_beyond(0.02), 0.03);
  EXPECT_NEAR(whole_volume(simulation.tissue()) / volume, 1, 0.01);
}

// What is too small for the mesh to part stays whole, and the report says so.
TEST(SoundCuts, WhatStaysWholeIsSaid) {
  Simulation simulation(lobe(PbdModel::kSurface));
  simulation.cut(plane_at(0.0546));  // 0.07 of an edge cubed comes off the tip
  CutReport report = simulation.advance_frame().result.cut_reports[0];
  EXPECT_EQ(report.new_fragments.size(), 1u);
  EXPECT_EQ(report.pieces_left_whole, 0);
  EXPECT_EQ(report.why_left_whole, "");
  simulation.cut(stroke(Vec3(0.1, 0, 0.1), Vec3(0.1, 0, -0.1),
                        {Vec3(0, 0.0003, 0), Vec3(-0.0505, 0.0003, 0)}));
  report = simulation.advance_frame().result.cut_reports[0];
  EXPECT_GT(report.bonds_broken, 0) << "of the large piece";
  EXPECT_EQ(report.pieces_left_whole, 1);
  EXPECT_EQ(report.why_left_whole,
            "1 piece stays whole where the blade met it: a cut there would leave pieces smaller "
            "than what the mesh resolves");
  EXPECT_EQ(simulation.tissue().fragments().size(), 2u);
}

// Without a look at what it leaves, the second stroke left an angle of 1.2 degrees.
TEST(SoundCuts, AnInstrumentsStrokesLeaveNoSlivers) {
  Scene scene = lobe(PbdModel::kSurface);
  scene.damping = 5;
  scene.tools.resize(1);
  scene.tools[0].type = ToolType::kScalpel;
  scene.tools[0].blade_length = 0.09;
  scene.bodies[0].anchors.resize(1);
  scene.bodies[0].anchors[0].kind = Region::Kind::kBox;
  scene.bodies[0].anchors[0].min = Vec3(-0.06, -0.04, -0.03);
  scene.bodies[0].anchors[0].max = Vec3(-0.03, 0.04, 0.03);
  Simulation simulation(scene);
  auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
  const double volume = whole_volume(tissue);
  std::mt19937 random(4);
  std::uniform_real_distribution<double> at(-1, 1);
  for (int k = 0; k < 2; ++k) {
    const double x = 0.02 + 0.025 * at(random), slope = 0.4 * at(random);
    const Quat turned(Eigen::AngleAxisd(std::acos(-1) / 2 + slope, Vec3::UnitZ()));
    const auto go_to = [&](double along, double height) {
      simulation.set_tool(0, {Vec3(x - slope * along, along, height), turned});
      const FrameResult r = simulation.advance_frame().result;
      ASSERT_FALSE(r.blew_up);
      EXPECT_EQ(r.blade_report.pieces_left_whole > 0, !r.blade_report.why_left_whole.empty());
    };
    go_to(-0.045, 0.2);
    for (int f = 0; f <= 45; ++f) go_to(-0.045 + 0.002 * f, 0.045);
    go_to(0.06, 0.2);
    const Thinnest least = thinnest(tissue.state());
    EXPECT_GT(least.angle * 57.29578, 2.8) << "stroke " << k;
    EXPECT_GT(least.edge, 0.1 * tissue.state().mean_edge) << "stroke " << k;
    EXPECT_NEAR(whole_volume(tissue) / volume, 1, 0.01) << "stroke " << k;
  }
  EXPECT_GE(tissue.fragments().size(), 2u);  // the second stroke runs along the first one's wall
}

// As if the first half of the stroke had been left whole: with the second half the blade cuts both.
TEST(SoundCuts, WhatAnInstrumentLeftWholeIsCutWithWhatItSweepsNext) {
  for (const bool is_kept : {true, false}) {
    Scene scene = lobe(PbdModel::kSurface);
    scene.tools.resize(1);
    scene.tools[0].type = ToolType::kScalpel;
    scene.tools[0].blade_length = 0.09;
    scene.bodies[0].anchors.resize(1);
    scene.bodies[0].anchors[0].z = 1;
    Simulation simulation(scene);
    const Quat along_y(Eigen::AngleAxisd(std::acos(-1) / 2, Vec3::UnitZ()));
    const auto at = [&](double y) { return Pose{Vec3(0.01, y, 0.045), along_y}; };
    simulation.set_tool(0, at(0.001));
    simulation.advance_frame();  // there it is, and sweeps nothing
    auto& tissue = dynamic_cast<PbdTissue&>(simulation.tissue());
    ToolMotion first;
    first.present = true;
    first.begin = at(-0.045);
    first.end = at(is_kept ? 0.001 : 0.002);  // where the blade does not go on
    tissue.state().left_whole[0] = {{blade_path(scene.tools[0], first), 0}};
    simulation.set_tool(0, at(0.045));
    const CutReport report = simulation.advance_frame().result.blade_report;
    EXPECT_GT(report.bonds_broken, 0);
    EXPECT_EQ(report.pieces_left_whole, 0) << report.why_left_whole;
    EXPECT_EQ(tissue.fragments().size(), is_kept ? 2u : 1u);
    EXPECT_TRUE(tissue.state().left_whole[0].empty());
  }
}

// Two triangles that lie on one another have nothing between them that resists bending: such
// flakes, whose angle changes its sign by rounding, moved at 1 m/s beside strokes.
TEST(SoundCuts, AFlakeWithoutThicknessDoesNotResistBending) {
  const auto state = pbd::make_state(lobe(PbdModel::kSurface), nullptr);
  const int bends = state->bends.size();
  const std::int32_t a = pbd::add_vertex(*state, Vec3(0.1, 0, 0), 0),
                     b = pbd::add_vertex(*state, Vec3(0.103, 0, 0), 0),
                     c = pbd::add_vertex(*state, Vec3(0.1, 0.003, 0), 0),
                     d = pbd::add_vertex(*state, Vec3(0.1, 0, 0.003), 0);
  state->triangles.push_back({a, b, c});
  state->triangles.push_back({a, c, b});
  for (const std::int32_t v : {a, b, c, d}) state->stroke[v] = 0;  // on a wound
  pbd::make_surface_constraints(*state);
  EXPECT_EQ(state->bends.size(), bends);
  state->triangles.back() = {b, a, d};  // at right angles
  pbd::make_surface_constraints(*state);
  EXPECT_EQ(state->bends.size(), bends + 1);
}

/// No two links of a colour share a vertex.
void expect_proper_colours(const pbd::State& s) {
  std::set<std::pair<std::int32_t, std::int16_t>> taken;
  for (int c = 0; c < s.links.size(); ++c) {
    for (const std::int32_t v : s.links.vertices[c]) {
      EXPECT_TRUE(taken.insert({v, s.links.colour[c]}).second) << v;
    }
  }
}

// Random cuts leave pairs of vertices that an edge joins, and an internal link from before. Both
// got the edge's colour: one of them was lost, on a GPU either one.
TEST(SoundCuts, AnEdgeAndAnInternalLinkOfTheSamePairHaveColoursOfTheirOwn) {
  const auto state = pbd::make_state(lobe(PbdModel::kSurface), nullptr);
  const auto [a, b] = state->links.vertices.front();
  state->internal.insert(state->internal.begin(), {a, b, 1e-6, true});
  for (int round = 0; round < 2; ++round) {
    pbd::make_surface_constraints(*state);
    pbd::pack(*state);
    EXPECT_EQ(std::count(state->links.vertices.begin(), state->links.vertices.end(),
                         state->links.vertices.front()),
              2);
    expect_proper_colours(*state);
  }
}

// Of all constraints only those around a cut are made anew: the same as if all were.
TEST(SoundCuts, WhatIsKeptIsWhatWouldBeMadeAnew) {
  Simulation simulation(lobe(PbdModel::kSurface));
  auto& tissue = dynamic_cast<PbdTissue&>(simulation.tissue());
  const BladePath paths[] = {
      stroke(-kUp, kUp, {Vec3(-0.01, -0.1, 0), Vec3(-0.01, 0.001, 0)}), plane_at(0.0151),
      stroke(-kUp, kUp, {Vec3(-0.1, 0.003, 0), Vec3(0.1, 0.0042, 0)})};  // across both
  for (const BladePath& path : paths) {
    simulation.cut(path);
    ASSERT_GT(simulation.advance_frame().result.cut_reports[0].bonds_broken, 0);
    pbd::State& s = tissue.state();
    const auto links = s.links;
    const auto angles = s.bends;
    s.surface_edges = {};
    pbd::make_surface_constraints(s);
    EXPECT_EQ(s.links.vertices, links.vertices);
    EXPECT_EQ(s.links.numbers, links.numbers);
    EXPECT_EQ(s.links.colour, links.colour);
    EXPECT_EQ(s.bends.vertices, angles.vertices);
    EXPECT_EQ(s.bends.numbers, angles.numbers);
    EXPECT_EQ(s.bends.colour, angles.colour);
    expect_proper_colours(s);
  }
}

// Both sides of a wound get the same wall. Where a triangle lay across the rim of one of them,
// which the blade's sheet would have doubled, another wall once lost half a per cent of the volume.
TEST(SoundCuts, WallsOfBothSidesAreTheSame) {
  struct Wave {
    double x, height, lean;
  };
  for (const Wave& w : {Wave{-0.01, 0.004, 0.2}, Wave{0.01, 0.002, 0.6}}) {
    Simulation simulation(lobe(PbdModel::kSurface));
    const double volume = whole_volume(simulation.tissue());
    std::vector<Vec3> places;
    for (int i = 0; i <= 20; ++i) {
      const double y = 0.005 * (i - 10);
      places.push_back(Vec3(w.x + w.height * std::sin(60 * y + w.lean), y, 0));
    }
    simulation.cut(stroke(Vec3(-0.1 * w.lean, 0, -0.1), Vec3(0.1 * w.lean, 0, 0.1), places));
    simulation.advance_frame();
    ASSERT_EQ(simulation.tissue().fragments().size(), 2u) << w.x;
    EXPECT_NEAR(whole_volume(simulation.tissue()) / volume, 1, 2e-4) << w.x;
  }
}

/// A number of an environment's variable, for runs that are longer than a test's.
double asked(const char* name, double otherwise) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::atof(text) : otherwise;
}

// TISSUE_SIM_CUTS, TISSUE_SIM_CELL [m] and TISSUE_SIM_SEED ask for other runs.
TEST_P(CutMeshes, CutsAtRandomNeitherBlowUpNorLeakNorMakeSlivers) {
  const bool is_surface = GetParam() == PbdModel::kSurface;
  Scene scene = lobe(GetParam());
  scene.cell_size = asked("TISSUE_SIM_CELL", scene.cell_size);
  Simulation simulation(scene);
  auto& tissue = static_cast<PbdTissue&>(simulation.tissue());
  const double volume = whole_volume(tissue), mass = tissue.momentum().mass;
  std::mt19937 random(static_cast<unsigned>(asked("TISSUE_SIM_SEED", 4)));
  std::uniform_real_distribution<double> at(-1, 1);
  const int cuts = static_cast<int>(asked("TISSUE_SIM_CUTS", is_surface ? 100 : 40));
  double fastest = 0;
  int nothing = 0, left_whole = 0;
  const auto told = [&] {
    const Thinnest least = thinnest(tissue.state());
    const Leaks open = leaks(tissue.state());
    std::printf(
        "   %zu pieces, %d vertices, volume %.4f, smallest edge %.3f of the mean, angle %.2f "
        "degrees, fastest %.1e m/s; %d cuts did nothing, %d left pieces whole; with a hole: %d "
        "pieces, "
        "%.5f of the volume\n",
        tissue.fragments().size(), tissue.state().vertices.size(), whole_volume(tissue) / volume,
        least.edge / tissue.state().mean_edge, least.angle * 57.29578, fastest, nothing, left_whole,
        open.pieces, open.volume / volume);
    std::fflush(stdout);
    return least;
  };
  for (int i = 0; i < cuts; ++i) {
    const Vec3 from(0.05 * at(random), 0.03 * at(random), 0.02 * at(random));
    const Vec3 way = 0.03 * Vec3(at(random), at(random), at(random));
    const Vec3 edge = 0.02 * Vec3(at(random), at(random), at(random));
    simulation.cut(stroke(-edge, edge, {from, from + way}));
    const FrameResult r = simulation.advance_frame().result;
    ASSERT_FALSE(r.blew_up) << "cut " << i;
    const CutReport& report = r.cut_reports[0];
    nothing += report.bonds_broken == 0 && report.pieces_left_whole == 0 ? 1 : 0;
    left_whole += report.pieces_left_whole > 0 ? 1 : 0;
    fastest = std::max(fastest, r.max_speed);
    if ((i + 1) % 100 == 0 && i + 1 < cuts) {
      told();
      fastest = 0;
    }
    // Further on crumbs that come off fly: 0.05 m/s was the most in 1 000 cuts.
    EXPECT_LT(r.max_speed, i < 100 ? 0.01 : 0.1) << "cut " << i;
  }
  const Thinnest least = told();
  EXPECT_NEAR(whole_volume(tissue) / volume, 1, 0.01);
  EXPECT_NEAR(tissue.momentum().mass / mass, 1, 1e-6);
  EXPECT_GT(least.edge, 0.1 * tissue.state().mean_edge);
  EXPECT_LT(leaks(tissue.state()).volume / volume, 0.01);
  EXPECT_GT(least.angle * 57.29578, 2.8);
}

TEST_P(CutMeshes, AreTheSameBitsWithAnyNumberOfThreadsAndAfterRestoring) {
  std::uint64_t sums[3];
  std::vector<std::uint8_t> saved;
  for (int run = 0; run < 3; ++run) {
    Scene scene = lobe(GetParam());
    scene.threads = run == 0 ? 1 : 3;
    scene.gravity = Vec3(0, 0, -9.81);
    scene.ground.enabled = true;
    scene.ground.z = -0.021;
    Simulation simulation(scene);
    if (run < 2) {
      for (int f = 0; f < 10; ++f) {
        if (f == 4) simulation.cut(plane_at(0.0151));
        simulation.advance_frame();
      }
      if (run == 1) saved = simulation.tissue().save();
    } else {
      simulation.tissue().restore(saved);
    }
    for (int f = 0; f < 5; ++f) {
      if (f == 1) simulation.cut(plane_at(-0.0101));  // what was kept of the first cut is not saved
      simulation.advance_frame();
    }
    sums[run] = simulation.tissue().checksum();
  }
  EXPECT_EQ(sums[0], sums[1]);
  EXPECT_EQ(sums[1], sums[2]);
}

INSTANTIATE_TEST_SUITE_P(Models, CutMeshes,
                         testing::Values(PbdModel::kSurface, PbdModel::kTetrahedra),
                         [](const auto& info) {
                           return info.param == PbdModel::kSurface ? "surface" : "tetrahedra";
                         });

}  // namespace
}  // namespace tissue_sim
