#include "paper/enrichment.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace tissue_sim {
namespace {

/// Slope of sqrt(d1^2 + s^2) by s.
double slope(double d1, double s) {
  if (d1 == 0) return s < 0 ? -1 : 1;
  return s / std::hypot(d1, s);
}

}  // namespace

double beyond_ends(double t, double t1, double t2) {
  const double ds = std::abs(t - 0.5 * (t1 + t2)) - 0.5 * std::abs(t1 - t2);
  return 0.5 * (ds + std::abs(ds));
}

double enrichment(const CutSegment2& cut, const Vec2& x) {
  const Vec2 along = cut.b - cut.a;
  const double length = along.norm();
  const Vec2 axis = along / length, d = x - cut.a;
  const double t = axis.dot(d), s = axis.x() * d.y() - axis.y() * d.x();
  return slope(beyond_ends(t, 0, length), s);
}

double multiplied_enrichment(const std::vector<CutSegment2>& cuts, const Vec2& x) {
  double product = 1;
  for (const CutSegment2& cut : cuts) product *= enrichment(cut, x);
  return product;
}

ExtendedEnrichment::ExtendedEnrichment(std::vector<CutSegment2> chain) : chain_(std::move(chain)) {
  if (chain_.empty()) throw std::invalid_argument("an enrichment needs a cut segment, got none");
  double sum = 0;
  for (std::size_t i = 0; i < chain_.size(); ++i) {
    const Vec2 along = chain_[i].b - chain_[i].a;
    const double length = along.norm();
    const std::string which = "cut segment " + std::to_string(i);
    if (!(length > 0)) throw std::invalid_argument(which + " has no length");
    if (i > 0 && (chain_[i].a - chain_[i - 1].b).norm() > 1e-9 * length) {
      throw std::invalid_argument(which +
                                  " does not begin where the one before ends: give a chain");
    }
    double angle = std::atan2(along.y(), along.x());
    if (i > 0) {  // the turn that is nearest to the one before: angles are averaged
      angle += 2 * M_PI * std::round((angles_.back() - angle) / (2 * M_PI));
    }
    angles_.push_back(angle);
    origin_ += length * 0.5 * (chain_[i].a + chain_[i].b);
    angle_ += length * angle;
    sum += length;
  }
  origin_ /= sum;
  angle_ /= sum;
  ends_.push_back(along(chain_[0].a));
  for (const CutSegment2& segment : chain_) {
    ends_.push_back(along(segment.b));
    if (!(ends_.back() > ends_[ends_.size() - 2])) {
      throw std::invalid_argument(
          "the cut turns back along its mean direction: the extended enrichment needs chains that "
          "go one way, cut it in several");
    }
  }
}

double ExtendedEnrichment::along(const Vec2& x) const {
  const Vec2 d = x - origin_;
  return std::cos(angle_) * d.x() + std::sin(angle_) * d.y();
}

int ExtendedEnrichment::region(const Vec2& x) const {
  const double t = along(x);
  int i = 0;
  while (i + 1 < static_cast<int>(chain_.size()) && t > ends_[i + 1]) ++i;
  return i;
}

double ExtendedEnrichment::operator()(const Vec2& x) const {
  const double t = along(x), first = ends_.front(), last = ends_.back();
  const double d1 = t < first ? first - t : t > last ? t - last : 0;  // eq. 19
  const int i = region(x);
  const Vec2 d = x - chain_[i].a;
  return slope(d1, -std::sin(angles_[i]) * d.x() + std::cos(angles_[i]) * d.y());  // eq. 20
}

double enriched_share(double own, double there) {
  return 0.5 * (1 + own * std::abs(own) * there * std::abs(there));
}

}  // namespace tissue_sim
