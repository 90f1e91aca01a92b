#include "mls/near_nodes.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "mls/faces.h"

namespace tissue_sim {
namespace {

constexpr double kFar = 2.5;       // reference distance from which a piece may touch itself [edges]
constexpr double kGroup = 4;       // edge of the cubes in reference space that make groups [edges]
constexpr int kPairsAtATime = 64;  // of groups
constexpr double kRoundedUp = 1 + 1e-4;  // of what is looked at in vectors

bool may_touch(const MlsState& s, const std::vector<std::int32_t>& piece, std::int32_t i,
               std::int32_t j) {
  if (piece[i] != piece[j]) return true;
  const double far = kFar * 0.5 * (s.edge[i] + s.edge[j]);
  if ((s.nodes.place[i] - s.nodes.place[j]).squaredNorm() > far * far) return true;
  if (s.cut[i] == 0 || s.cut[j] == 0) return false;
  const std::int32_t e = s.pairs.find(i, j);
  return e >= 0 && s.pairs.crossed[e] != 0;
}

void add(const Vec3& place, Box& box) {
  box.min = box.min.cwiseMin(place);
  box.max = box.max.cwiseMax(place);
}

/// Nodes of a piece that lie near one another in reference space.
struct Group {
  std::int32_t begin, end;  ///< in Search::order
  std::int32_t piece;
  std::int32_t cut = 0;  ///< whether any is
  Box box, box_before;   ///< as they are, and in reference space
  float most_skin = 0;
  Box wide;  ///< box of what may be reached, of which others reach the other half
};

class Search {
 public:
  Search(const MlsState& s, const std::vector<std::int32_t>& piece,
         const std::vector<std::int32_t>& outer, const std::vector<float>& skin)
      : s_(s), piece_(piece), outer_(outer), skin_(skin), faces_(touches_by_faces(s)) {
    double depth = 0, edge = 0;
    for (const std::int32_t i : outer) {
      edge = std::max<double>(edge, s.edge[i]);
      depth = std::max<double>(depth, s.face[4 * i + 3]);
      least_far_ = std::min<double>(least_far_, kFar * s.edge[i]);
      mean_edge_ += s.edge[i] / static_cast<double>(outer.size());
    }
    widest_ = faces_ ? std::sqrt(mls_contact::reach2(2 * depth, edge)) : edge;
    sort();
    make_groups();
  }

  std::vector<MlsNear> run() {
    const std::vector<std::pair<std::int32_t, std::int32_t>> pairs = near_groups();
    const int count = static_cast<int>(pairs.size()),
              works = (count + kPairsAtATime - 1) / kPairsAtATime;
    std::vector<std::vector<MlsNear>> found(works);
    s_.cpu->for_each(works, [&](int work) {
      std::vector<std::int32_t> marks;
      for (int k = work * kPairsAtATime; k < std::min(count, (work + 1) * kPairsAtATime); ++k) {
        search(groups_[pairs[k].first], groups_[pairs[k].second], marks, found[work]);
      }
    });
    std::vector<MlsNear> all;
    for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
    return all;
  }

 private:
  /// By piece and cube.
  void sort() {
    using Key = std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t, std::int32_t>;
    std::vector<Key> keys;
    keys.reserve(outer_.size());
    for (std::size_t k = 0; k < outer_.size(); ++k) {
      const Vec3 cube = s_.nodes.place[outer_[k]] / (kGroup * mean_edge_);
      const auto along = [&](int a) { return static_cast<std::int32_t>(std::floor(cube[a])); };
      keys.emplace_back(piece_[outer_[k]], along(0), along(1), along(2),
                        static_cast<std::int32_t>(k));
    }
    std::sort(keys.begin(), keys.end());
    const auto of = [](const Key& key) {
      return std::tie(std::get<0>(key), std::get<1>(key), std::get<2>(key), std::get<3>(key));
    };
    for (std::size_t k = 0; k < keys.size(); ++k) {
      const auto at = static_cast<std::int32_t>(k);
      if (k == 0 || of(keys[k]) != of(keys[k - 1])) {
        groups_.push_back({at, at, std::get<0>(keys[k]), 0, {}, {}, 0, {}});
      }
      groups_.back().end = at + 1;
      order_.push_back(std::get<4>(keys[k]));
    }
  }

