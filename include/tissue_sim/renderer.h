// Renderer: what cameras see of a simulation, by rays on the CPU. No window, no display, no GPU.
//
//   Renderer renderer(simulation.scene());
//   SceneView view;
//   read_view(simulation, view);     // on the simulation's thread
//   renderer.show(view);             // these two on any one thread
//   renderer.render(camera, camera.pose, images);
#pragma once

#include <memory>
#include <vector>

#include "tissue_sim/camera.h"
#include "tissue_sim/scene.h"
#include "tissue_sim/simulation.h"
#include "tissue_sim/tissue.h"

namespace tissue_sim {

/// A scene as it stands after a frame.
struct SceneView {
  SurfaceTriangles surface;
  std::vector<float> stress;  ///< von Mises, of each triangle [Pa]; empty where no camera shows it
  std::vector<Fragment> fragments;  ///< empty where no camera shows them by colours
  /// Fluid as a smooth surface, nine coordinates a triangle [m], the normals of its corners, and of
  /// each triangle FluidPoint::fluid and the colour, 0x00RRGGBB.
  std::vector<float> fluid, fluid_normals;
  std::vector<std::uint32_t> fluid_kind, fluid_colour;
  std::vector<ToolMotion> tools;  ///< parallels Scene::tools; their ends are drawn
};
/// Replaces `view`, whose memory is used again.
void read_view(Simulation& simulation, SceneView& view);

/// What an eye saw in its last image, for the flow to its next one: nothing at first.
struct LastLook {
  std::shared_ptr<const struct Shown> shown;
  Pose eye;
};

/// Whether this build can render: it was built with Embree. Otherwise Renderer's constructor
/// throws.
bool can_render();

/// The same view and pose give the same bits on any processor with SSE 4.2. One thread owns it.
class Renderer {
 public:
  /// `threads` that draw, 0 for all of the processor's but one. Throws std::runtime_error without
  /// Embree.
  explicit Renderer(const Scene& scene, int threads = 0);
  ~Renderer();
  /// What render() draws from now on.
  void show(const SceneView& view);
  /// What an eye at this pose sees: the camera's left one at its pose, the right one `baseline`
  /// along x from there. With `last`, images.flow since that look, which becomes this one. Throws
  /// std::invalid_argument for a pose that is not finite.
  void render(const Camera& camera, const Pose& eye, CameraImages& images,
              LastLook* last = nullptr);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace tissue_sim
