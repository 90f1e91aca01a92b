#include "pbd/cap_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "pbd/surface_mesh.h"

namespace tissue_sim {
namespace pbd {
namespace {

using Place = Eigen::Vector2d;

double turn(const Place& a, const Place& b, const Place& c) {
  return (b.x() - a.x()) * (c.y() - a.y()) - (b.y() - a.y()) * (c.x() - a.x());
}

bool holds(const Place& a, const Place& b, const Place& c, const Place& p) {
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

/// Smallest angle's sine, roughly: which ear is the better one.
double shape(const Place& a, const Place& b, const Place& c) {
  const double l = std::max({(a - b).squaredNorm(), (b - c).squaredNorm(), (c - a).squaredNorm()});
  return turn(a, b, c) / l;
}

/// Empty where there is no ear any more.
std::vector<std::array<int, 3>> clip_ears(const std::vector<Place>& at) {
  std::vector<int> left;
  for (std::size_t i = 0; i < at.size(); ++i) left.push_back(static_cast<int>(i));
  std::vector<std::array<int, 3>> triangles;
  while (left.size() > 3) {
    const int n = static_cast<int>(left.size());
    int best = -1;
    double most = 0;
    for (int i = 0; i < n; ++i) {
      const int a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      const double quality = shape(at[a], at[b], at[c]);
      if (!(quality > most)) continue;
      bool is_ear = true;
      for (const int p : left) {
        if (p != a && p != b && p != c && holds(at[a], at[b], at[c], at[p])) is_ear = false;
      }
      if (!is_ear) continue;
      most = quality;
      best = i;
    }
    if (best < 0) return {};
    triangles.push_back({left[(best + n - 1) % n], left[best], left[(best + 1) % n]});
    left.erase(left.begin() + best);
  }
  if (!(turn(at[left[0]], at[left[1]], at[left[2]]) > 0)) return {};
  triangles.push_back({left[0], left[1], left[2]});
  return triangles;
}

/// Lawson's flips; edges of the loop are in one triangle only and stay.
void flip_to_delaunay(const std::vector<Place>& at, std::vector<std::array<int, 3>>& triangles) {
  for (int round = 0; round < 3000; ++round) {
    std::map<std::pair<int, int>, int> side;  // triangle that has the edge in this sense
    for (std::size_t t = 0; t < triangles.size(); ++t) {
      for (int i = 0; i < 3; ++i) {
        side[{triangles[t][i], triangles[t][(i + 1) % 3]}] = static_cast<int>(t);
      }
    }
    std::vector<bool> touched(triangles.size(), false);
    bool flipped = false;
    for (const auto& [e, t] : side) {
      if (e.first > e.second) continue;
      const auto other = side.find({e.second, e.first});
      if (other == side.end()) continue;
      const int u = other->second;
      if (touched[t] || touched[u]) continue;
      const int a = e.first, b = e.second;
      const int c = triangles[t][0] + triangles[t][1] + triangles[t][2] - a - b;
      const int d = triangles[u][0] + triangles[u][1] + triangles[u][2] - a - b;
      const Place ca = at[a] - at[c], cb = at[b] - at[c], da = at[a] - at[d], db = at[b] - at[d];
      const double cos1 = ca.dot(cb) / (ca.norm() * cb.norm() + 1e-300);
      const double cos2 = da.dot(db) / (da.norm() * db.norm() + 1e-300);
      if (cos1 + cos2 >= -1e-9) continue;  // opposite angles below pi together
      if (!(turn(at[c], at[a], at[d]) > 0) || !(turn(at[d], at[b], at[c]) > 0)) continue;
      triangles[t] = {c, a, d};
      triangles[u] = {d, b, c};
      touched[t] = touched[u] = flipped = true;
    }
    if (!flipped) return;
  }
}

/// Mean value coordinates of a place within a polygon.
std::vector<double> mean_values(const std::vector<Place>& loop, std::size_t n, const Place& p) {
  std::vector<double> tangent(n), w(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Place a = loop[i] - p, b = loop[(i + 1) % n] - p;
    const double cross = a.x() * b.y() - a.y() * b.x(), lengths = a.norm() * b.norm();
    tangent[i] = std::fabs(cross) > 1e-30 ? (lengths - a.dot(b)) / cross : 0;
  }
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) {
    w[i] = (tangent[(i + n - 1) % n] + tangent[i]) / ((loop[i] - p).norm() + 1e-30);
    sum += w[i];
  }
  for (double& v : w) v /= sum;
  return w;
}

double distance_to(const Place& a, const Place& b, const Place& p) {
  const double s =
      std::max(0.0, std::min(1.0, (p - a).dot(b - a) / ((b - a).squaredNorm() + 1e-300)));
  return (a + s * (b - a) - p).norm();
}

/// Axes of the plane that a loop is seen in.
struct View {
  Vec3 middle, u, v, normal;
  Place place(const Vec3& x) const { return Place(u.dot(x - middle), v.dot(x - middle)); }
  double height(const Vec3& x) const { return normal.dot(x - middle); }
};

/// Sheets as triangles over the plane.
class Relief {
 public:
  Relief(const std::vector<std::array<Vec3, 4>>& sheets, const View& view, const Place& low,
         const Place& high) {
    for (const auto& w : sheets) {
      for (const auto& t : {std::array<int, 3>{0, 1, 3}, std::array<int, 3>{0, 3, 2}}) {
        Facet f;
        Place least(1e300, 1e300), most(-1e300, -1e300);
        for (int i = 0; i < 3; ++i) {
          f.at[i] = view.place(w[t[i]]);
          f.height[i] = view.height(w[t[i]]);
          least = least.cwiseMin(f.at[i]);
          most = most.cwiseMax(f.at[i]);
        }
        f.area2 = turn(f.at[0], f.at[1], f.at[2]);
        if (f.area2 == 0 || (least - high).maxCoeff() > 0 || (low - most).maxCoeff() > 0) continue;
        facets_.push_back(f);
      }
    }
  }
  /// Adds to `height` what leads to the sheet that is nearest above or below, no further than
  /// `most`. Between sheets that do not quite meet the one that is nearer goes on.
  bool find(const Place& p, double most, double& height) const {
    double best_inside = kBeside, best = most, found = 0;
    bool any = false;
    for (const Facet& f : facets_) {
      const double w0 = turn(p, f.at[1], f.at[2]) / f.area2;
      const double w1 = turn(f.at[0], p, f.at[2]) / f.area2;
      const double inside = std::min(0.0, std::min({w0, w1, 1 - w0 - w1}) + 1e-6);
      if (!(inside >= best_inside)) continue;
      const double h = w0 * f.height[0] + w1 * f.height[1] + (1 - w0 - w1) * f.height[2];
      const double off = std::fabs(h - height);
      if (off > most || (inside == best_inside && off >= best)) continue;
      best_inside = inside;
      best = off;
      found = h;
      any = true;
    }
    if (any) height = found;
    return any;
  }