  void make_groups() {
    const std::size_t count = order_.size();
    place_.resize(count);
    for (std::vector<float>* row : {&x_[0], &x_[1], &x_[2], &X_[0], &X_[1], &X_[2], &reach_}) {
      row->resize(count);
    }
    cut_.resize(count);
    for (Group& g : groups_) {
      for (std::int32_t k = g.begin; k < g.end; ++k) {
        const std::int32_t i = outer_[order_[k]];
        place_[k] = s_.position(i);
        cut_[k] = is_cut_within(i) ? 1 : 0;
        g.cut |= cut_[k];
        const float skin = skin_[order_[k]];
        g.most_skin = std::max(g.most_skin, skin);
        reach_[k] = static_cast<float>(kRoundedUp * (widest_ + skin));
        add(place_[k], g.box);
        add(s_.nodes.place[i], g.box_before);
      }
      g.wide = g.box;
      const double reach = kRoundedUp * (0.5 * widest_ + g.most_skin);
      g.wide.min.array() -= reach;
      g.wide.max.array() += reach;
      for (std::int32_t k = g.begin; k < g.end; ++k) {  // from a corner: single precision does
        const Vec3 x = place_[k] - g.box.min,
                   X = s_.nodes.place[outer_[order_[k]]] - g.box_before.min;
        for (int a = 0; a < 3; ++a) {
          x_[a][k] = static_cast<float>(x[a]);
          X_[a][k] = static_cast<float>(X[a]);
        }
      }
    }
  }

  /// Whether a cut passes between the node and another one of its piece.
  bool is_cut_within(std::int32_t i) const {
    const MlsPairs& p = s_.pairs;
    for (std::int32_t e = p.begin[i]; e < p.begin[i + 1] && s_.cut[i] != 0; ++e) {
      if (p.crossed[e] != 0 && piece_[p.other[e]] == piece_[i]) return true;
    }
    return false;
  }

  /// Whether nodes of both may touch at all, wherever they are.
  bool may_ever(const Group& g, const Group& h) const {
    if (g.piece != h.piece || (g.cut & h.cut) != 0) return true;
    const Vec3 apart = (g.box_before.max - h.box_before.min)
                           .cwiseAbs()
                           .cwiseMax((h.box_before.max - g.box_before.min).cwiseAbs());
    return apart.squaredNorm() >= least_far_ * least_far_;
  }

