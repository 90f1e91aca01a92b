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
#include "images/fluid_surface.h"
#include "images/look.h"
#include "images/shown.h"
#include "tissue_sim/point.h"

namespace tissue_sim {

namespace {

constexpr int kStrip = 8;  // rows that are drawn at a time
constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

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
  view.tools = simulation.tools();
  const auto any_shows = [&simulation](CameraColours colours) {
    const std::vector<Camera>& cameras = simulation.scene().cameras;
    return std::any_of(cameras.begin(), cameras.end(),
                       [colours](const Camera& c) { return c.colours == colours; });
  };
  std::vector<std::uint8_t> fluid;
  std::vector<FluidPoint> particles(simulation.tissue().read_fluid(fluid));
  if (!particles.empty()) std::memcpy(particles.data(), fluid.data(), fluid.size());
  const Scene& scene = simulation.scene();
  make_fluid_surface({particles.data(), particles.size()},
                     scene.fluid_spacing > 0 ? scene.fluid_spacing : scene.cell_size, view);
  view.fragments.clear();
  if (any_shows(CameraColours::kFragments)) {
    const Span<const Fragment> fragments = simulation.tissue().fragments();
    view.fragments.assign(fragments.begin(), fragments.end());
  }
  view.stress.clear();
  if (!any_shows(CameraColours::kStress)) return;
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
  const InstructionSet instructions = instruction_set();
  SmoothNormals smooth;
  std::vector<std::unique_ptr<ToolMesh>> meshes;  // of each tool, null for none
  std::shared_ptr<Shown> shown = std::make_shared<Shown>();
  std::vector<float> stress;  // of each corner, empty where no camera shows it
  std::map<int, Colour> piece_colours;

  State(const Scene& s, int threads) : scene(s), cpu(threads, Cpu::Yields()) {
    for (const Tool& tool : scene.tools) {
      meshes.push_back(tool.mesh.empty() ? nullptr : std::make_unique<ToolMesh>(tool, cpu));
    }
  }

