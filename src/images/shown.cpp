#include "images/shown.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <stdexcept>

#include "geometry/mesh.h"

namespace tissue_sim {
namespace {

/// In which an eye sees a box: all that is in front of it lies there.
Window window_of(const Pose& eye, const Pose& box, const Vec3& min, const Vec3& max) {
  Window w;
  std::swap(w.low, w.high);
  for (int i = 0; i < 8; ++i) {
    const Vec3 corner(i & 1 ? max.x() : min.x(), i & 2 ? max.y() : min.y(),
                      i & 4 ? max.z() : min.z());
    const Vec3 x = in_axes_of(eye, box * corner);
    if (!(x.z() > 1e-6)) return {};  // beside or behind it
    for (int a = 0; a < 2; ++a) {
      w.low[a] = std::min(w.low[a], x[a] / x.z() - 1e-6);
      w.high[a] = std::max(w.high[a], x[a] / x.z() + 1e-6);
    }
  }
  return w;
}

/// But for its corners.
bool is_same(const SurfaceTriangles& a, const SurfaceTriangles& b) {
  return a.made != 0 && a.made == b.made;
}

}  // namespace

Vec3 in_axes_of(const Pose& pose, const Vec3& place) {
  return pose.orientation.conjugate() * (place - pose.position);
}

ToolMesh::ToolMesh(const Tool& tool, Cpu& cpu) {
  TriangleMesh mesh;
  try {
    mesh = read_mesh(resolve_path(tool.mesh, "mesh"));
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("tool " + tool.name + ": " + e.what());
  }
  Box box;
  for (Vec3& x : mesh.vertices) {
    x *= tool.scale;
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  centre = 0.5 * (box.min + box.max);
  size = box.max - box.min;
  SurfaceTriangles triangles;
  for (const std::array<int, 3>& triangle : mesh.triangles) {
    for (const int corner : triangle) {
      const Vec3 x = mesh.vertices[corner] - centre;
      for (int a = 0; a < 3; ++a) triangles.corners.push_back(static_cast<float>(x[a]));
    }
  }
  triangles.rest = triangles.corners;
  triangles.fragment.resize(mesh.triangles.size());
  triangles.cut.resize(mesh.triangles.size());
  SmoothNormals().put(triangles, cpu, normals);
  rays.set(triangles.corners, cpu);
}

void Shown::set(const SceneView& view, const Scene& scene,
                const std::vector<std::unique_ptr<ToolMesh>>& meshes, SmoothNormals& smooth,
                Cpu& cpu) {
  if (is_same(view.surface, surface)) {
    const std::vector<float>& corners = view.surface.corners;
    cpu.for_each(
        static_cast<int>(surface.fragment.size()),
        [&](int t) {
          std::copy_n(&corners[std::size_t{9} * t], 9, &surface.corners[std::size_t{9} * t]);
        },
        4096);
  } else {
    surface = view.surface;
  }
  smooth.put(surface, cpu, normals);
  rays.set(surface.corners, cpu);
  box = surface.corners.empty() ? Box() : rays.box();
  fluid_normals = view.fluid_normals;
  fluid_kind = view.fluid_kind;
  fluid_colour = view.fluid_colour;
  if (view.fluid.empty()) {
    fluid_rays.reset();
    fluid_box = {};
  } else {
    if (fluid_rays == nullptr) fluid_rays = std::make_unique<RayScene>();
    fluid_rays->set(view.fluid, cpu);
    fluid_box = fluid_rays->box();
  }
  parts.clear();
  for (std::size_t i = 0; i < view.tools.size(); ++i) {
    if (!view.tools[i].present) continue;
    const auto label = static_cast<std::uint16_t>(kFirstToolLabel + i);
    const Tool& tool = scene.tools[i];
    const ToolMesh* mesh = meshes[i].get();
    for (const ToolShape& shape : tool_shapes(tool, view.tools[i])) {
      const bool moves_by_itself = has_jaws(tool.type) && !shape.is_handle;
      if (mesh == nullptr || moves_by_itself) parts.push_back({shape, label, nullptr});
    }
    if (mesh == nullptr) continue;
    const Pose& end = view.tools[i].end;
    parts.push_back(
        {{ToolShape::kBox, {end * mesh->centre, end.orientation}, mesh->size, false}, label, mesh});
  }
}

Eye Shown::look(const Camera& camera, const Pose& pose) const {
  Eye eye{camera, pose, {}, {}, {}};
  if (!surface.corners.empty()) eye.tissue = window_of(pose, Pose(), box.min, box.max);
  if (fluid_rays != nullptr) eye.fluid = window_of(pose, Pose(), fluid_box.min, fluid_box.max);
  for (const Part& part : parts) {
    const Vec3 half = 0.5 * part.shape.size;
    eye.parts.push_back(window_of(pose, part.shape.pose, -half, half));
  }
  return eye;
}

void Shown::meet(const Eye& eye, const Ground& ground, const Window& window, const Vec3* along,
                 Hit* hits) const {
  const Vec3& from = eye.pose.position;
  const double near = eye.camera.near;
  RayScene::Met met[kPacket];
  if (eye.tissue.meets(window)) rays.meet(from, along, near, eye.camera.far, met);
  for (int i = 0; i < kPacket; ++i) {
    Hit& hit = hits[i];
    hit = {};
    if (met[i].triangle >= 0) {
      hit.triangle = met[i].triangle;
      hit.t = met[i].t;
      hit.u = met[i].u, hit.v = met[i].v;
      const int label = kFirstFragmentLabel + surface.fragment[hit.triangle];
      hit.label = static_cast<std::uint16_t>(std::min(label, 65535));
      hit.normal = interpolated(&normals[9 * hit.triangle], hit);
    }
  }
  if (fluid_rays != nullptr && eye.fluid.meets(window)) {
    fluid_rays->meet(from, along, near, eye.camera.far, met);
    for (int i = 0; i < kPacket; ++i) {
      if (met[i].triangle < 0 || (hits[i].triangle >= 0 && !(met[i].t < hits[i].t))) continue;
      Hit& hit = hits[i] = {};
      hit.fluid = met[i].triangle;
      hit.t = met[i].t;
      hit.u = met[i].u, hit.v = met[i].v;
      hit.label = static_cast<std::uint16_t>(kFirstFluidLabel + fluid_kind[hit.fluid]);
      hit.normal = interpolated(&fluid_normals[std::size_t{9} * hit.fluid], hit);
    }
  }
  for (int i = 0; i < kPacket; ++i) {
    Hit& hit = hits[i];
    const double nearest = hit.label == kNoLabel ? eye.camera.far : hit.t;
    if (!ground.enabled || along[i].z() == 0) continue;
    const double t = (ground.z - from.z()) / along[i].z();
    if (!(t >= near && t < nearest)) continue;
    hit = {};
    hit.t = t;
    hit.label = kGroundLabel;
    hit.normal = Vec3::UnitZ();
  }
  for (std::size_t k = 0; k < eye.parts.size(); ++k) {
    if (!eye.parts[k].meets(window)) continue;
    const Part& part = parts[k];
    const Pose& pose = part.shape.pose;
    if (part.mesh != nullptr) {
      Vec3 within[kPacket];
      for (int i = 0; i < kPacket; ++i) within[i] = pose.orientation.conjugate() * along[i];
      part.mesh->rays.meet(in_axes_of(pose, from), within, near, eye.camera.far, met);
    }
    for (int i = 0; i < kPacket; ++i) {
      const double nearest = hits[i].label == kNoLabel ? eye.camera.far : hits[i].t;
      Hit hit;
      if (part.mesh == nullptr) {
        if (!tissue_sim::meet(part.shape, from, along[i], near, nearest, hit.t, hit.normal)) {
          continue;
        }
      } else {
        if (met[i].triangle < 0 || !(met[i].t < nearest)) continue;
        hit.t = met[i].t;
        hit.u = met[i].u, hit.v = met[i].v;
        hit.normal = pose.orientation * interpolated(&part.mesh->normals[9 * met[i].triangle], hit);
      }
      hit.label = part.label;
      hit.part = static_cast<std::int32_t>(k);
      hits[i] = hit;
    }
  }
}

std::vector<std::int32_t> Shown::same_triangles(const SurfaceTriangles& last) const {
  const std::vector<float>& rest = surface.rest;
  std::vector<std::int32_t> same(surface.fragment.size(), -1);
  if (is_same(surface, last)) {
    std::iota(same.begin(), same.end(), 0);
    return same;
  }
  using Corners = std::array<float, 9>;
  const auto corners = [](const std::vector<float>& x, std::size_t t) {
    Corners c;
    std::copy_n(&x[9 * t], 9, c.begin());
    return c;
  };
  std::map<Corners, std::int32_t> of_last;
  for (std::size_t t = 0; t < last.fragment.size(); ++t) {
    of_last.emplace(corners(last.rest, t), static_cast<std::int32_t>(t));
  }
  for (std::size_t t = 0; t < same.size(); ++t) {
    const auto found = of_last.find(corners(rest, t));
    if (found != of_last.end()) same[t] = found->second;
  }
  return same;
}

bool Shown::was_at(const Shown& last, const std::vector<std::int32_t>& same, const Hit& hit,
                   Vec3& place) const {
  if (hit.triangle >= 0) {
    const std::int32_t before = same[hit.triangle];
    if (before >= 0) place = interpolated(&last.surface.corners[9 * before], hit);
    return before >= 0;
  }
  if (hit.fluid >= 0) return false;  // it flows
  if (hit.part < 0) return true;     // the ground lies still
  const std::uint16_t label = parts[hit.part].label;
  const auto first = [label](const Shown& s) {
    return std::find_if(s.parts.begin(), s.parts.end(),
                        [label](const Part& p) { return p.label == label; });
  };
  const auto before = first(last);
  if (before == last.parts.end()) return false;
  const std::ptrdiff_t number = hit.part - (first(*this) - parts.begin());
  place = before[number].shape.pose * in_axes_of(parts[hit.part].shape.pose, place);
  return true;
}

}  // namespace tissue_sim
