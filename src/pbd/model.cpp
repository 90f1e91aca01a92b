#include "pbd/model.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "tissue_sim/limits.h"

namespace tissue_sim {
namespace pbd {
namespace {

/// Bits of a 21-bit number, two free ones after each.
std::uint64_t spread(std::uint64_t v) {
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  return (v | v << 2) & 0x1249249249249249;
}

void hold_anchored(State& s, std::vector<std::string>* notes) {
  for (std::size_t b = 0; b < s.scene.bodies.size(); ++b) {
    const Body& body = s.scene.bodies[b];
    bool any = body.anchors.empty();
    const double within = rounding_of(s, static_cast<int>(b));
    for (int i = 0; i < s.vertices.size(); ++i) {
      if (s.vertices.body[i] != static_cast<int>(b)) continue;
      if (holder_of(body, s.vertices.reference[i], within) < 0) continue;
      s.vertices.anchored[i] = 1;
      any = true;
    }
    if (!any && notes != nullptr) {
      notes->push_back("body '" + body.name +
                       "': its anchors hold none of its vertices: it is free");
    }
  }
}

}  // namespace

std::vector<int> morton_order(const std::vector<Vec3>& places) {
  Box box;
  for (const Vec3& x : places) {
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  const double scale = 2097151 / std::max(1e-12, (box.max - box.min).maxCoeff());
  std::vector<std::pair<std::uint64_t, int>> keys;
  for (std::size_t i = 0; i < places.size(); ++i) {
    const Vec3 at = scale * (places[i] - box.min);
    std::uint64_t key = 0;
    for (int a = 0; a < 3; ++a) key |= spread(static_cast<std::uint64_t>(at[a])) << a;
    keys.emplace_back(key, static_cast<int>(i));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<int> order;
  for (const auto& k : keys) order.push_back(k.second);
  return order;
}

const Material& material_at(const Scene& scene, const Body& body, const Vec3& x) {
  for (auto i = body.inclusions.rbegin(); i != body.inclusions.rend(); ++i) {
    if (i->region.contains(x)) return find_material(scene, i->material);
  }
  return find_material(scene, body.material);
}

Materials::Materials(const State& s) : scene_(s.scene) {
  for (const Body& body : scene_.bodies) {
    of_body_.push_back(body.inclusions.empty() ? &find_material(scene_, body.material) : nullptr);
  }
}

std::unique_ptr<State> make_state(const Scene& scene, std::vector<std::string>* notes) {
  auto s = std::make_unique<State>(scene);
  for (const Body& body : scene.bodies) {
    const auto tell = [&](const std::string& material) {
      const Material& m = find_material(scene, material);
      if (notes == nullptr) return;
      if (m.tear_stretch > 0 && scene.pbd.model == PbdModel::kSurface) {
        notes->push_back("material '" + m.name + "': surfaces of method pbd do not tear");
      } else if (m.tear_stretch > 0 && m.tear_length > 0) {
        notes->push_back("material '" + m.name +
                         "': tear_length does nothing, a tip bears what its vertices do");
      }
    };
    tell(body.material);
    for (const Inclusion& i : body.inclusions) tell(i.material);
  }
  for (std::size_t b = 0; b < scene.bodies.size(); ++b) {
    const LimitWork rest(with_points(work_limits().max_points - s->vertices.size()));
    if (scene.pbd.model == PbdModel::kSurface) {
      add_surface_body(*s, static_cast<int>(b), notes);
    } else {
      add_tet_body(*s, static_cast<int>(b), notes);
    }
  }
  hold_anchored(*s, notes);
  for (const Triangle& t : s->triangles) {
    for (int i = 0; i < 3; ++i) {
      const Vec3 e = s->vertices.reference[t[i]] - s->vertices.reference[t[(i + 1) % 3]];
      s->mean_edge += e.norm() / (3.0 * static_cast<double>(s->triangles.size()));
    }
  }
  share_out_mass(*s);
  choose_steps(*s, notes);
  make_surface_constraints(*s);
  make_tet_constraints(*s);
  pack(*s);
  return s;
}

}  // namespace pbd
}  // namespace tissue_sim
