#include "pbd/tear.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>

#include "math/draw.h"
#include "pbd/cut.h"
#include "pbd/model.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// From this excess on a crack begins though another one may be about to relieve the place.
constexpr double kPatience = 1.1;

const Material& tissue_at(const State& s, std::int32_t v) {
  return material_at(s.scene, s.scene.bodies[s.vertices.body[v]], s.vertices.reference[v]);
}

bool is_held(const State& s, std::int32_t t) {
  return std::any_of(s.tetrahedra[t].begin(), s.tetrahedra[t].end(),
                     [&](std::int32_t v) { return s.vertices.anchored[v] != 0; });
}

Vec3 centre_of(const State& s, std::int32_t t) {
  Vec3 sum = Vec3::Zero();
  for (const std::int32_t v : s.tetrahedra[t]) sum += 0.25 * s.vertices.reference[v];
  return sum;
}

/// And its direction before it.
std::pair<double, Vec3> largest_stretch(const Eigen::Matrix3d& f) {
  const Eigen::Matrix3d c = f.transpose() * f;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  solver.computeDirect(c);
  return {std::sqrt(solver.eigenvalues()[2]), solver.eigenvectors().col(2)};
}

class Tears {
 public:
  explicit Tears(State& s) : s_(s), stretched_(s.vertices.size()), faces_at_(s.vertices.size()) {
    for (std::size_t i = 0; i < s.faces.size(); ++i) {
      const Tetrahedron &a = s.tetrahedra[s.faces[i].tetrahedron[0]],
                        &b = s.tetrahedra[s.faces[i].tetrahedron[1]];
      for (const std::int32_t v : a) {
        if (std::find(b.begin(), b.end(), v) != b.end())
          faces_at_[v].push_back(static_cast<int>(i));
      }
    }
  }

  /// Of each vertex how far it is past its limit, and which way. What a crack relieved does not
  /// count, and at its front the tetrahedron that is stretched most does.
  void measure() {
    const Vertices& v = s_.vertices;
    std::vector<std::uint8_t> is_relieved(s_.tetrahedra.size(), 0), is_beside(v.size(), 0);
    for (const InnerFace& f : s_.faces) {
      if (!f.is_cut) continue;
      for (const std::int32_t t : f.tetrahedron) {
        is_relieved[t] = 1;
        for (const std::int32_t i : s_.tetrahedra[t]) is_beside[i] = 1;
      }
    }
    std::vector<Eigen::Matrix3d> sum(v.size(), Eigen::Matrix3d::Zero());
    std::vector<double> volume(v.size(), 0.0), most(v.size(), 0.0);
    for (std::size_t k = 0; k < s_.tetrahedra.size(); ++k) {
      if (is_relieved[k] != 0) continue;
      const Tetrahedron& t = s_.tetrahedra[k];
      Eigen::Matrix3d p, q;
      for (int i = 0; i < 3; ++i) {
        p.col(i) = v.position(t[i + 1]) - v.position(t[0]);
        q.col(i) = v.reference[t[i + 1]] - v.reference[t[0]];
      }
      const double six = q.determinant();
      const Eigen::Matrix3d f = p * q.inverse();
      const bool is_ahead =
          std::any_of(t.begin(), t.end(), [&](auto i) { return is_beside[i] != 0; });
      const double stretch = is_ahead && f.allFinite() ? largest_stretch(f).first : 0;
      for (const std::int32_t i : t) {
        sum[i] += six * f;
        volume[i] += six;
        most[i] = std::max(most[i], stretch);
      }
    }
    for (int i = 0; i < v.size(); ++i) {
      if (v.anchored[i] != 0 || !(volume[i] > 0)) continue;
      const Material& m = tissue_at(s_, i);
      if (m.tear_stretch == 0) continue;
      const Eigen::Matrix3d f = sum[i] / volume[i];
      if (!f.allFinite()) continue;  // the frame's end will find out
      auto [stretch, n] = largest_stretch(f);
      int axis = 0;  // neighbours agree which of its two senses is up
      n.cwiseAbs().maxCoeff(&axis);
      if (n[axis] < 0) n = -n;
      if (is_at_crack(i)) stretch = most[i];
      const double scatter = 1 + m.tear_scatter * draw(s_.scene.seed, s_.copy_of[i]);
      stretched_[i] = {(stretch - 1) / ((m.tear_stretch - 1) * scatter), n};
    }
  }

  /// The vertices of fronts that are past their limit.
  std::vector<std::int32_t> fronts() const {
    std::vector<std::int32_t> found;
    for (int v = 0; v < s_.vertices.size(); ++v) {
      if (stretched_[v].excess >= 1 && is_at_crack(v)) found.push_back(v);
    }
    return found;
  }

  /// Of each body the vertex where a crack begins, if any.
  std::vector<std::int32_t> beginnings() const {
    std::vector<std::uint8_t> is_beside(s_.vertices.size(), 0);  // a crack, within two rings
    for (int ring = 0; ring < 2; ++ring) {
      std::vector<std::uint8_t> near = is_beside;
      for (const InnerFace& f : s_.faces) {
        for (const std::int32_t t : f.tetrahedron) {
          const Tetrahedron& c = s_.tetrahedra[t];
          const bool is_near = ring == 0 ? f.is_cut : std::any_of(c.begin(), c.end(), [&](auto v) {
            return is_beside[v] != 0;
          });
          for (const std::int32_t v : c) near[v] |= is_near ? 1 : 0;
        }
      }
      is_beside.swap(near);
    }
    std::vector<std::int32_t> first(s_.scene.bodies.size(), -1);
    for (int v = 0; v < s_.vertices.size(); ++v) {
      std::int32_t& best = first[s_.vertices.body[v]];
      const double excess = stretched_[v].excess;
      const bool waits = s_.relieved_in[s_.vertices.body[v]] > 0 && excess < kPatience;
      if (excess < 1 || waits || is_beside[v] != 0) continue;
      if (best < 0 || excess > stretched_[best].excess) best = v;
    }
    first.erase(std::remove(first.begin(), first.end(), -1), first.end());
    return first;
  }