 private:
  static constexpr double kBeside = -1;  ///< of a facet's size
  struct Facet {
    Place at[3];
    double height[3], area2;
  };
  std::vector<Facet> facets_;
};

}  // namespace

CapMesh fill_loop(const std::vector<Vec3>& loop, double edge,
                  const std::vector<std::array<Vec3, 4>>& sheets) {
  const std::size_t n = loop.size();
  Vec3 normal = Vec3::Zero(), middle = Vec3::Zero();
  for (std::size_t i = 0; i < n; ++i) {
    normal += (loop[i] - loop[0]).cross(loop[(i + 1) % n] - loop[0]);
    middle += loop[i] / static_cast<double>(n);
  }
  CapMesh cap;
  if (!(normal.norm() > 1e-3 * edge * edge)) return cap;
  normal.normalize();
  const Vec3 u = normal.unitOrthogonal(), v = normal.cross(u);
  std::vector<Place> at;
  std::vector<double> height;
  Place low(1e300, 1e300), high(-1e300, -1e300);
  for (const Vec3& x : loop) {
    at.emplace_back(u.dot(x - middle), v.dot(x - middle));
    height.push_back(normal.dot(x - middle));
    low = low.cwiseMin(at.back());
    high = high.cwiseMax(at.back());
  }
  cap.triangles = clip_ears(at);
  if (cap.triangles.empty()) return cap;
  // Inner vertices on a triangular lattice, off the loop.
  const double row = std::sqrt(0.75) * edge;
  int odd = 0;
  for (double y = low.y() + 0.5 * row; y < high.y(); y += row, odd ^= 1) {
    for (double x = low.x() + (odd != 0 ? 0.75 : 0.25) * edge; x < high.x(); x += edge) {
      const Place p(x, y);
      bool is_far = true;
      for (std::size_t i = 0; i < n && is_far; ++i) {
        is_far = distance_to(at[i], at[(i + 1) % n], p) > 0.55 * edge;
      }
      if (!is_far) continue;
      for (std::size_t t = 0; t < cap.triangles.size(); ++t) {
        const std::array<int, 3> c = cap.triangles[t];
        if (!holds(at[c[0]], at[c[1]], at[c[2]], p)) continue;
        const int k = static_cast<int>(at.size());
        at.push_back(p);
        cap.triangles[t] = {c[0], c[1], k};
        cap.triangles.push_back({c[1], c[2], k});
        cap.triangles.push_back({c[2], c[0], k});
        break;
      }
    }
  }
  flip_to_delaunay(at, cap.triangles);
  const View view = {middle, u, v, normal};
  const Relief relief(sheets, view, low, high);
  const double most = 0.25 * (high - low).norm();
  // What the loop is off the sheets, for they are not quite where the tissue is.
  std::vector<double> off(n, 0.0);
  std::vector<bool> is_met(n, false);
  for (std::size_t k = 0; k < n; ++k) {
    double h = height[k];
    is_met[k] = relief.find(at[k], most, h);
    off[k] = height[k] - h;
  }
  for (std::size_t i = n; i < at.size(); ++i) {
    cap.weights.push_back(mean_values(at, n, at[i]));
    double rise = 0, share = 0, aside = 0;
    for (std::size_t k = 0; k < n; ++k) {
      const double w = cap.weights.back()[k];
      rise += w * height[k];
      if (is_met[k]) share += w;
      if (is_met[k]) aside += w * off[k];
    }
    double of_sheet = rise;
    if (share > 0.5 && relief.find(at[i], most, of_sheet)) rise = of_sheet + aside / share;
    cap.inner.push_back(middle + at[i].x() * u + at[i].y() * v + rise * normal);
  }
  return cap;
}

void widen_angles(const std::vector<Vec3>& loop, CapMesh& cap) {
  constexpr int kRounds = 30;
  constexpr double kShares[] = {0.5, 0.25, 0.1};  // of the way to the middle of those around
  const int n = static_cast<int>(loop.size());
  std::vector<Vec3> at = loop;
  at.insert(at.end(), cap.inner.begin(), cap.inner.end());
  using Corners = std::array<int, 3>;
  const auto least = [&](const Corners& t) { return smallest_angle(at[t[0]], at[t[1]], at[t[2]]); };
  const auto normal = [&](const Corners& t) {
    return Vec3((at[t[1]] - at[t[0]]).cross(at[t[2]] - at[t[0]]));
  };
  bool any = true;
  for (int round = 0; any && round < kRounds; ++round) {
    any = false;
    std::map<std::pair<int, int>, int> side;  // triangle that has the edge in this sense
    std::vector<std::vector<int>> around(at.size());
    for (std::size_t t = 0; t < cap.triangles.size(); ++t) {
      for (int i = 0; i < 3; ++i) {
        side[{cap.triangles[t][i], cap.triangles[t][(i + 1) % 3]}] = static_cast<int>(t);
        around[cap.triangles[t][i]].push_back(static_cast<int>(t));
      }
    }
    std::vector<bool> touched(cap.triangles.size(), false);
    for (const auto& [e, t] : side) {
      const auto other = side.find({e.second, e.first});
      if (e.first > e.second || other == side.end()) continue;
      const int u = other->second;
      if (touched[t] || touched[u]) continue;
      Corners &p = cap.triangles[t], &q = cap.triangles[u];
      const int a = e.first, b = e.second;
      const int c = p[0] + p[1] + p[2] - a - b, d = q[0] + q[1] + q[2] - a - b;
      const Corners new_p = {c, a, d}, new_q = {d, b, c};
      if (side.count({c, d}) + side.count({d, c}) > 0) continue;
      const Vec3 up = normal(p) + normal(q);
      if (!(normal(new_p).dot(up) > 0) || !(normal(new_q).dot(up) > 0)) continue;
      if (std::min(least(new_p), least(new_q)) < std::min(least(p), least(q)) + 1e-6) continue;
      p = new_p;
      q = new_q;
      touched[t] = touched[u] = any = true;
    }
    if (any) continue;
    for (int v = n; v < static_cast<int>(at.size()); ++v) {
      const auto star = [&] {
        double angle = 4;
        for (const int t : around[v]) angle = std::min(angle, least(cap.triangles[t]));
        return angle;
      };
      Vec3 middle = Vec3::Zero(), up = middle;
      std::vector<double> weights(n, 0.0);
      const double part = 0.5 / static_cast<double>(around[v].size());  // each around it is in two
      for (const int t : around[v]) {
        up += normal(cap.triangles[t]);
        for (const int c : cap.triangles[t]) {
          if (c == v) continue;
          middle += part * at[c];
          for (int k = 0; k < n; ++k) weights[k] += part * (c < n ? c == k : cap.weights[c - n][k]);
        }
      }
      const Vec3 was = at[v];
      const double before = star();
      for (const double share : kShares) {
        at[v] = was + share * (middle - was);
        const bool is_even = std::all_of(around[v].begin(), around[v].end(), [&](int t) {
          return normal(cap.triangles[t]).dot(up) > 0;
        });
        if (!is_even || star() < before + 1e-6) {
          at[v] = was;
          continue;
        }
        for (int k = 0; k < n; ++k)
          cap.weights[v - n][k] += share * (weights[k] - cap.weights[v - n][k]);
        any = true;
        break;
      }
    }
  }
  std::copy(at.begin() + n, at.end(), cap.inner.begin());
}

}  // namespace pbd
}  // namespace tissue_sim
