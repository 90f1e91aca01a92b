// Where fluid comes from and goes to while a scene runs: tubes, wounds, drains.
#pragma once

#include <vector>

#include "fluid/fluid_state.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// What became of each fluid since the start [m^3].
struct FluidSums {
  double lost = 0, sucked = 0, drained = 0, bled = 0, irrigated = 0;
};

/// Particles come and go whole: what is due adds up to that of one.
class FluidSources {
 public:
  explicit FluidSources(const Scene& scene);

  /// Before a frame of `duration` seconds.
  void begin_frame(double duration);
  /// An interval: tools are where they end. `corners` and what they were at its begin.
  void act(const FrameInput& input, double duration, const FluidWalls& walls, FluidState& fluid);
  /// The surface is another one than before: wounds are those of its triangles that were cut.
  void find_wounds(const SurfaceTriangles& surface, Span<const Fragment> pieces);
  /// Takes these particles out, one after the other, in the next half second.
  void drain(const std::vector<std::uint32_t>& ids);
  /// Whether what was read is of this scene, with a surface of so many triangles.
  bool is_sound(std::size_t triangles) const;
  bool bleeds() const { return bleeds_; }
  /// Whether act() may change any particle.
  bool acts(const FrameInput& input) const;
  const std::vector<FluidSums>& sums() const { return sums_; }
  std::vector<FluidSums>& sums() { return sums_; }
  double bleeding(int kind) const { return bled_in_frame_[kind] / frame_; }

  template <class Archive>
  void each_field(Archive& archive) {
    for (FluidSums& s : sums_) {
      archive.part("sums", s.lost, s.sucked, s.drained, s.bled, s.irrigated);
    }
    archive.part("tubes", owed_, turn_, drained_, drain_rate_, drain_owed_, bled_in_frame_, frame_);
    archive.part("wounds", wound_triangle_, wound_material_, wound_rim_, wound_age_, wound_owed_,
                 wound_rest_);
  }

 private:
  struct Bleeds {
    Bleeding law;
    int kind;
  };
  void suck(const Tool& tool, int i, const Pose& pose, const FluidWalls& walls, FluidState& fluid);
  void irrigate(const Tool& tool, int i, const ToolMotion& motion, double duration,
                const FluidWalls& walls, FluidState& fluid);
  void bleed(double duration, const FluidWalls& walls, FluidState& fluid);
  void drain(double duration, FluidState& fluid);

  Scene scene_;
  std::vector<int> tube_kind_;  ///< of each tool's fluid, -1 for none
  std::vector<Bleeds> materials_;
  std::vector<std::vector<int>> body_materials_;  ///< of each body and its inclusions; -1: none
  bool bleeds_ = false;

  std::vector<FluidSums> sums_;
  std::vector<double> owed_;        ///< of each tool [m^3]
  std::vector<std::int32_t> turn_;  ///< of each tube: which place of its mouth is next
  std::vector<std::uint32_t> drained_;
  double drain_rate_ = 0, drain_owed_ = 0;  ///< [1/s], [1]
  double frame_ = 1;                        ///< [s]
  std::vector<double> bled_in_frame_;       ///< of each fluid [m^3]
  // Of each wound, a triangle.
  std::vector<std::int32_t> wound_triangle_, wound_material_;
  std::vector<std::int32_t> wound_rim_;  ///< a corner of skin that it has, 3 t + k; -1 for none
  std::vector<double> wound_age_, wound_owed_;  ///< [s], [m^3]
  std::vector<float> wound_rest_;               ///< nine numbers: what it is known by
  std::vector<double> wound_flow_;              ///< in this frame [m^3/s]
};

}  // namespace tissue_sim
