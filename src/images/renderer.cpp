#include "tissue_sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>

#include "compute/for_each.h"
#include "fragments/piece_colour.h"
#include "images/look.h"
#include "images/ray_scene.h"
#include "images/smooth_normals.h"
#include "tissue_sim/point.h"
#include "tools/tool_shapes.h"

namespace tissue_sim {
namespace {

constexpr int kPacket = RayScene::kPacket;
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

/// What a ray meets first.
struct Hit {
  double t = 0;
  Vec3 normal = Vec3::Zero();
  std::uint16_t label = kNoLabel;
  std::int32_t triangle = -1;  ///< of tissue; else the ground or a tool
  float u = 0, v = 0;          ///< in it
  bool is_handle = false;
};

/// Where a pixel of the raw image looks, at a depth of 1: the lens' distortion undone.
Vec3 undistorted(const Camera& camera, double x, double y) {
  if (camera.distortion.empty()) return {x, y, 1};
  const std::vector<double>& d = camera.distortion;
  double a = x, b = y;
  for (int i = 0; i < 20; ++i) {
    const double r2 = a * a + b * b;
    const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
    const double dx = 2 * d[2] * a * b + d[3] * (r2 + 2 * a * a);
    const double dy = d[2] * (r2 + 2 * b * b) + 2 * d[3] * a * b;
    a = (x - dx) / radial, b = (y - dy) / radial;
  }
  return {a, b, 1};
}

}  // namespace

double Camera::focal_length() const { return 0.5 * width / std::tan(0.5 * hfov * M_PI / 180); }

bool can_render() { return RayScene::is_built(); }

void read_view(Simulation& simulation, SceneView& view) {
  simulation.tissue().read_surface(view.surface);
  const Span<const Fragment> fragments = simulation.tissue().fragments();
  view.fragments.assign(fragments.begin(), fragments.end());
  view.tools = simulation.tools();
  view.stress.clear();
  const std::vector<Camera>& cameras = simulation.scene().cameras;
  if (std::none_of(cameras.begin(), cameras.end(),
                   [](const Camera& c) { return c.colours == CameraColours::kStress; })) {
    return;
  }
  std::vector<std::uint8_t> cloud;
  const int count = simulation.tissue().read_points(PointSelection(), cloud);
  std::vector<float> of_point(simulation.tissue().point_count());
  for (int i = 0; i < count; ++i) {
    Point p;
    std::memcpy(&p, cloud.data() + sizeof(Point) * i, sizeof(Point));
    of_point[p.id] = p.stress;
  }
  for (const std::int32_t point : view.surface.point) view.stress.push_back(of_point[point]);
}

struct Renderer::State {
  Scene scene;
  Cpu cpu;
  RayScene rays;
  SmoothNormals smooth;
  SurfaceTriangles surface;
  const std::vector<float>* normals = nullptr;
  std::vector<float> stress;  // of each corner
  std::map<int, Colour> piece_colours;
  struct SeenShape {
    ToolShape shape;
    std::uint16_t label;
  };
  std::vector<SeenShape> shapes;
  Vec3 centre = Vec3::Zero();  ///< of the tissue: the light is full at that distance

  State(const Scene& s, int threads) : scene(s), cpu(threads) {}

