#include "geometry/nearest.h"

#include <algorithm>
#include <limits>
#include <nanoflann.hpp>
#include <tuple>

namespace tissue_sim {
namespace {

bool comes_before(const Neighbour& a, const Neighbour& b) {
  return std::tie(a.distance2, a.index) < std::tie(b.distance2, b.index);
}

// What nanoflann asks of a result set, of all its versions.

/// The `count` nearest, sorted.
class NearestSet {
 public:
  NearestSet(std::vector<Neighbour>& found, std::size_t count) : found_(found), count_(count) {}
  std::size_t size() const { return found_.size(); }
  bool empty() const { return found_.empty(); }
  bool full() const { return found_.size() == count_; }
  double worstDist() const {
    return full() ? found_.back().distance2 : std::numeric_limits<double>::max();
  }
  bool addPoint(double distance2, std::size_t index) {
    const Neighbour n{distance2, static_cast<std::int32_t>(index)};
    if (full()) {
      if (!comes_before(n, found_.back())) return true;
      found_.pop_back();
    }
    found_.insert(std::upper_bound(found_.begin(), found_.end(), n, comes_before), n);
    return true;
  }
  void sort() {}

 private:
  std::vector<Neighbour>& found_;
  std::size_t count_;
};

class WithinSet {
 public:
  WithinSet(std::vector<Neighbour>& found, double radius2) : found_(found), radius2_(radius2) {}
  std::size_t size() const { return found_.size(); }
  bool empty() const { return found_.empty(); }
  bool full() const { return true; }
  double worstDist() const { return radius2_; }
  bool addPoint(double distance2, std::size_t index) {
    if (distance2 <= radius2_) found_.push_back({distance2, static_cast<std::int32_t>(index)});
    return true;
  }
  void sort() {}

 private:
  std::vector<Neighbour>& found_;
  double radius2_;
};

}  // namespace

struct NearestPoints::Tree {
  struct Points {
    const std::vector<Vec3>& all;
    std::size_t kdtree_get_point_count() const { return all.size(); }
    double kdtree_get_pt(std::size_t i, std::size_t axis) const {
      return all[i][static_cast<int>(axis)];
    }
    template <class Box>
    bool kdtree_get_bbox(Box&) const {
      return false;
    }
  };
  explicit Tree(const std::vector<Vec3>& points)
      : of{points}, index(3, of, nanoflann::KDTreeSingleIndexAdaptorParams(10)) {
    index.buildIndex();
  }
  using Metric = nanoflann::L2_Simple_Adaptor<double, Points>;
  Points of;
  nanoflann::KDTreeSingleIndexAdaptor<Metric, Points, 3> index;
};

NearestPoints::NearestPoints(const std::vector<Vec3>& points)
    : tree_(std::make_unique<Tree>(points)) {}
NearestPoints::~NearestPoints() = default;

void NearestPoints::nearest(const Vec3& place, int count, std::vector<Neighbour>& found) const {
  found.clear();
  if (count <= 0 || tree_->of.all.empty()) return;
  NearestSet set(found, static_cast<std::size_t>(count));
  tree_->index.findNeighbors(set, place.data(), {});
}

void NearestPoints::within(const Vec3& place, double radius, std::vector<Neighbour>& found) const {
  found.clear();
  if (tree_->of.all.empty()) return;
  WithinSet set(found, radius * radius);
  tree_->index.findNeighbors(set, place.data(), {});
  std::sort(found.begin(), found.end(),
            [](const Neighbour& a, const Neighbour& b) { return a.index < b.index; });
}

}  // namespace tissue_sim
