#include "mls/near_nodes.h"

#include <algorithm>
#include <cmath>

#include "geometry/near_grid.h"
#include "mls/faces.h"

namespace tissue_sim {
namespace {

constexpr double kFar = 2.5;  // reference distance from which a piece may touch itself [edges]
constexpr int kCellsAtATime = 32;
constexpr float kCellRounding = 1.0001f;  // of what is looked at in vectors

bool may_touch(const MlsState& s, const std::vector<std::int32_t>& piece, std::int32_t i,
               std::int32_t j) {
  if (piece[i] != piece[j]) return true;
  const double far = kFar * 0.5 * (s.edge[i] + s.edge[j]);
  if ((s.nodes.place[i] - s.nodes.place[j]).squaredNorm() > far * far) return true;
  if (s.cut[i] == 0 || s.cut[j] == 0) return false;
  const std::int32_t e = s.pairs.find(i, j);
  return e >= 0 && s.pairs.crossed[e] != 0;
}

struct Search {
  const MlsState& s;
  const std::vector<std::int32_t>& piece;
  const std::vector<std::int32_t>& outer;
  const std::vector<float>& skin;
  bool faces;
  double widest = 0;        ///< reach of any two [m]
  double least_far = 1e30;  ///< least distance in reference space that is far [m]
  std::vector<Vec3> places;

  float reach(std::int32_t i, std::int32_t j) const {
    const float edge = 0.5f * (s.edge[i] + s.edge[j]);
    if (!faces) return edge;
    return std::sqrt(mls_contact::reach2(s.face[4 * i + 3] + s.face[4 * j + 3], edge));
  }
};

/// What surrounds a cell: in vectors, from one of its nodes.
struct Around {
  std::vector<std::int32_t> number;
  std::vector<float> x[3], X[3];  ///< places, and in reference space
  std::vector<float> reach;       ///< with its skin
  std::vector<std::int32_t> piece, cut, is;

  template <class F>
  void each_vector(const F& f) {
    for (int a = 0; a < 3; ++a) f(x[a]), f(X[a]);
    f(reach);
    f(number), f(piece), f(cut);
  }
  void clear() {
    each_vector([](auto& v) { v.clear(); });
  }
  void add(const Search& w, std::int32_t k, const Vec3& at, const Vec3& at_reference) {
    const std::int32_t i = w.outer[k];
    number.push_back(k);
    for (int a = 0; a < 3; ++a) {
      x[a].push_back(static_cast<float>(w.places[k][a] - at[a]));
      X[a].push_back(static_cast<float>(w.s.nodes.place[i][a] - at_reference[a]));
    }
    reach.push_back(kCellRounding * (static_cast<float>(w.widest) + w.skin[k]));
    piece.push_back(w.piece[i]);
    cut.push_back(w.s.cut[i]);
  }
  /// Marks those that the one at `own` may touch at all.
  void mark(std::size_t own, float own_skin, float far2) {
    const std::size_t count = number.size();
    is.resize(count);
    const float skin = kCellRounding * own_skin;
    const float x0 = x[0][own], x1 = x[1][own], x2 = x[2][own];
    const float X0 = X[0][own], X1 = X[1][own], X2 = X[2][own];
    const std::int32_t own_piece = piece[own], own_cut = cut[own];
    const float *p0 = x[0].data(), *p1 = x[1].data(), *p2 = x[2].data();
    const float *P0 = X[0].data(), *P1 = X[1].data(), *P2 = X[2].data(), *r = reach.data();
    const std::int32_t *of = piece.data(), *cuts = cut.data();
    std::int32_t* out = is.data();
    for (std::size_t c = 0; c < count; ++c) {
      const float d0 = p0[c] - x0, d1 = p1[c] - x1, d2 = p2[c] - x2, most = r[c] + skin;
      const float D0 = P0[c] - X0, D1 = P1[c] - X1, D2 = P2[c] - X2;
      const std::int32_t near = d0 * d0 + d1 * d1 + d2 * d2 <= most * most ? 1 : 0;
      const std::int32_t far = D0 * D0 + D1 * D1 + D2 * D2 >= far2 ? 1 : 0;
      const std::int32_t parted = of[c] != own_piece ? 1 : 0;
      out[c] = near & (far | parted | (cuts[c] & own_cut));
    }
  }
};

/// Each pair is found from the one with the larger skin.
void search_cell(const Search& w, const NearGrid& grid, int cell, Around& around,
                 std::vector<MlsNear>& found) {
  float most_skin = 0;
  std::int32_t any = 0;
  grid.for_each_in(cell, [&](std::int32_t k) {
    most_skin = std::max(most_skin, w.skin[k]);
    any = k;
  });
  around.clear();
  const Vec3 at = w.places[any], at_reference = w.s.nodes.place[w.outer[any]];
  grid.for_each_around(cell, w.widest + 2 * most_skin,
                       [&](std::int32_t k) { around.add(w, k, at, at_reference); });
  const auto far2 = static_cast<float>(w.least_far * w.least_far / kCellRounding);
  grid.for_each_in(cell, [&](std::int32_t k) {
    const auto own = std::find(around.number.begin(), around.number.end(), k);
    const float skin = w.skin[k];
    around.mark(own - around.number.begin(), skin, far2);
    const std::int32_t i = w.outer[k];
    for (std::size_t c = 0; c < around.number.size(); ++c) {
      if (around.is[c] == 0) continue;
      const std::int32_t other = around.number[c], j = w.outer[other];
      if (w.skin[other] > skin || (w.skin[other] == skin && other <= k)) continue;
      const float most = w.reach(i, j) + skin + w.skin[other];
      if ((w.places[k] - w.places[other]).squaredNorm() > most * most) continue;
      if (may_touch(w.s, w.piece, i, j)) found.push_back({std::min(i, j), std::max(i, j)});
    }
  });
}

}  // namespace

std::vector<MlsNear> find_near_nodes(const MlsState& s, const std::vector<std::int32_t>& piece,
                                     const std::vector<std::int32_t>& outer,
                                     const std::vector<float>& skin) {
  if (outer.empty()) return {};
  Search w{s, piece, outer, skin, touches_by_faces(s), 0, 1e30, {}};
  double edge = 0, depth = 0, sum_of_skins = 0;  // of the largest
  for (std::size_t k = 0; k < outer.size(); ++k) {
    const std::int32_t i = outer[k];
    w.places.push_back(s.position(i));
    edge = std::max<double>(edge, s.edge[i]);
    depth = std::max<double>(depth, s.face[4 * i + 3]);
    w.least_far = std::min<double>(w.least_far, kFar * s.edge[i]);
    sum_of_skins += skin[k];
  }
  w.widest = w.faces ? std::sqrt(mls_contact::reach2(2 * depth, edge)) : edge;
  // Most look no farther than the cells around theirs.
  constexpr double kMoreSkin = 1.2;
  const NearGrid grid(w.places, w.widest + 2 * kMoreSkin * sum_of_skins / outer.size());
  const int works = (grid.cells() + kCellsAtATime - 1) / kCellsAtATime;
  std::vector<std::vector<MlsNear>> found(works);
  s.cpu->for_each(works, [&](int work) {
    Around around;
    const int last = std::min(grid.cells(), (work + 1) * kCellsAtATime);
    for (int cell = work * kCellsAtATime; cell < last; ++cell) {
      search_cell(w, grid, cell, around, found[work]);
    }
  });
  std::vector<MlsNear> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace tissue_sim
