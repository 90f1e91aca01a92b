#include "programs/dataset/dataset_run.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>
#include <map>
#include <random>
#include <utility>

#include "math/draw.h"
#include "mpm/fragment_features.h"
#include "mpm/tear/tear.h"

namespace tissue_sim {
namespace {

/// Tissue that takes so many substeps a frame, several times what stiff and whole tissue does, or
/// is in so many pieces is crushed: nothing is learnt from it from then on.
constexpr int kMostSubsteps = 40, kMostPieces = 40;

/// A sample that waits for its labels.
struct Waiting {
  std::vector<std::int32_t> points;  ///< of one cell, one for each line of bonds that hold
  int axis, row;
};

/// Points of one cell, one for each line along the axis on which nothing broke nearby.
std::vector<std::int32_t> whole_lines(const MpmState& s, const FragmentCandidates& found, int group,
                                      int axis) {
  std::vector<std::int32_t> lines;
  std::vector<int> seen;
  for (std::int32_t i = found.first[group]; i < found.first[group + 1]; ++i) {
    const std::int32_t p = found.points[i];
    const Points::Site& site = s.points.site[p];
    const int place[3] = {site.x & 1, site.y & 1, site.z & 1};
    const int line = 2 * place[(axis + 1) % 3] + place[(axis + 2) % 3];
    if (std::find(seen.begin(), seen.end(), line) != seen.end()) continue;
    seen.push_back(line);
    if (!broken_on_line(s, s.bodies[site.body], p, kForwardBond + axis)) lines.push_back(p);
  }
  return lines;
}

/// Calls f(line, broken) for each point of a run within the cell of coarse points and a point to
/// either side along the axis: its line along the axis, and whether bonds of that are broken there.
template <class F>
void for_each_line(const MpmState& coarse, const std::vector<std::vector<std::int32_t>>& within,
                   const MpmState& run, const Waiting& w, const F& f) {
  const int up = kForwardBond + w.axis, down = opposite_bond(up);
  for (const std::int32_t p : w.points) {
    const Points::Site& s = coarse.points.site[p];
    const int along[3] = {s.x, s.y, s.z};
    const int first = -1 - (along[w.axis] & 1);  // of the four, from this one on
    for (int step = first; step < first + 4; ++step) {
      const std::int32_t q = neighbour(coarse.bodies[s.body], s, up, step);
      if (q < 0) continue;
      for (const std::int32_t own : within[q]) {
        const Points::Site& site = run.points.site[own];
        const int place[3] = {site.x, site.y, site.z};
        f(std::make_pair(place[(w.axis + 1) % 3], place[(w.axis + 2) % 3]),
          (broken_bonds(run, own) & (1u << up | 1u << down)) != 0);
      }
    }
  }
}

bool is_torn(const MpmState& coarse, const std::vector<std::vector<std::int32_t>>& within,
             const MpmState& run, const Waiting& w) {
  std::map<std::pair<int, int>, bool> lines;
  for_each_line(coarse, within, run, w, [&](const std::pair<int, int>& line, bool broken) {
    bool& torn = lines[line];
    torn = torn || broken;
  });
  const auto torn =
      std::count_if(lines.begin(), lines.end(), [](const auto& l) { return l.second; });
  return torn > 0 && 2 * torn >= static_cast<std::ptrdiff_t>(lines.size());
}

/// Features as half as many digits tell them: packed they take a third less room.
float rounded(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  bits = (bits + 0x800u) & ~0xfffu;
  std::memcpy(&x, &bits, sizeof bits);
  return x;
}

}  // namespace

std::vector<std::vector<std::int32_t>> children(const MpmState& coarse, const MpmState& fine) {
  std::vector<std::vector<std::int32_t>> of(coarse.points.size());
  for (std::int32_t p = 0; p < fine.points.size(); ++p) {
    const Points::Site& s = fine.points.site[p];
    const LatticeBody& body = coarse.bodies[s.body];
    const Vec3 at =
        (fine.bodies[s.body].site_position(s.x, s.y, s.z) - body.origin) * 2 / body.cell_size;
    const auto in = [&](int a) { return static_cast<int>(std::floor(at[a])); };
    const std::int32_t parent = body.point(in(0), in(1), in(2));
    if (parent >= 0) of[parent].push_back(p);
  }
  return of;
}

bool advance_frame(MpmTissue& tissue, const DatasetScene& scene, int frame, FrameResult* result) {
  FrameInput input;
  if (frame == 0) input.cuts = {scene.cuts.data(), scene.cuts.size()};
  tissue.advance(1 / scene.scene.frame_rate, input);
  const FrameResult of_frame = tissue.finish();
  if (result != nullptr) *result = of_frame;
  return !of_frame.blew_up && of_frame.substeps <= kMostSubsteps &&
         tissue.fragment_count() <= kMostPieces;
}

std::unique_ptr<MpmTissue> begin_run(const DatasetScene& scene, double level) {
  auto tissue = std::make_unique<MpmTissue>(finer(scene, level));
  MpmState& s = tissue->state();
  for (const LatticeBody& b : s.bodies) {
    b.for_each_node([&](int node, int i, int j, int k) {
      if (s.nodes.inv_mass[node] == 0) return;
      const Vec3 v = scene.velocity(b.node_position(i, j, k));
      for (int a = 0; a < 3; ++a) s.nodes.v[a][node] = static_cast<float>(v[a]);
    });
  }
  measure_motion(s);
  return tissue;
}

std::vector<std::uint8_t> fragments_of(const MpmTissue& tissue, double coarse_cell) {
  const Pieces& pieces = tissue.pieces();
  std::vector<std::uint8_t> fragment(pieces.next_id, 0);
  double all = 0;
  for (const Fragment& f : pieces.all) all += f.volume;
  const double least = 0.5 * coarse_cell * coarse_cell * coarse_cell;
  for (const Fragment& f : pieces.all) {
    fragment[f.id] = f.loose && f.volume >= least && f.volume <= 0.4 * all;
  }
  return fragment;
}

double jittered(const DatasetScene& scene, int level, int truth) {
  const double u = static_cast<double>(split_mix(scene.seed) >> 11) * 0x1p-53 + 0.618034 * truth;
  return level * (0.95 + 0.1 * (u - std::floor(u)));
}

DatasetSamples run_dataset_scene(const DatasetScene& scene, const DatasetOptions& options) {
  DatasetSamples samples;
  std::mt19937_64 random(scene.seed);
  const auto coarse = begin_run(scene, 1);
  MpmState& s = coarse->state();
  std::vector<std::vector<std::int32_t>> itself(s.points.size());
  for (std::int32_t p = 0; p < s.points.size(); ++p) itself[p] = {p};
  std::vector<std::vector<Waiting>> of_frame(options.frames + 1);  // by when their label is known
  const std::size_t columns = 1 + options.truths;
  int rows = 0;
  for (int frame = 0; frame < options.frames; ++frame) {
    if (frame > 0 && frame + options.horizon <= options.frames) {
      std::vector<StrainedPoint> strained = find_strained(s, kRegionLevels[0]);
      const FragmentCandidates found = fragment_candidates(s, coarse->pieces(), strained);
      const FragmentSurroundings around =
          fragment_surroundings(s, coarse->pieces(), std::move(strained));
      std::vector<int> groups(found.groups());
      for (int g = 0; g < found.groups(); ++g) groups[g] = g;
      int taken = 0;
      for (std::size_t i = 0; i < groups.size() && taken < options.per_frame; ++i) {
        std::swap(groups[i], groups[i + random() % (groups.size() - i)]);
        float x[kPartingFeatureCount];
        const int axis =
            parting_features(s, coarse->pieces(), around, found.points[found.first[groups[i]]], x);
        std::vector<std::int32_t> lines = whole_lines(s, found, groups[i], axis);
        if (lines.empty()) continue;
        std::transform(x, x + kPartingFeatureCount, std::back_inserter(samples.x), rounded);
        of_frame[frame + options.horizon].push_back({std::move(lines), axis, rows++});
        ++taken;
      }
    }
    if (!advance_frame(*coarse, scene, frame)) break;
    ++samples.frames;
    samples.torn.resize(static_cast<std::size_t>(rows) * columns, kUnknown);
    for (const Waiting& w : of_frame[frame + 1])
      samples.torn[w.row * columns] = is_torn(s, itself, s, w);
  }
  samples.torn.resize(static_cast<std::size_t>(rows) * columns, kUnknown);
  for (int truth = 0; truth < options.truths; ++truth) {
    const auto fine = begin_run(scene, jittered(scene, options.level, truth));
    const auto within = children(s, fine->state());
    for (int frame = 0; frame < samples.frames; ++frame) {
      if (!advance_frame(*fine, scene, frame)) {
        ++samples.crushed;
        break;
      }
      for (const Waiting& w : of_frame[frame + 1]) {
        samples.torn[w.row * columns + 1 + truth] = is_torn(s, within, fine->state(), w);
      }
    }
  }
  return samples;
}

}  // namespace tissue_sim
