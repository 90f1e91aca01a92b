// Tissue: the state of all bodies under one method on one device.
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "tissue_sim/cut.h"
#include "tissue_sim/fragments.h"
#include "tissue_sim/point.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tool.h"
#include "tissue_sim/types.h"

namespace tissue_sim {

/// Motion of an anchor over one frame, about Anchor::origin(): position linear, orientation slerp.
/// At rest it is at its origin, without rotation.
struct AnchorMotion {
  Pose begin, end;
};

/// What happens during one frame; `tools` parallels Scene::tools.
struct FrameInput {
  Span<const ToolMotion> tools;
  Span<const BladePath> cuts;  ///< applied at the start of the frame, before the first substep
  /// Of all bodies' anchors, in the order of the scene; empty where none ever moved.
  Span<const AnchorMotion> anchors = {};
  const Vec3* gravity = nullptr;      ///< from this frame on, if given [m/s^2]
  const double* damping = nullptr;    ///< the same [1/s]
  Span<const FluidOrder> fluid = {};  ///< at the start of the frame
};

/// Gravity and damping that a frame changes.
inline void follow(const FrameInput& input, Scene& scene) {
  if (input.gravity != nullptr) scene.gravity = *input.gravity;
  if (input.damping != nullptr) scene.damping = *input.damping;
}

/// What one frame brought.
struct FrameResult {
  std::vector<ToolLoad> loads;         ///< parallels Scene::tools
  int points_inside = 0;               ///< in any of the tools: ToolLoad::points_inside
  double inside_depth = 0;             ///< of the deepest of them [m]
  std::vector<CutReport> cut_reports;  ///< parallels FrameInput::cuts
  std::vector<Wrench> anchor_loads;    ///< of the tissue on each anchor, mean of the frame, about
                                       ///< its origin where it is now; in the order of the scene
  CutReport blade_report;              ///< what the instruments' edges cut
  CutReport tear_report;               ///< what tore by itself (Material::tear_stretch)
  int substeps = 0;
  double substep = 0;           ///< the longest of them [s]
  int fragment_candidates = 0;  ///< points that the fragment network looked at
  int fragment_points = 0;      ///< of these, those that it expects to part
  double kinetic_energy = 0;    ///< [J]
  double elastic_energy = 0;    ///< [J]
  double cutting_work = 0;      ///< of blades in tissue that resists: toughness times area [J]
  double max_speed = 0;         ///< of a point [m/s]
  bool blew_up = false;         ///< something is not finite, or moves faster than it can
};

/// Of all tissue, in world axes.
struct Momentum {
  double mass = 0;              ///< [kg]
  Vec3 centre = Vec3::Zero();   ///< of the mass [m]
  Vec3 linear = Vec3::Zero();   ///< [kg m/s]
  Vec3 angular = Vec3::Zero();  ///< about the centre of mass [kg m^2/s]
};

/// The triangles of a surface, counter-clockwise seen from outside.
struct SurfaceTriangles {
  std::vector<float> corners;          ///< nine coordinates a triangle [m], world frame
  std::vector<float> rest;             ///< where these were at time zero, of the same material [m]
  std::vector<std::int32_t> fragment;  ///< Fragment::id of each triangle
  std::vector<std::int32_t> point;     ///< Point::id of the tissue there, one of several for some
  std::vector<std::uint8_t> cut;       ///< of each: 1 where a cut or a tear made it, else 0
  /// Another number whenever anything but `corners` is not what it was; 0: nobody knows.
  std::uint64_t made = 0;
};

/// Points in a GPU's memory, written and valid for as long as `bytes` is held.
struct GpuPoints {
  std::shared_ptr<const void> bytes;  ///< Point after Point
  int count = 0;
  int gpu = -1;  ///< CUDA's number of it; -1: the tissue is on a CPU
};

/// Corners of a surface in the memory of the GPU that the tissue is on: nine numbers a triangle
/// [m].
struct GpuSurface {
  const float* corners = nullptr;
  int triangles = 0;
};

/// All bodies of a scene. One thread owns it; a frame is advance(), then finish(), and what is read
/// holds until the next one.
class Tissue {
 public:
  virtual ~Tissue() = default;

