// Enrichment of weights by cuts in the plane, as the paper of 2014 prints it, after
// Barbieri, Petrinic, Meo and Tagarielli 2011. In three dimensions mls/cut.h decides, for these
// functions need cuts that one axis passes once.
#pragma once

#include <Eigen/Core>
#include <vector>

namespace tissue_sim {

using Vec2 = Eigen::Vector2d;

/// A straight cut from a to b [m].
struct CutSegment2 {
  Vec2 a, b;
};

/// d1+ of a straight cut from t1 to t2: how far t lies beyond its ends (eqs. 15, 16) [m].
double beyond_ends(double t, double t1, double t2);

/// The enrichment of one straight cut, the slope by s of its distance d2 = sqrt(d1+^2 + s^2) (eq.
/// 14): +1 to its left and -1 to its right, falling smoothly to 0 ahead of its tips; 0 on its line
/// beyond them. On the cut itself it is that of the left side.
double enrichment(const CutSegment2& cut, const Vec2& x);

/// That of several cuts by products, as Barbieri et al. have it. Wrong behind cuts whose lines it
/// crosses: figure 4 of the paper.
double multiplied_enrichment(const std::vector<CutSegment2>& cuts, const Vec2& x);

/// The extended enrichment of a chain of straight cuts, each beginning where the one before ends
/// (eqs. 17 to 20): one distance for all of them, s from the segment in whose region x lies.
class ExtendedEnrichment {
 public:
  /// Throws std::invalid_argument for no segment, one without length, a chain with gaps, or one
  /// that turns back along its mean direction (hooked, closed or crossing itself).
  explicit ExtendedEnrichment(std::vector<CutSegment2> chain);
  double operator()(const Vec2& x) const;
  /// Number of the segment in whose region x lies (figure 5 of the paper).
  int region(const Vec2& x) const;
  double angle() const { return angle_; }  ///< theta_0 [rad]
  const Vec2& origin() const { return origin_; }

 private:
  double along(const Vec2& x) const;  // eq. 18
  std::vector<CutSegment2> chain_;
  Vec2 origin_ = Vec2::Zero();
  double angle_ = 0;
  std::vector<double> angles_;  // of each segment [rad]
  std::vector<double> ends_;    // t_0 .. t_n
};

/// What a cut leaves of the weight of a pair, from the enrichment at both nodes: 1 on one side of
/// it, 0 across, 1/2 for both far ahead of a tip, (1 + h_i |h_i| h_j |h_j|) / 2 between. The paper
/// leaves it open. max(0, sigma h) would make every cut infinite; with (1 + sigma_i h_j) / 2,
/// sigma_i the node's own side, pairs across the cut's line are weaker for several spacings ahead
/// of the tip.
double enriched_share(double own, double there);

}  // namespace tissue_sim