  /// Numbers of groups, sorted along the longest axis to find those whose boxes overlap.
  std::vector<std::pair<std::int32_t, std::int32_t>> near_groups() const {
    Box all;
    for (const Group& g : groups_) {
      add(g.box.min, all);
      add(g.box.max, all);
    }
    int axis = 0;
    (all.max - all.min).maxCoeff(&axis);
    std::vector<std::pair<double, std::int32_t>> sorted;
    for (const Group& g : groups_) {
      const double at = g.wide.min[axis];  // last where it is no number
      sorted.emplace_back(std::isfinite(at) ? at : 1e300, static_cast<std::int32_t>(sorted.size()));
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
    for (std::size_t k = 0; k < sorted.size(); ++k) {
      const Group& g = groups_[sorted[k].second];
      for (std::size_t l = k; l < sorted.size() && sorted[l].first <= g.wide.max[axis]; ++l) {
        const Group& h = groups_[sorted[l].second];
        if ((g.wide.min.array() <= h.wide.max.array()).all() &&
            (h.wide.min.array() <= g.wide.max.array()).all() && may_ever(g, h)) {
          pairs.emplace_back(sorted[k].second, sorted[l].second);
        }
      }
    }
    return pairs;
  }

  void search(const Group& g, const Group& h, std::vector<std::int32_t>& marks,
              std::vector<MlsNear>& found) const {
    for (std::int32_t k = g.begin; k < g.end; ++k) {
      const std::int32_t first = &g == &h ? k + 1 : h.begin;
      const float skin = skin_[order_[k]];
      const double most = kRoundedUp * (widest_ + skin + h.most_skin);
      const Vec3 to_box = place_[k].cwiseMax(h.box.min).cwiseMin(h.box.max) - place_[k];
      if (to_box.squaredNorm() > most * most || !mark(g, h, k, first, marks)) continue;
      const std::int32_t i = outer_[order_[k]];
      for (std::int32_t l = first; l < h.end; ++l) {
        if (marks[l - first] == 0) continue;
        const std::int32_t j = outer_[order_[l]];
        const double reach = this->reach(i, j) + skin + skin_[order_[l]];
        if ((place_[k] - place_[l]).squaredNorm() > reach * reach) continue;
        if (may_touch(s_, piece_, i, j)) found.push_back({std::min(i, j), std::max(i, j)});
      }
    }
  }

  /// Marks those of h from `first` on that the one at k may touch; whether there are any.
  bool mark(const Group& g, const Group& h, std::int32_t k, std::int32_t first,
            std::vector<std::int32_t>& marks) const {
    const Vec3 x = place_[k] - h.box.min, X = s_.nodes.place[outer_[order_[k]]] - h.box_before.min;
    const auto x0 = static_cast<float>(x[0]), x1 = static_cast<float>(x[1]),
               x2 = static_cast<float>(x[2]), X0 = static_cast<float>(X[0]),
               X1 = static_cast<float>(X[1]), X2 = static_cast<float>(X[2]),
               skin = static_cast<float>(kRoundedUp * skin_[order_[k]]),
               far2 = static_cast<float>(least_far_ * least_far_ / kRoundedUp);
    const std::int32_t parted = g.piece != h.piece ? 1 : 0, cut = cut_[k];
    const std::int32_t count = h.end - first;
    marks.resize(std::max<std::size_t>(marks.size(), count));
    const float *p0 = &x_[0][first], *p1 = &x_[1][first], *p2 = &x_[2][first];
    const float *P0 = &X_[0][first], *P1 = &X_[1][first], *P2 = &X_[2][first],
                *reach = &reach_[first];
    const std::int32_t* cuts = &cut_[first];
    std::int32_t* out = marks.data();
    std::int32_t any = 0;
    for (std::int32_t l = 0; l < count; ++l) {
      const float d0 = p0[l] - x0, d1 = p1[l] - x1, d2 = p2[l] - x2, most = reach[l] + skin;
      const float D0 = P0[l] - X0, D1 = P1[l] - X1, D2 = P2[l] - X2;
      const std::int32_t near = d0 * d0 + d1 * d1 + d2 * d2 <= most * most ? 1 : 0;
      const std::int32_t far = D0 * D0 + D1 * D1 + D2 * D2 >= far2 ? 1 : 0;
      out[l] = near & (far | parted | (cuts[l] & cut));
      any |= out[l];
    }
    return any != 0;
  }

  float reach(std::int32_t i, std::int32_t j) const {
    const float edge = 0.5f * (s_.edge[i] + s_.edge[j]);
    if (!faces_) return edge;
    return std::sqrt(mls_contact::reach2(s_.face[4 * i + 3] + s_.face[4 * j + 3], edge));
  }

  const MlsState& s_;
  const std::vector<std::int32_t>& piece_;
  const std::vector<std::int32_t>& outer_;
  const std::vector<float>& skin_;
  const bool faces_;
  double widest_ = 0;        ///< reach of any two [m]
  double least_far_ = 1e30;  ///< least distance in reference space that is far [m]
  double mean_edge_ = 0;     ///< [m]
  std::vector<Group> groups_;
  std::vector<std::int32_t> order_;  ///< numbers in outer_, group by group; all below are in order
  std::vector<Vec3> place_;
  std::vector<float> x_[3], X_[3];  ///< from the least corner of the group's boxes
  std::vector<float> reach_;        ///< with its skin
  std::vector<std::int32_t> cut_;
};

}  // namespace

std::vector<MlsNear> find_near_nodes(const MlsState& s, const std::vector<std::int32_t>& piece,
                                     const std::vector<std::int32_t>& outer,
                                     const std::vector<float>& skin) {
  if (outer.empty()) return {};
  return Search(s, piece, outer, skin).run();
}

}  // namespace tissue_sim
