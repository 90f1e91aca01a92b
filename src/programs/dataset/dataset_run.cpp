#include "programs/dataset/dataset_run.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>

#include "mpm/fragment_features.h"
#include "mpm/tear/debris.h"

namespace tissue_sim {
namespace {

/// Tissue that takes so many substeps a frame, several times what stiff and whole tissue does, or
/// is in so many pieces is crushed: nothing is learnt from it from then on.
constexpr int kMostSubsteps = 40, kMostPieces = 40;

double loose_share(const MpmTissue& tissue, double coarse_cell) {
  const std::vector<std::uint8_t> fragment = fragments_of(tissue, coarse_cell);
  double all = 0, loose = 0;
  for (const Fragment& f : tissue.pieces().all) {
    all += f.volume;
    if (fragment[f.id] != 0) loose += f.volume;
  }
  return loose / all;
}

/// A sample that waits for its label.
struct Waiting {
  std::vector<std::int32_t> points;  ///< of one cell
  int row;                           ///< in the samples
};

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

DatasetSamples run_dataset_scene(const DatasetScene& scene, const DatasetOptions& options) {
  DatasetSamples samples;
  const double h = scene.scene.cell_size;
  std::mt19937_64 random(scene.seed);
  const auto coarse = begin_run(scene, 1);
  std::vector<std::vector<Waiting>> of_frame(options.frames + 1);  // by when their label is known
  int frames = 0;
  for (int frame = 0; frame < options.frames; ++frame, ++frames) {
    MpmState& s = coarse->state();
    if (frame > 0 && frame + options.horizon <= options.frames) {
      std::vector<StrainedPoint> strained = find_strained(s, kRegionLevels[0]);
      const FragmentCandidates found = fragment_candidates(s, coarse->pieces(), strained);
      const FragmentSurroundings around =
          fragment_surroundings(s, coarse->pieces(), std::move(strained));
      std::vector<int> groups(found.groups());
      std::iota(groups.begin(), groups.end(), 0);
      for (std::size_t i = 0; i < groups.size(); ++i) {  // the first are drawn evenly from all
        if (static_cast<int>(i) == options.per_frame) break;
        std::swap(groups[i], groups[i + random() % (groups.size() - i)]);
      }
      groups.resize(std::min<std::size_t>(groups.size(), options.per_frame));
      std::sort(groups.begin(), groups.end());
      for (const int g : groups) {
        const int row = static_cast<int>(samples.x.size()) / kAllFeatureCount;
        samples.x.resize(samples.x.size() + kAllFeatureCount);
        float* x = &samples.x[static_cast<std::size_t>(row) * kAllFeatureCount];
        const std::int32_t point = found.points[found.first[g]];
        fragment_features(s, point, x);
        surrounding_features(s, coarse->pieces(), around, point, x);
        const auto limit = static_cast<float>(scene.scene.materials[0].tear_stretch);
        samples.about.insert(samples.about.end(),
                             {static_cast<float>(frame), limit, static_cast<float>(h)});
        of_frame[frame + options.horizon].push_back(
            {{found.points.begin() + found.first[g], found.points.begin() + found.first[g + 1]},
             row});
      }
      samples.plain.resize(samples.x.size() / kAllFeatureCount, 0);
    }
    if (!advance_frame(*coarse, scene, frame)) {
      samples.blew_up = true;
      break;
    }
    const std::vector<std::uint8_t> fragment = fragments_of(*coarse, h);
    for (const Waiting& w : of_frame[frame + 1]) {
      std::size_t loose = 0;
      for (const std::int32_t p : w.points) loose += fragment[coarse->fragment_of(p)];
      samples.plain[w.row] = 2 * loose >= w.points.size();
    }
  }
  samples.coarse_loose = loose_share(*coarse, h);
  samples.coarse_points = coarse->point_count();

  const auto fine = begin_run(scene, options.level);
  samples.true_points = fine->point_count();
  const auto within = children(coarse->state(), fine->state());
  const std::size_t rows = samples.x.size() / kAllFeatureCount;
  samples.q.resize(rows, 0);
  samples.df.resize(9 * rows, 0);
  std::size_t known = 0;  // rows come in order of time
  for (int frame = 0; frame < frames; ++frame) {
    if (!advance_frame(*fine, scene, frame)) {
      samples.blew_up = true;
      break;
    }
    ++samples.frames;
    const MpmState& s = fine->state();
    const std::vector<std::uint8_t> fragment = fragments_of(*fine, h);
    for (const Waiting& w : of_frame[frame + 1]) {
      double volume = 0, loose = 0;
      Eigen::Matrix3d F = Eigen::Matrix3d::Zero();
      for (const std::int32_t coarse_point : w.points) {
        for (const std::int32_t p : within[coarse_point]) {
          const Points::Site& site = s.points.site[p];
          const double own = s.points.volume[p];
          volume += own;
          if (fragment[fine->fragment_of(p)] != 0) loose += own;
          F += own * deformation_gradient(s.bodies[site.body], site, *s.fields, s.nodes);
        }
      }
      if (volume == 0) continue;
      samples.q[w.row] = loose >= 0.5 * volume;
      for (int i = 0; i < 9; ++i) {
        samples.df[9 * w.row + i] =
            static_cast<float>(F(i / 3, i % 3) / volume) -
            samples.x[static_cast<std::size_t>(w.row) * kAllFeatureCount + i];
      }
      known = std::max(known, static_cast<std::size_t>(w.row) + 1);
    }
  }
  samples.true_loose = loose_share(*fine, h);
  samples.x.resize(known * kAllFeatureCount);
  samples.q.resize(known);
  samples.plain.resize(known);
  samples.df.resize(9 * known);
  samples.about.resize(3 * known);
  return samples;
}

}  // namespace tissue_sim
