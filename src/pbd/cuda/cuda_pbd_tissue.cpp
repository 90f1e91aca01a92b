#include "pbd/cuda/cuda_pbd_tissue.h"

#include "pbd/cuda/on_device.h"
#include "pbd/find_touches.h"
#include "pbd/model.h"

namespace tissue_sim {
namespace {

/// Four floats a vertex.
void upload(const Array<float>& from, std::size_t count, DeviceArray<float4>& to,
            cudaStream_t stream) {
  to.upload(reinterpret_cast<const float4*>(from.data()), count, stream);
}

pbd::CudaPbdColours colours(const pbd::State& s) {
  return {s.elastics.begin, s.strains.begin, s.links.begin, s.bends.begin};
}

}  // namespace

CudaPbdTissue::CudaPbdTissue(const Scene& scene, std::vector<std::string> notes)
    : PbdTissue(scene, std::move(notes)), device_(std::make_unique<OnDevice>()) {
  OnDevice& d = *device_;
  d.gpu = open_gpu(d.stream);
  const int steps = pbd::steps_of(*state_, 1 / scene.frame_rate);
  const auto colliders = static_cast<std::size_t>(steps) * collider_count(scene);
  d.frame.resize(1);
  d.colliders.resize(colliders);
  d.loads.resize(colliders * pbd::kPbdLoadSums);
  d.host_loads.resize(d.loads.size());
  d.step.resize(1);
  d.measures.resize(pbd::kPbdMeasures);
  d.host_measures.resize(pbd::kPbdMeasures);
  state_->levels.clear();  // colours are of all vertices here
  pbd::pack(*state_);
  push_all();
}

CudaPbdTissue::~CudaPbdTissue() {
  if (device_->stream != nullptr) cudaStreamSynchronize(device_->stream);
}

void CudaPbdTissue::push() {
  OnDevice& d = *device_;
  const pbd::Vertices& v = state_->vertices;
  upload(v.x, v.x.size() / 4, d.x, d.stream);
  upload(v.moved, v.moved.size() / 4, d.moved, d.stream);
  upload(v.v, v.v.size() / 4, d.v, d.stream);
  d.wait("receive data");
  d.host_is_current = true;
}

void CudaPbdTissue::push_all() {
  OnDevice& d = *device_;
  const pbd::Vertices& v = state_->vertices;
  d.count = v.size();
  d.mass.upload(v.mass, d.stream);
  int tips = 0;  // at most
  for (const Tool& t : state_->scene.tools) {
    const bool is_none = t.type == ToolType::kScalpel || t.type == ToolType::kGrasper;
    if (!is_none) tips += collider_count(t.type);
  }
  const std::size_t triangles = tips > 0 ? state_->triangles.size() : 0;
  d.triangles.upload(state_->triangles.data(), triangles, d.stream);
  d.tip_sweeps.resize(tips);
  d.near.resize(tips * triangles);
  d.near_count.resize(1);
  d.mean_edge = state_->mean_edge;
  d.pushed.resize(d.count);
  d.pushed.clear(d.stream);
  d.predicted.resize(d.count);
  upload_constraints();
  choose_way();
  upload_chunks();
  push();
}

void CudaPbdTissue::upload_constraints() {
  OnDevice& d = *device_;
  d.sweeps = pbd::sweeps_of_step(*state_);
  d.elastics.upload(state_->elastics, d.stream);
  d.strains.upload(state_->strains, d.stream);
  d.links.upload(state_->links, d.stream);
  d.bends.upload(state_->bends, d.stream);
  d.wait("receive data");
  d.step_graph.clear();
  d.projections.clear();
  d.damping.clear();
}

void CudaPbdTissue::pull() {
  OnDevice& d = *device_;
  if (d.host_is_current) return;
  pbd::Vertices& v = state_->vertices;
  d.x.download(reinterpret_cast<float4*>(v.x.data()), d.count, d.stream);
  d.moved.download(reinterpret_cast<float4*>(v.moved.data()), d.count, d.stream);
  d.v.download(reinterpret_cast<float4*>(v.v.data()), d.count, d.stream);
  d.wait("send data");
  d.host_is_current = true;
}

void CudaPbdTissue::upload_frame(const FrameColliders& colliders, const Part& part,
                                 const pbd::CudaPbdFrame& frame) {
  OnDevice& d = *device_;
  const std::size_t count = colliders.count();
  d.host_colliders.resize(part.count * count);
  d.boxed.resize(part.count * count);
  for (int i = 0; i < part.count; ++i) {
    colliders.at(part.share(i), d.host_colliders.data() + i * count);
  }
  pbd::CudaPbdCollider* boxed = d.boxed.data();
  for (std::size_t k = 0; k < d.boxed.size(); ++k) {
    const Box box = bounds(d.host_colliders[k]);
    boxed[k].shape = d.host_colliders[k];
    for (int a = 0; a < 3; ++a) {
      boxed[k].min[a] = static_cast<float>(box.min[a]);
      boxed[k].max[a] = static_cast<float>(box.max[a]);
    }
  }
  d.colliders.resize(d.boxed.size());
  d.loads.resize(d.boxed.size() * pbd::kPbdLoadSums);
  d.host_loads.resize(d.loads.size());
  if (d.way != Way::kLaunches) return;  // they fetch them themselves
  d.frame.upload(&frame, 1, d.stream);
  d.step.clear(d.stream);
  d.colliders.upload(boxed, d.boxed.size(), d.stream);
  d.loads.clear(d.stream);
  d.pushed.clear(d.stream);
}

int CudaPbdTissue::upload_touches(double duration) {
  OnDevice& d = *device_;
  pbd::State& s = *state_;
  const bool may_touch = s.components > 1;
  if (may_touch) pull();
  pbd::find_touches(s, duration);
  const auto* blocks = d.touches.blocks.data();
  const auto* begin = d.touches.begin.data();
  if (s.touches.size() > 0) d.touches.upload(s.touches, d.stream);
  if (may_touch != d.may_touch || blocks != d.touches.blocks.data() ||
      begin != d.touches.begin.data()) {
    d.step_graph.clear();
  }
  d.may_touch = may_touch;
  return s.touches.size() > 0 ? d.touches.colours : 0;
}

int CudaPbdTissue::find_near_tips(const std::vector<pbd::TipSweep>& sweeps, double duration) {
  OnDevice& d = *device_;
  const auto count = static_cast<int>(sweeps.size());
  if (d.triangles.size() == 0 || count == 0) return 0;
  d.tip_sweeps.upload(sweeps, d.stream);
  std::size_t bytes = 0;
  int* const found = d.near_count.data();
  launch_pbd_near_tips(d.field(), count, duration, found, nullptr, bytes, d.stream);
  d.tip_memory.resize(bytes);
  launch_pbd_near_tips(d.field(), count, duration, found, d.tip_memory.data(), bytes, d.stream);
  d.wait("find what comes near tips");
  return *found;
}

void CudaPbdTissue::run_steps(const FrameColliders& colliders, const Part& part, float h) {
  const int steps = part.count;
  OnDevice& d = *device_;
  pbd::CudaPbdFrame frame{pbd::step_numbers(state_->scene, h), colliders.count()};
  frame.touch_colours = upload_touches(steps * h);
  frame.near_tips = find_near_tips(sweeps_of_tips(colliders, part), steps * h);
  upload_frame(colliders, part, frame);
  const pbd::CudaPbdField field = d.field();
  const int chunks = static_cast<int>(d.component_of_chunk.size());
  const pbd::CudaPbdFlights flights{d.chunks.data(), chunks, d.order.data()};
  if (d.way != Way::kLaunches) {
    const pbd::CudaPbdExchange exchange = {d.boxed.data(), d.host_loads.data(),
                                           d.host_flights.data(), flights};
    launch_pbd_steps(field, frame, steps, exchange, d.stream);
  } else {
    launch_pbd_flights(field, flights, d.flights.data(), d.stream);
    if (d.step_graph.is_empty()) {
      d.step_graph.record(d.stream, [&] { launch_pbd_step(field, colours(*state_), d.stream); });
    }
    for (int i = 0; i < steps; ++i) d.step_graph.launch(d.stream);
    launch_pbd_flights(field, flights, d.flights.data() + chunks, d.stream);
    d.loads.download(d.host_loads.data(), d.loads.size(), d.stream);
    d.flights.download(d.host_flights.data(), d.flights.size(), d.stream);
  }
  d.host_is_current = false;
  d.wait("advance");
  take_loads(colliders, part);
  keep_momentum(steps, h);
}

void CudaPbdTissue::take_loads(const FrameColliders& colliders, const Part& part) {
  OnDevice& d = *device_;
  std::vector<ColliderLoad> on(colliders.count());
  const unsigned long long* sum = d.host_loads.data();
  for (int i = 0; i < part.count; ++i) {
    for (ColliderLoad& load : on) {
      for (int a = 0; a < 3; ++a) {
        load.force[a] = pbd::kPbdLoadUnit * static_cast<double>(static_cast<long long>(sum[a]));
        load.torque[a] =
            pbd::kPbdLoadUnit * static_cast<double>(static_cast<long long>(sum[3 + a]));
      }
      load.points = static_cast<double>(sum[6]);
      load.inside = static_cast<double>(sum[7]);
      load.deepest = kInsideUnit * static_cast<double>(sum[8]);
      sum += pbd::kPbdLoadSums;
    }
    colliders.add_loads(part.share(i), d.host_colliders.data() + i * on.size(), on.data(),
                        1.0 / part.of, result_.loads);
  }
}

PbdTissue::Figures CudaPbdTissue::measure() {
  OnDevice& d = *device_;
  launch_pbd_measure(d.field(), d.measures.data(), d.stream);
  d.measures.download(d.host_measures.data(), d.measures.size(), d.stream);
  d.wait("measure");
  Figures sum;
  for (std::size_t k = 0; k < d.host_measures.size(); ++k) {
    const pbd::CudaPbdMeasure& m = d.host_measures[k];
    sum.elastic += m.elastic;
    sum.kinetic += m.kinetic;
    if (!(m.speed2 <= sum.speed2)) sum.speed2 = m.speed2;
    sum.finite = sum.finite && m.finite != 0;
  }
  return sum;
}

void CudaPbdTissue::project(float h, int times) {
  OnDevice& d = *device_;
  const pbd::CudaPbdFrame frame{pbd::step_numbers(state_->scene, h), 0, 0};
  d.frame.upload(&frame, 1, d.stream);
  if (d.projections.is_empty()) {
    d.projections.record(d.stream, [&] {
      launch_pbd_projections(d.field(), colours(*state_), false, false, d.stream);
    });
  }
  for (int i = 0; i < times; ++i) d.projections.launch(d.stream);
  d.host_is_current = false;
}

void CudaPbdTissue::wait() { device_->wait("advance"); }

std::string CudaPbdTissue::device_name() const { return "cuda (" + device_->gpu + ")"; }

GpuPoints CudaPbdTissue::read_points_on_gpu(const PointSelection& selection) {
  std::vector<std::uint8_t> cloud;  // which the host makes
  const int count = read_points(selection, cloud);
  return device_->lent.lend(cloud, count, device_->stream);
}

}  // namespace tissue_sim
