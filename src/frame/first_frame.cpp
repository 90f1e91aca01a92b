#include "frame/first_frame.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <set>
#include <stdexcept>

#include "frame/part_substeps.h"
#include "frame/stability_limit.h"
#include "scene/method_options.h"
#include "scene/scene_text.h"
#include "tissue_sim/point.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {
namespace {

/// Substeps of a frame of this material, at rest, on a lattice of that spacing.
double substeps_of(const Scene& scene, const Material& m, double spacing) {
  const double modulus = wave_modulus(m, 1);
  const double elastic = scene.cfl * spacing * std::sqrt(m.density / modulus);
  const double damping = 5 * m.viscosity / (m.density * spacing * spacing);  // mpm/state_figures
  const double longest = viscous_substep(elastic, damping);
  return 1 / (scene.frame_rate * longest);
}

std::string metres(double z) { return text(static_cast<float>(z)) + " m"; }

}  // namespace

void check_first_frame(const Scene& scene) {
  const Spacing spacing = options_of(scene.method).spacing(scene);
  if (spacing.lattice == 0) return;
  std::set<std::string> used;
  for (const Body& body : scene.bodies) {
    used.insert(body.material);
    for (const Inclusion& i : body.inclusions) used.insert(i.material);
  }
  for (const std::string& name : used) {
    const Material& m = find_material(scene, name);
    const double count = substeps_of(scene, m, spacing.lattice);
    if (count <= kMostSubstepsOfFrame) continue;
    throw std::invalid_argument(
        "a frame takes some " + text(static_cast<float>(std::round(count))) +
        " substeps, at most 100000 make sense (frame_rate is " + text(scene.frame_rate) + " Hz, " +
        spacing.field + " " + text(spacing.value) + " m, of material '" + name + "' viscosity " +
        text(m.viscosity) + " Pa s and young_modulus " + text(m.young_modulus) +
        " Pa): raise frame_rate or the spacing, or lower viscosity or young_modulus");
  }
}

void check_ground(const Scene& scene, Span<const Fragment> pieces) {
  if (!scene.ground.enabled) return;
  for (const Fragment& piece : pieces) {
    if (!(piece.box.max.z() <= scene.ground.z)) continue;
    throw std::invalid_argument(
        "body '" + scene.bodies[piece.body].name +
        "' lies below the ground (it reaches up to z = " + metres(piece.box.max.z()) +
        ", ground.z is " + metres(scene.ground.z) +
        "): move it up by pose.position, or set ground.enabled to false");
  }
}

void check_held(const Scene& scene, Tissue& tissue) {
  if (!scene.ground.enabled) return;
  const Span<const Fragment> pieces = tissue.fragments();
  const double least = scene.ground.z - scene.cell_size;
  const auto reaches_below = [&](const Fragment& piece) {
    return piece.box.min.z() < least && !scene.bodies[piece.body].anchors.empty();
  };
  if (std::none_of(pieces.begin(), pieces.end(), reaches_below)) return;
  std::vector<std::uint8_t> cloud;
  const int count = tissue.read_points({}, cloud);
  for (int i = 0; i < count; ++i) {
    Point p;
    std::memcpy(&p, cloud.data() + i * sizeof(Point), sizeof(Point));
    if (!(p.z < least)) continue;
    const Body& body = scene.bodies[pieces[p.fragment].body];
    if (body.anchors.empty()) continue;
    const auto holds = [&p](const Anchor& a) { return a.contains(Vec3(p.x, p.y, p.z)); };
    if (std::any_of(body.anchors.begin(), body.anchors.end(), holds)) continue;
    throw std::invalid_argument(
        "the ground would tear body '" + body.name + "', which anchors hold: tissue that they do " +
        "not reach begins " + metres(scene.ground.z - p.z) + " below it (ground.z is " +
        metres(scene.ground.z) + "): move the body up by pose.position, lower the ground, or set " +
        "ground.enabled to false");
  }
}

std::vector<std::string> ground_notes(const Scene& scene, Span<const Fragment> pieces) {
  std::vector<std::string> notes;
  if (!scene.ground.enabled) return notes;
  for (const Fragment& piece : pieces) {
    const double depth = scene.ground.z - piece.box.min.z();
    const std::vector<Anchor>& anchors = scene.bodies[piece.body].anchors;
    if (!(depth > scene.cell_size) || !anchors.empty()) continue;
    notes.push_back("body '" + scene.bodies[piece.body].name + "' begins " + metres(depth) +
                    " below the ground, which throws it up: move it by pose.position");
  }
  return notes;
}

}  // namespace tissue_sim