  /// Of what is met, to be lit up; nothing where that is nothing. The light is full at a distance.
  void add(const Eye& eye, double full, const Vec3& along, const Hit& hit, std::int64_t index,
           Pixels* pixels) const;
};

void Renderer::State::add(const Eye& eye, double full, const Vec3& along, const Hit& hit,
                          std::int64_t index, Pixels* pixels) const {
  if (hit.label == kNoLabel) return;
  Look look = Look::kDrape;
  Vec3 place = eye.pose.position + hit.t * along;
  Colour colour = Colour::Zero();
  if (hit.part >= 0) {
    look = shown->parts[hit.part].shape.is_handle ? Look::kHandle : Look::kSteel;
  } else if (hit.fluid >= 0) {
    look = Look::kFluid;
    colour = linear(shown->fluid_colour[hit.fluid]);
  } else if (hit.triangle >= 0) {
    place = interpolated(&shown->surface.rest[9 * hit.triangle], hit);
    look = shown->surface.cut[hit.triangle] != 0 ? Look::kCutFace : Look::kSkin;
    if (eye.camera.colours != CameraColours::kTissue) look = Look::kTinted;
    if (eye.camera.colours == CameraColours::kStress && !stress.empty()) {
      const float* s = &stress.at(std::size_t{3} * hit.triangle);
      const double here = (1 - hit.u - hit.v) * s[0] + hit.u * s[1] + hit.v * s[2];
      colour = stress_colour(here / eye.camera.stress_end);
    } else if (eye.camera.colours == CameraColours::kFragments) {
      colour = piece_colours.at(shown->surface.fragment[hit.triangle]);
    }
  }
  Pixels& p = pixels[static_cast<int>(look)];
  const int i = p.count++;
  p.index[i] = index;
  for (int a = 0; a < 3; ++a) {
    p.place[a][i] = static_cast<float>(place[a]);
    p.normal[a][i] = static_cast<float>(hit.normal[a]);
    p.along[a][i] = static_cast<float>(along[a]);
    p.colour[a][i] = colour[a];
  }
  p.distance[i] = static_cast<float>(hit.t / full);
}

Renderer::Renderer(const Scene& scene, int threads) {
  const auto all = static_cast<int>(std::thread::hardware_concurrency());
  state_ = std::make_unique<State>(scene, threads > 0 ? threads : std::max(1, all - 1));
}

Renderer::~Renderer() = default;

void Renderer::show(const SceneView& view) {
  State& s = *state_;
  if (s.shown.use_count() > 1) s.shown = std::make_shared<Shown>();  // somebody keeps it
  s.shown->set(view, s.scene, s.meshes, s.smooth, s.cpu);
  s.stress.clear();
  if (!view.stress.empty()) s.stress = s.smooth.means(view.stress);
  s.piece_colours.clear();
  for (const Fragment& f : view.fragments) s.piece_colours[f.id] = linear(piece_colour(f));
  std::int32_t last = -1;
  for (const std::int32_t id : s.shown->surface.fragment) {
    if (id != last) s.piece_colours.emplace(id, linear(kTissueColour));
    last = id;
  }
}

void Renderer::render(const Camera& camera, const Pose& pose, CameraImages& images,
                      LastLook* last) {
  if (!pose.position.allFinite() || !pose.orientation.coeffs().allFinite()) {
    throw std::invalid_argument("camera " + camera.name + ": its pose is not finite");
  }
  const State& s = *state_;
  const int width = camera.width, height = camera.height;
  const std::size_t pixels = static_cast<std::size_t>(width) * height;
  images.width = width;
  images.height = height;
  images.rgb.assign(3 * pixels, 0);
  images.depth.resize(pixels);
  images.labels.resize(pixels);
  images.flow.assign(last == nullptr ? 0 : 2 * pixels, kNothing);
  const double focal = camera.focal_length();
  const double middle[2] = {0.5 * (width - 1), 0.5 * (height - 1)};
  const bool is_distorted = !camera.distortion.empty();
  const Eye eye = s.shown->look(camera, pose);
  const bool is_any = !s.shown->surface.corners.empty();
  const Vec3 centre = is_any ? Vec3(0.5 * (s.shown->box.min + s.shown->box.max)) : Vec3::Zero();
  const double full = std::max(1e-6, (centre - pose.position).norm());
  const Eigen::Matrix3d turn = pose.orientation.toRotationMatrix();
  const bool has_flow = last != nullptr && last->shown != nullptr;
  std::vector<std::int32_t> same;
  if (has_flow) same = s.shown->same_triangles(last->shown->surface);
  std::vector<int> inside_out(height / kStrip + 1, 0);

  const auto strip = [&](int number) {
    Pixels looks[kLooks] = {};
    const auto finish = [&](int look) {
      Pixels& p = looks[look];
      light_up(static_cast<Look>(look), camera.light, s.instructions, p);
      for (int i = 0; i < p.count; ++i) {
        const float colour[3] = {p.colour[0][i], p.colour[1][i], p.colour[2][i]};
        to_bytes(colour, &images.rgb[3 * p.index[i]]);
      }
      p.count = 0;
    };
    Vec3 flat[kPacket], along[kPacket];
    Hit hits[kPacket];
    const auto see = [&](int x, int y, bool undo) {
      Window window;
      std::swap(window.low, window.high);
      for (int i = 0; i < kPacket; ++i) {
        const double u = (std::min(x + i, width - 1) - middle[0]) / focal;
        const double v = (y - middle[1]) / focal;
        flat[i] = undo ? undistorted(camera, u, v) : Vec3(u, v, 1);
        along[i] = turn * flat[i];
        for (int a = 0; a < 2; ++a) {
          window.low[a] = std::min(window.low[a], flat[i][a]);
          window.high[a] = std::max(window.high[a], flat[i][a]);
        }
      }
      s.shown->meet(eye, s.scene.ground, window, along, hits);
    };
    for (int y = kStrip * number; y < std::min(kStrip * (number + 1), height); ++y) {
      for (int x = 0; x < width; x += kPacket) {
        const int count = std::min(kPacket, width - x);
        const std::size_t first = static_cast<std::size_t>(y) * width + x;
        see(x, y, false);
        for (int i = 0; i < count; ++i) {
          const Hit& hit = hits[i];
          images.depth[first + i] = hit.label == kNoLabel ? kNothing : static_cast<float>(hit.t);
          images.labels[first + i] = hit.label;
          if (hit.triangle >= 0 && hit.normal.dot(along[i]) > 0) ++inside_out[number];
          if (!has_flow || hit.label == kNoLabel) continue;
          Vec3 before = pose.position + hit.t * along[i];
          if (!s.shown->was_at(*last->shown, same, hit, before)) continue;
          before = in_axes_of(last->eye, before);
          if (!(before.z() > 0)) continue;
          for (int a = 0; a < 2; ++a) {
            images.flow[2 * (first + i) + a] =
                static_cast<float>(focal * (flat[i][a] - before[a] / before.z()));
          }
        }
        if (is_distorted) see(x, y, true);
        for (int i = 0; i < count; ++i) {
          s.add(eye, full, along[i], hits[i], static_cast<std::int64_t>(first) + i, looks);
        }
        for (int look = 0; look < kLooks; ++look) {
          if (looks[look].count > Pixels::kMost - kPacket) finish(look);
        }
      }
    }
    for (int look = 0; look < kLooks; ++look) finish(look);
  };
  state_->cpu.for_each((height + kStrip - 1) / kStrip, strip);
  double sum = 0;
  for (const int n : inside_out) sum += n;
  images.inside_out = sum / static_cast<double>(pixels);
  if (last != nullptr) *last = {s.shown, pose};
}

}  // namespace tissue_sim