  /// What a packet of rays meets, one for each direction.
  void meet(const Vec3& eye, const Vec3* along, double near, double far, Hit* hits) const;
  Colour colour_of(const Camera& camera, const Vec3& eye, const Vec3& along, const Hit& hit) const;
};

void Renderer::State::meet(const Vec3& eye, const Vec3* along, double near, double far,
                           Hit* hits) const {
  RayScene::Met met[kPacket];
  rays.meet(eye, along, near, far, met);
  for (int i = 0; i < kPacket; ++i) {
    Hit& hit = hits[i];
    hit = {};
    double nearest = far;
    if (met[i].triangle >= 0) {
      hit.triangle = met[i].triangle;
      hit.t = nearest = met[i].t;
      hit.u = met[i].u, hit.v = met[i].v;
      const int label = kFirstFragmentLabel + surface.fragment[hit.triangle];
      hit.label = static_cast<std::uint16_t>(std::min(label, 65535));
      const float* n = &(*normals)[9 * hit.triangle];
      for (int a = 0; a < 3; ++a) {
        hit.normal[a] = (1 - hit.u - hit.v) * n[a] + hit.u * n[3 + a] + hit.v * n[6 + a];
      }
    }
    if (scene.ground.enabled && along[i].z() != 0) {
      const double t = (scene.ground.z - eye.z()) / along[i].z();
      if (t >= near && t < nearest) {
        hit = {};
        hit.t = nearest = t;
        hit.label = kGroundLabel;
        hit.normal = Vec3::UnitZ();
      }
    }
    for (const SeenShape& seen : shapes) {
      double t;
      Vec3 normal;
      if (!tissue_sim::meet(seen.shape, eye, along[i], near, nearest, t, normal)) continue;
      hit = {};
      hit.t = nearest = t;
      hit.normal = normal;
      hit.label = seen.label;
      hit.is_handle = seen.shape.is_handle;
    }
  }
}

Colour Renderer::State::colour_of(const Camera& camera, const Vec3& eye, const Vec3& along,
                                  const Hit& hit) const {
  if (hit.label == kNoLabel) return Colour::Zero();
  const Vec3 place = eye + hit.t * along;
  const Vec3 to_lens = -along.normalized();
  Surface surface{Colour(0.19f, 0.20f, 0.215f), 0.45f, 40};  // steel
  Vec3 normal = hit.normal;
  if (hit.label == kGroundLabel) {
    surface = {drape_colour(place), 0, 1};
  } else if (hit.triangle >= 0) {
    Vec3 rest = Vec3::Zero();
    const float* x = &this->surface.rest[9 * hit.triangle];
    for (int a = 0; a < 3; ++a) {
      rest[a] = (1 - hit.u - hit.v) * x[a] + hit.u * x[3 + a] + hit.v * x[6 + a];
    }
    if (camera.colours == CameraColours::kStress) {
      const float* s = &stress.at(std::size_t{3} * hit.triangle);
      const double here = (1 - hit.u - hit.v) * s[0] + hit.u * s[1] + hit.v * s[2];
      surface = {stress_colour(here / camera.stress_end), 0.1f, 30};
    } else if (camera.colours == CameraColours::kFragments) {
      surface = {piece_colours.at(this->surface.fragment[hit.triangle]), 0.1f, 30};
    } else {
      surface = {tissue_colour(rest, this->surface.cut[hit.triangle] != 0), 0.40f, 110};
      normal += tissue_bumps(rest);
    }
  } else if (hit.is_handle) {
    surface = {Colour(0.035f, 0.038f, 0.045f), 0.25f, 25};
  }
  normal.normalize();
  if (normal.dot(to_lens) < 0) normal = -normal;  // seen from its inside
  const double full = std::max(1e-6, (centre - eye).norm());
  return lit(surface, normal, to_lens, (place - eye).norm() / full, camera.light);
}

Renderer::Renderer(const Scene& scene, int threads)
    : state_(std::make_unique<State>(
          scene, threads > 0
                     ? threads
                     : std::max(1, static_cast<int>(std::thread::hardware_concurrency()) / 2))) {}

Renderer::~Renderer() = default;

void Renderer::show(const SceneView& view) {
  State& s = *state_;
  s.surface = view.surface;
  s.normals = &s.smooth.of(s.surface);
  s.stress = s.smooth.means(view.stress.empty() ? std::vector<float>(s.surface.fragment.size())
                                                : view.stress);
  s.rays.set(s.surface.corners);
  s.piece_colours.clear();
  for (const Fragment& f : view.fragments) s.piece_colours[f.id] = linear(piece_colour(f));
  for (const std::int32_t id : s.surface.fragment)
    s.piece_colours.emplace(id, linear(kTissueColour));
  Box box;
  for (std::size_t i = 0; i < s.surface.corners.size(); i += 3) {
    const Vec3 x(s.surface.corners[i], s.surface.corners[i + 1], s.surface.corners[i + 2]);
    box.min = box.min.cwiseMin(x);
    box.max = box.max.cwiseMax(x);
  }
  s.centre = s.surface.corners.empty() ? Vec3::Zero() : Vec3(0.5 * (box.min + box.max));
  s.shapes.clear();
  for (std::size_t i = 0; i < view.tools.size(); ++i) {
    if (!view.tools[i].present) continue;
    const auto label = static_cast<std::uint16_t>(kFirstToolLabel + i);
    for (const ToolShape& shape : tool_shapes(s.scene.tools[i], view.tools[i])) {
      s.shapes.push_back({shape, label});
    }
  }
}

void Renderer::render(const Camera& camera, const Pose& eye, CameraImages& images) {
  if (!eye.position.allFinite() || !eye.orientation.coeffs().allFinite()) {
    throw std::invalid_argument("camera " + camera.name + ": its pose is not finite");
  }
  const State& s = *state_;
  const int width = camera.width, height = camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  images.width = width;
  images.height = height;
  images.rgb.resize(3 * pixels);
  images.depth.resize(pixels);
  images.labels.resize(pixels);
  const double focal = camera.focal_length();
  const bool is_distorted = !camera.distortion.empty();
  std::vector<int> inside_out(height, 0);
  const auto row = [&](int y) {
    Vec3 flat[kPacket], along[kPacket];
    Hit hits[kPacket];
    for (int begin = 0; begin < width; begin += kPacket) {
      const int count = std::min(kPacket, width - begin);
      const auto look = [&](bool undo) {
        for (int i = 0; i < kPacket; ++i) {
          const double u = (begin + std::min(i, count - 1) - 0.5 * (width - 1)) / focal;
          const double v = (y - 0.5 * (height - 1)) / focal;
          flat[i] = undo ? undistorted(camera, u, v) : Vec3(u, v, 1);
          along[i] = eye.orientation * flat[i];
        }
        s.meet(eye.position, along, camera.near, camera.far, hits);
      };
      look(false);
      const std::size_t first = static_cast<std::size_t>(y) * width + begin;
      for (int i = 0; i < count; ++i) {
        const Hit& hit = hits[i];
        images.depth[first + i] = hit.label == kNoLabel ? kNothing : static_cast<float>(hit.t);
        images.labels[first + i] = hit.label;
        if (hit.triangle >= 0 && hit.normal.dot(along[i]) > 0) ++inside_out[y];
      }
      if (is_distorted) look(true);
      for (int i = 0; i < count; ++i) {
        to_bytes(s.colour_of(camera, eye.position, along[i], hits[i]),
                 &images.rgb[3 * (first + i)]);
      }
    }
  };
  state_->cpu.for_each(height, row, 4);
  double sum = 0;
  for (const int n : inside_out) sum += n;
  images.inside_out = sum / static_cast<double>(pixels);
}

}  // namespace tissue_sim
