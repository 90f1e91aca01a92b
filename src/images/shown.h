// Shown: what is there to be seen, which of it rays meet first, and where that was before.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "images/ray_scene.h"
#include "images/smooth_normals.h"
#include "tissue_sim/renderer.h"
#include "tools/tool_shapes.h"

namespace tissue_sim {

inline constexpr int kPacket = RayScene::kPacket;  ///< rays that are followed side by side

/// What a ray meets first.
struct Hit {
  double t = 0;
  Vec3 normal = Vec3::Zero();
  std::uint16_t label = kNoLabel;
  std::int32_t triangle = -1;  ///< of tissue; else the ground or a tool
  std::int32_t part = -1;      ///< of a tool
  std::int32_t fluid = -1;     ///< a triangle of its surface
  float u = 0, v = 0;          ///< in the triangle
};

/// Of what the triangle's corners have, `x` nine numbers.
inline Vec3 interpolated(const float* x, const Hit& hit) {
  const float w = 1 - hit.u - hit.v;
  return {w * x[0] + hit.u * x[3] + hit.v * x[6], w * x[1] + hit.u * x[4] + hit.v * x[7],
          w * x[2] + hit.u * x[5] + hit.v * x[8]};
}
/// A place, as seen from a pose.
Vec3 in_axes_of(const Pose& pose, const Vec3& place);

/// A part of what an eye sees without distortion, at a depth of 1.
struct Window {
  double low[2] = {-INFINITY, -INFINITY}, high[2] = {INFINITY, INFINITY};

  bool meets(const Window& o) const {
    return low[0] <= o.high[0] && o.low[0] <= high[0] && low[1] <= o.high[1] && o.low[1] <= high[1];
  }
};
/// What packets of rays come from.
struct Eye {
  const Camera& camera;
  Pose pose;
  Window tissue;  ///< where it sees that, fluid, and each part of a tool
  Window fluid;
  std::vector<Window> parts;
};

/// A tool's mesh, which lies still in its frame.
struct ToolMesh {
  RayScene rays;
  std::vector<float> normals;
  Vec3 centre;  ///< of the box about it, in the tool's frame [m]
  Vec3 size;    ///< of that [m]

  ToolMesh(const Tool& tool, Cpu& cpu);
};

struct Shown {
  struct Part {
    ToolShape shape;  ///< of a mesh the box about it
    std::uint16_t label;
    const ToolMesh* mesh;  ///< null for the shape itself
  };
  SurfaceTriangles surface;
  std::vector<float> normals;  ///< of each corner
  Box box;                     ///< of the surface
  std::vector<Part> parts;     ///< of tools
  RayScene rays;
  std::vector<float> fluid_normals;  ///< of each corner of its triangles
  std::vector<std::uint32_t> fluid_kind, fluid_colour;
  Box fluid_box;
  std::unique_ptr<RayScene> fluid_rays;  ///< null where there is none

  /// `meshes` of the scene's tools, null for none.
  void set(const SceneView& view, const Scene& scene,
           const std::vector<std::unique_ptr<ToolMesh>>& meshes, SmoothNormals& smooth, Cpu& cpu);
  Eye look(const Camera& camera, const Pose& pose) const;
  /// What a packet of rays meets, one for each direction; all are within the window.
  void meet(const Eye& eye, const Ground& ground, const Window& window, const Vec3* along,
            Hit* hits) const;
  /// Of each triangle that among the last ones which is of the same material; -1 for none.
  std::vector<std::int32_t> same_triangles(const SurfaceTriangles& last) const;
  /// Turns where in the world what is met is into where it was in the last look; false where it
  /// was not there.
  bool was_at(const Shown& last, const std::vector<std::int32_t>& same, const Hit& hit,
              Vec3& place) const;
};

}  // namespace tissue_sim
