// Strips that are pulled apart.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/cut_scenes.h"
#include "support/fixed_substeps.h"
#include "support/momentum.h"

namespace tissue_sim {

struct StripOf {
  double cell_size = 0.002;  // [m]
  double limit = 1.3, scatter = 0, tear_length = 0;
  double right_limit = -1;  // of the right half, if another
  double notch = 0;         // share of the width, cut in the middle
  double turned = 0;        // about z [degrees]
  int threads = 1;
  std::uint64_t seed = 1;
};

/// A strip of 48 x 16 x 4 mm under uniaxial stretch: its ends are held over 4 mm, stretched evenly
/// as all of it is at the beginning, and narrow as they would if they were free. So the tension is
/// even, and known.
template <class T>
class Strip {
 public:
  static constexpr double kLength = 0.048, kWidth = 0.016, kThickness = 0.004;

  explicit Strip(const StripOf& of)
      : tissue_(scene_of(of)), material_(scene_of(of).materials[0]), turned_(of.turned) {
    const Pose& pose = tissue_.state().bodies[0].body.pose;
    axis_ = pose.orientation * Vec3::UnitX();
    middle_ = pose.position;
    if (of.notch > 0) {
      const auto at = [&](double y) { return pose * Vec3(1e-4, y, 0); };
      cut_now(tissue_, upright_blade({at(-kWidth), at((of.notch - 0.5) * kWidth)}));
    }
    home_ = homes(tissue_.state());
  }

  static Scene scene_of(const StripOf& of) {
    Scene s = free_box(Vec3(kLength, kWidth, kThickness), of.cell_size);
    s.threads = of.threads;
    s.damping = 200;
    s.seed = of.seed;
    Material m;
    m.name = "strip";
    m.poisson_ratio = 0.3;
    m.tear_stretch = of.limit;
    m.tear_scatter = of.scatter;
    m.tear_length = of.tear_length;
    s.materials = {m};
    Body& b = s.bodies[0];
    b.material = "strip";
    if (of.right_limit >= 0) {
      m.name = "right";
      m.tear_stretch = of.right_limit;
      s.materials.push_back(m);
      Inclusion right;
      right.material = m.name;
      right.region.kind = Region::Kind::kBox;
      right.region.min = Vec3(0.5 * kLength, -1, -1);
      right.region.max = Vec3::Ones();
      b.inclusions = {right};
    }
    b.pose.orientation = Quat(Eigen::AngleAxisd(of.turned * M_PI / 180, Vec3::UnitZ()));
    return s;
  }

  /// Stretches at which nothing pulls sideways: fixed corotated, P_22 = 0, by Newton's method.
  double narrowing(double stretch) const {
    const double mu = lame_mu(material_), lambda = lame_lambda(material_);
    double x = 1;
    for (int i = 0; i < 50; ++i) {
      const double f = 2 * mu * (x - 1) + lambda * (stretch * x * x - 1) * stretch * x;
      const double slope =
          2 * mu + lambda * stretch * (2 * stretch * x * x + (stretch * x * x - 1));
      x -= f / slope;
    }
    return x;
  }
  /// Force of a whole strip at this stretch [N].
  double force_at(double stretch) const {
    const double mu = lame_mu(material_), lambda = lame_lambda(material_), x = narrowing(stretch);
    const double stress = 2 * mu * (stretch - 1) + lambda * (stretch * x * x - 1) * x * x;
    return stress * kWidth * kThickness;
  }

  /// Whether a place is at most `margin` from a grip: the ends, or balls around them where the
  /// strip lies askew in the lattice.
  bool is_gripped(const Vec3& place, double margin) const {
    const Vec3 d = place - middle_;
    const double end = 0.5 * kLength, along = std::fabs(d.dot(axis_));
    if (turned_ == 0) return along > end - 0.004 - margin;
    const double beside = d.squaredNorm() - along * along;
    return std::hypot(along - end, std::sqrt(beside)) < 0.6 * kWidth + margin;
  }
  /// Puts the grips, or all of the strip, where this stretch has them.
  void stretch_to(double stretch, bool all) {
    grip(tissue_.state(), [this](const Vec3& x, double margin) { return is_gripped(x, margin); });
    Nodes& n = tissue_.state().nodes;
    const double x = narrowing(stretch);
    for (std::size_t i = 0; i < home_.size(); ++i) {
      if (!all && n.inv_mass[i] != 0) continue;
      const Vec3 d = home_[i] - middle_, along = d.dot(axis_) * axis_;
      const Vec3 u = (stretch - 1) * along + (x - 1) * (d - along);
      for (int a = 0; a < 3; ++a) n.u[a][i] = static_cast<float>(u[a]);
    }
    stretch_ = stretch;
  }
  /// Pulls on at `rate` [1/s] for `substeps`. Returns the reports of the tears, summed.
  FrameResult pull(double rate, int substeps) {
    FrameResult sum;
    for (int i = 0; i < substeps; i += 4) {
      const float dt = tissue_.stable_substep();
      stretch_to(stretch_ + rate * 4 * dt, false);
      advance_by(tissue_, 4, dt, {});
      const FrameResult r = tissue_.finish();
      const std::int64_t broken = sum.tear_report.bonds_broken + r.tear_report.bonds_broken;
      sum = r;
      sum.tear_report.bonds_broken = broken;
      if (r.tear_report.bonds_broken > 0) home_ = homes(tissue_.state());
    }
    return sum;
  }
  /// What the right half pulls the left with [N].
  double force() {
    MpmState& s = tissue_.state();
    double sum = 0;
    std::vector<float> f;
    for (const Block* b : s.blocks.all) {
      f.assign(3 * static_cast<std::size_t>(b->node_count()), 0.0f);
      s.kernels->forces(*b, block_field(s, *b), s.scratch.local(), f.data());
      for (int z = 0; z < b->nz + 2; ++z) {
        for (int i = 0; i < (b->ny + 2) * b->pitch; ++i) {
          const int local = z * b->plane + i;
          if (b->node[local] < 0) continue;
          if ((home_[b->node[local]] - middle_).dot(axis_) <= 0) continue;
          for (int a = 0; a < 3; ++a) sum -= axis_[a] * f[a * b->node_count() + local];
        }
      }
    }
    return sum;
  }
  /// Pulls until the strip has come apart and half as many substeps more; returns the largest force
  /// on the way [N].
  double pull_apart(double from, double rate) {
    stretch_to(from, true);
    double largest = 0;
    int more = 3;
    while (more > 0 && stretch_ < 2) {
      pull(rate, 40);
      const double now = force();
      largest = std::max(largest, now);
      if (tissue_.fragments().size() > 1 && now < 0.2 * largest) --more;
    }
    return largest;
  }

  T& tissue() { return tissue_; }
  double stretch() const { return stretch_; }

 private:
  T tissue_;
  Material material_;
  double turned_;
  Vec3 axis_, middle_;
  std::vector<Vec3> home_;
  double stretch_ = 1;
};

}  // namespace tissue_sim