  /// Parts what lies on two sides of a vertex.
  void part(std::int32_t v) {
    stretched_[v].excess = 0;  // once a look
    std::map<std::int32_t, int> side;
    const Vec3 n = stretched_[v].normal;
    Vec3 middle = Vec3::Zero();
    int broken = 0, held = 0;
    for (const int i : faces_at_[v]) {
      const InnerFace& f = s_.faces[i];
      for (const std::int32_t t : f.tetrahedron) {
        if (side.try_emplace(t, 0).second && is_held(s_, t)) ++held;
      }
      if (!f.is_cut) continue;
      middle += 0.5 * (centre_of(s_, f.tetrahedron[0]) + centre_of(s_, f.tetrahedron[1]));
      ++broken;
    }
    const Vec3 through = broken > 0 ? Vec3(middle / broken) : s_.vertices.reference[v];
    for (auto& [t, of] : side) {
      // What lies in the plane itself is above it.
      const double off = n.dot(centre_of(s_, t) - through) + 1e-4 * s_.mean_edge;
      of = held > 0 ? (is_held(s_, t) ? 1 : 2) : off > 0 ? 2 : 1;
    }
    if (held == 0) {  // sides that the crack gave
      std::map<std::int32_t, double> given;
      for (const int i : faces_at_[v]) {
        const auto [a, b] = s_.faces[i].tetrahedron;
        if (!s_.faces[i].is_cut) continue;
        const double across = n.dot(centre_of(s_, b) - centre_of(s_, a));
        given[a] -= across;
        given[b] += across;
      }
      for (const auto& [t, across] : given) side[t] = across > 0 ? 2 : 1;
    }
    for (const int i : faces_at_[v]) {
      InnerFace& f = s_.faces[i];
      if (f.is_cut || side[f.tetrahedron[0]] == side[f.tetrahedron[1]]) continue;
      f.is_cut = true;
      torn.push_back(i);
    }
  }

  std::vector<std::int32_t> torn;  ///< faces

 private:
  struct Stretch {
    double excess = 0;  ///< strain over its limit
    Vec3 normal = Vec3::Zero();
  };
  bool is_at_crack(std::int32_t v) const {
    return std::any_of(faces_at_[v].begin(), faces_at_[v].end(),
                       [this](int i) { return s_.faces[i].is_cut; });
  }

  State& s_;
  std::vector<Stretch> stretched_;
  std::vector<std::vector<int>> faces_at_;  ///< that have the vertex on both sides
};

template <class F>
void each_tearing(const State& s, const F& f) {
  for (std::size_t b = 0; b < s.scene.bodies.size(); ++b) {
    const Body& body = s.scene.bodies[b];
    const auto tell = [&](const std::string& name) {
      const Material& m = find_material(s.scene, name);
      if (m.tear_stretch > 0) f(m);
    };
    tell(body.material);
    for (const Inclusion& i : body.inclusions) tell(i.material);
  }
}

}  // namespace

bool can_tear(const State& s) {
  bool any = false;
  each_tearing(s, [&](const Material&) { any = true; });
  return any && !s.tetrahedra.empty();
}

int tear_checks(const State& s, double duration) {
  double fastest = 0;
  each_tearing(s, [&](const Material& m) { fastest = std::max(fastest, wave_speed(m)); });
  return static_cast<int>(std::ceil(duration * fastest / (kTearSteps * 0.5 * s.mean_edge)));
}

bool tear_tetrahedra(State& s, double since, std::vector<std::int32_t>& origin, CutReport& report) {
  if (s.faces.empty()) find_faces(s);
  s.relieved_in.resize(s.scene.bodies.size(), 0.0);
  for (double& left : s.relieved_in) left = std::max(0.0, left - since);
  Tears tears(s);
  tears.measure();
  for (int step = 0; step < kTearSteps; ++step) {
    std::vector<std::int32_t> at = tears.fronts();
    if (at.empty() && step == 0) at = tears.beginnings();
    if (at.empty()) break;
    for (const std::int32_t v : at) tears.part(v);
  }
  if (tears.torn.empty()) return false;
  std::vector<Box> room(s.scene.bodies.size());
  for (int v = 0; v < s.vertices.size(); ++v) {
    Box& box = room[s.vertices.body[v]];
    box.min = box.min.cwiseMin(s.vertices.reference[v]);
    box.max = box.max.cwiseMax(s.vertices.reference[v]);
  }
  for (const std::int32_t i : tears.torn) {
    const std::int32_t v = s.tetrahedra[s.faces[i].tetrahedron[0]][0];
    const int b = s.vertices.body[v];
    s.relieved_in[b] = (room[b].max - room[b].min).maxCoeff() / wave_speed(tissue_at(s, v));
  }
  return part_faces(s, tears.torn, origin, report);
}

}  // namespace pbd
}  // namespace tissue_sim
