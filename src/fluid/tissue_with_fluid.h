// Tissue of any method, and fluid that presses on its surface and is pressed by it.
//
// A frame is a row of intervals as long as a few substeps of the fluid. In each the tissue advances
// as it would by itself; then the fluid does, against a surface that moves from where it was to
// where it is; then the tissue takes what the fluid pressed on its surface as impulses. So neither
// knows the other's substeps, and what one gains of momentum the other loses.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "fluid/fluid_device.h"
#include "fluid/sources.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// How far a hollow's filling went.
struct FillProgress {
  std::int32_t body = 0;
  std::int32_t filling = 0;  ///< 1 until its pressure was once what is asked for
  double pressure = 0;       ///< mean of the last moments [Pa]
  double asked = 0;          ///< [Pa]
};

class TissueWithFluid : public Tissue {
 public:
  /// What makes the tissue: of a scene with its fluids and hollows. Throws what fill_scene() does.
  using Make = std::unique_ptr<Tissue> (*)(const Scene&, std::vector<std::string>);
  /// `device`: where the fluid moves; null for the CPU.
  TissueWithFluid(const Scene& scene, std::vector<std::string> notes, Make make,
                  std::unique_ptr<FluidDevice> device = nullptr);

  void advance(double duration, const FrameInput& input) override;
  FrameResult finish() override { return result_; }

  int read_fluid(std::vector<std::uint8_t>& cloud) override;
  int fluid_particle_count() const override { return fluid_.particles.size(); }
  std::vector<FluidVolume> fluid_volumes() override;
  std::uint64_t checksum() override;
  Momentum momentum() override;
  std::vector<std::uint8_t> save() override;
  void restore(Span<const std::uint8_t> saved) override;

  int point_count() const override { return tissue_->point_count(); }
  int read_points(const PointSelection& selection, std::vector<std::uint8_t>& cloud) override {
    return tissue_->read_points(selection, cloud);
  }
  unsigned point_fields() const override { return tissue_->point_fields(); }
  void read_surface(SurfaceTriangles& surface) override { tissue_->read_surface(surface); }
  void push_surface(Span<const float> impulses) override { tissue_->push_surface(impulses); }
  bool moves_surface() const override { return tissue_->moves_surface(); }
  bool moves_anchors() const override { return tissue_->moves_anchors(); }
  int fragment_count() const override { return tissue_->fragment_count(); }
  Span<const Fragment> fragments() override { return tissue_->fragments(); }
  const std::vector<std::string>& notes() const override { return tissue_->notes(); }
  std::string device_name() const override { return tissue_->device_name(); }

 private:
  template <class Archive>
  void each_field(Archive& archive);
  void advance_interval(double duration, const FrameInput& input);
  void read_walls();  ///< the surface as it is becomes the end of an interval
  /// The same on the host. Returns whether it is another surface, which begins there, too.
  bool read_walls_on_host();
  void begin_on_gpu();  ///< with particles, and walls as they are
  void find_bits();
  void fill_up(double duration);
  void drop_lost();
  void follow_orders(Span<const FluidOrder> orders);
  /// Of each particle in which body's hollow it is; -1 for none.
  std::vector<int> find_enclosed();

  Scene scene_;
  Cpu cpu_;
  std::vector<Fluid> kinds_;
  std::unique_ptr<Tissue> tissue_;
  FluidState fluid_;
  std::unique_ptr<FluidDevice> device_;
  FluidWalls walls_;
  bool acts_ = false;           ///< what needs walls and particles on the host, in this interval
  bool pushes_on_gpu_ = false;  ///< what fluid presses does not come to the host
  bool walls_on_gpu_ = false;   ///< since they were last the host's, too
  SurfaceTriangles surface_;
  std::vector<float> rest_;  ///< its places at time zero, as when it was made
  std::vector<FillProgress> fills_;
  FluidSources sources_;
  double floor_ = 0;                   ///< below which fluid is lost [m]
  std::vector<ToolLoad> fluid_loads_;  ///< of the last interval
  FrameResult result_;
};

}  // namespace tissue_sim
