// Fluid that moves on a GPU.
#pragma once

#include <memory>
#include <vector>

#include "fluid/fluid_state.h"

namespace tissue_sim {

/// FluidState has what is the host's: laws, spacing, which triangles are bits; its particles are
/// those of send() until bring().
class FluidDevice {
 public:
  virtual ~FluidDevice() = default;
  /// Takes all particles over; who may act on whom is listed anew.
  virtual void send(const FluidState& state) = 0;
  /// Takes their volumes over, of as many.
  virtual void send_volumes(const FluidState& state) = 0;
  /// Gives places, velocities and pressures back.
  virtual void bring(FluidState& state) = 0;
  /// Where an interval's walls end, on the host or on the GPU; they begin where the last one's
  /// ended. `are_new`: they begin here, too.
  virtual void set_walls(const float* corners, int triangles, bool are_new) = 0;
  /// As advance_fluid(), but for impulses().
  virtual int advance(const FluidState& state, const FluidDrive& drive,
                      std::vector<ColliderLoad>& loads) = 0;
  /// Of the last advance(), on the GPU, as Tissue::push_surface_on_gpu() takes them.
  virtual const float* impulses() const = 0;
  /// Puts them into FluidWalls::impulse.
  virtual void bring_impulses(FluidWalls& walls) = 0;
  /// As push_out_of_walls(), of where walls end.
  virtual void push_out_of_walls(const FluidState& state) = 0;
};

/// Throws std::runtime_error where there is no GPU.
std::unique_ptr<FluidDevice> make_fluid_on_gpu();

}  // namespace tissue_sim