  /// Advances by `duration` seconds, in as many substeps as the method takes; may only enqueue.
  virtual void advance(double duration, const FrameInput& input) = 0;
  /// Waits for advance() and reports on it.
  virtual FrameResult finish() = 0;

  virtual int point_count() const = 0;
  /// Replaces `cloud` with the selected points, as Point after Point. Returns their number.
  virtual int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) = 0;
  /// The same in the memory of the GPU that the tissue is on, for who works on them there.
  virtual GpuPoints read_points_on_gpu(const PointSelection& /*selection*/) { return {}; }
  /// Which PointFields read_points() can add.
  virtual unsigned point_fields() const { return ~0u; }
  /// Replaces `surface` with the tissue's, as of the last finish(). Cheapest where it is the one
  /// that was read last.
  virtual void read_surface(SurfaceTriangles& surface) = 0;
  /// Gives the tissue impulses at the corners of the triangles that read_surface() gave last, since
  /// when it must not have advanced: three numbers a triangle, which each corner gets [N s]. They
  /// go to what moves a corner.
  virtual void push_surface(Span<const float> /*impulses*/) {
    throw std::logic_error("nothing presses on the surface of this tissue from without");
  }
  /// The triangles of `read`, which read_surface() gave last, where they are now; until the tissue
  /// advances. None where it is not on a GPU, or has others by now.
  virtual GpuSurface surface_on_gpu(const SurfaceTriangles& /*read*/) { return {}; }
  /// As push_surface(), of impulses there; they stay until the tissue has advanced.
  virtual void push_surface_on_gpu(const float* /*impulses*/) {
    throw std::logic_error("the surface of this tissue is not on a GPU");
  }
  /// Whether that is what the method moves; else it is made of what it moves, when it is read.
  virtual bool moves_surface() const { return false; }
  /// Whether FrameInput::anchors move what they hold, and FrameResult has their loads.
  virtual bool moves_anchors() const { return false; }
  /// Replaces `cloud` with the scene's fluid, as FluidPoint after FluidPoint. Returns their number.
  virtual int read_fluid(std::vector<std::uint8_t>& cloud) {
    cloud.clear();
    return 0;
  }
  virtual int fluid_particle_count() const { return 0; }
  /// Of each of the scene's fluids, then of the presets that it uses: how much there is, and where.
  virtual std::vector<FluidVolume> fluid_volumes() { return {}; }
  /// Number of pieces, as of the last finish(). It grows whenever a piece comes apart.
  virtual int fragment_count() const = 0;
  /// All pieces, by id, as of the last finish(). The first call after that looks where they are.
  virtual Span<const Fragment> fragments() = 0;
  /// Hash of the whole state: equal states, equal checksums.
  virtual std::uint64_t checksum() = 0;
  /// As of the last finish().
  virtual Momentum momentum() = 0;
  /// The whole state between two frames, for restore().
  virtual std::vector<std::uint8_t> save() = 0;
  /// Goes on from there, in tissue of the same scene, method and device that has not advanced yet:
  /// with the same bits as what was saved. Throws std::runtime_error for bytes that are no such
  /// state; then it must not be used any more.
  virtual void restore(Span<const std::uint8_t> saved) = 0;
  /// What was repaired or assumed when the scene was built (a mesh turned inside out, ...).
  virtual const std::vector<std::string>& notes() const = 0;
  /// Device and instruction set that do the work, as in "cpu (AVX-512, 2 threads)".
  virtual std::string device_name() const = 0;
};

/// Builds the tissue of a valid scene. Throws std::invalid_argument for what cannot be built (a
/// mesh that cannot be read, a body thinner than a cell; TooLarge) and std::runtime_error for a
/// device not there (OutOfMemory).
std::unique_ptr<Tissue> make_tissue(const Scene& scene);

}  // namespace tissue_sim
