#include "images/ray_scene.h"

#include <algorithm>
#include <new>
#include <numeric>
#include <stdexcept>

#ifdef TISSUE_SIM_EMBREE
#if TISSUE_SIM_EMBREE == 4
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif
#endif

namespace tissue_sim {

#ifdef TISSUE_SIM_EMBREE

struct RayScene::State {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  RTCGeometry mesh = nullptr;  // of the scene; null without triangles
  float* places = nullptr;     // of its vertices
  std::size_t triangles = 0;

  ~State() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
};

bool RayScene::is_built() { return true; }

RayScene::RayScene() : state_(std::make_unique<State>()) {
  // One instruction set: the same bits on all machines. Its `threads` would hold for all of TBB.
  state_->device = rtcNewDevice("isa=sse4.2,start_threads=0");
  if (state_->device == nullptr) {
    throw std::runtime_error("images: Embree does not start (error " +
                             std::to_string(rtcGetDeviceError(nullptr)) +
                             "; it needs a processor with SSE 4.2), leave `cameras` out");
  }
}

RayScene::~RayScene() = default;

void RayScene::set(const std::vector<float>& corners, Cpu& cpu) {
  State& s = *state_;
  const std::size_t triangles = corners.size() / 9;
  if (s.scene == nullptr || triangles != s.triangles) {
    if (s.scene != nullptr) rtcReleaseScene(s.scene);
    s.scene = rtcNewScene(s.device);
    rtcSetSceneFlags(s.scene, RTC_SCENE_FLAG_ROBUST);  // no gaps along edges
    rtcSetSceneBuildQuality(s.scene, RTC_BUILD_QUALITY_LOW);
    s.triangles = triangles;
    s.mesh = nullptr;
    s.places = nullptr;
    if (triangles > 0) {
      s.mesh = rtcNewGeometry(s.device, RTC_GEOMETRY_TYPE_TRIANGLE);
      s.places = static_cast<float*>(rtcSetNewGeometryBuffer(
          s.mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), 3 * triangles));
      auto* index = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
          s.mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangles));
      if (s.places == nullptr || index == nullptr) throw std::bad_alloc();
      std::iota(index, index + 3 * triangles, 0u);
      // Of both: a fifth of the time, as fast.
      rtcSetGeometryBuildQuality(s.mesh, RTC_BUILD_QUALITY_LOW);
      rtcAttachGeometry(s.scene, s.mesh);
      rtcReleaseGeometry(s.mesh);  // the scene has it
    }
  }
  if (s.mesh != nullptr) {
    const auto copy = [&](int t) {
      std::copy_n(&corners[std::size_t{9} * t], 9, s.places + std::size_t{9} * t);
    };
    cpu.for_each(static_cast<int>(triangles), copy, 4096);
    rtcUpdateGeometryBuffer(s.mesh, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(s.mesh);
  }
  // Trees of this quality, by the order of triangles along a curve, are the same with any threads.
  cpu.execute([&s] { rtcCommitScene(s.scene); });
}

Box RayScene::box() const {
  RTCBounds b;
  rtcGetSceneBounds(state_->scene, &b);
  return {Vec3(b.lower_x, b.lower_y, b.lower_z), Vec3(b.upper_x, b.upper_y, b.upper_z)};
}

void RayScene::meet(const Vec3& from, const Vec3* along, double near, double far, Met* met) const {
  for (int i = 0; i < kPacket; ++i) met[i] = {};
  if (state_->triangles == 0) return;
  alignas(16) const int valid[kPacket] = {-1, -1, -1, -1};
  RTCRayHit4 r;
  for (int i = 0; i < kPacket; ++i) {
    r.ray.org_x[i] = static_cast<float>(from.x());
    r.ray.org_y[i] = static_cast<float>(from.y());
    r.ray.org_z[i] = static_cast<float>(from.z());
    r.ray.dir_x[i] = static_cast<float>(along[i].x());
    r.ray.dir_y[i] = static_cast<float>(along[i].y());
    r.ray.dir_z[i] = static_cast<float>(along[i].z());
    r.ray.tnear[i] = static_cast<float>(near);
    r.ray.tfar[i] = static_cast<float>(far);
    r.ray.time[i] = 0;
    r.ray.mask[i] = 0xffffffffu;
    r.ray.id[i] = 0;
    r.ray.flags[i] = 0;
    r.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    r.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
  }
#if TISSUE_SIM_EMBREE == 4
  RTCIntersectArguments arguments;
  rtcInitIntersectArguments(&arguments);
  arguments.flags = RTC_RAY_QUERY_FLAG_COHERENT;
  rtcIntersect4(valid, state_->scene, &r, &arguments);
#else
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  rtcIntersect4(valid, state_->scene, &context, &r);
#endif
  for (int i = 0; i < kPacket; ++i) {
    if (r.hit.geomID[i] == RTC_INVALID_GEOMETRY_ID) continue;
    met[i] = {static_cast<std::int32_t>(r.hit.primID[i]), r.ray.tfar[i], r.hit.u[i], r.hit.v[i]};
  }
}

#else

struct RayScene::State {};
bool RayScene::is_built() { return false; }
RayScene::RayScene() {
  throw std::runtime_error(
      "images: this build has no Embree, which casts cameras' rays: install libembree-dev and "
      "build "
      "again, or leave `cameras` out");
}
RayScene::~RayScene() = default;
void RayScene::set(const std::vector<float>&, Cpu&) {}
Box RayScene::box() const { return {}; }
void RayScene::meet(const Vec3&, const Vec3*, double, double, Met*) const {}

#endif

}  // namespace tissue_sim
