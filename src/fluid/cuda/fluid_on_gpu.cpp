#include <algorithm>
#include <cmath>
#include <cstring>

#include "fluid/cuda/fluid_kernels.h"
#include "fluid/fluid_device.h"

namespace tissue_sim {
namespace {

float root_of(unsigned bits) {
  float x;
  std::memcpy(&x, &bits, sizeof x);
  return std::sqrt(x);
}

/// What was found of particles and walls that may act on one another.
struct ListsOnGpu {
  DeviceArray<std::uint32_t> key, sorted_key;
  DeviceArray<std::int32_t> number, in_cells, sorted_pair, counts, cell_begin, begin, other;
  DeviceArray<float4> place;
  DeviceArray<std::int32_t> pair_begin, pair_triangle, pair_particle, pair_entry;
  DeviceArray<std::int32_t> wall_begin, wall_soon, wall_near, wall, wall_of;
  DeviceArray<float> x[3], corners, box;
  DeviceArray<std::uint8_t> is_bit;
  DeviceArray<unsigned char> memory;
  int pairs = 0;
  bool made = false;
};

class ParticlesOnGpu final : public FluidDevice {
 public:
  ParticlesOnGpu() { open_gpu(stream_); }
  ~ParticlesOnGpu() override { cudaStreamDestroy(stream_); }

  void send(const FluidState& s) override;
  void send_volumes(const FluidState& s) override { volume_.upload(s.particles.volume, stream_); }
  void bring(FluidState& s) override;
  void set_walls(const float* corners, int triangles, bool are_new) override;
  int advance(const FluidState& s, const FluidDrive& drive,
              std::vector<ColliderLoad>& loads) override;
  const float* impulses() const override { return impulse_.data(); }
  void bring_impulses(FluidWalls& walls) override;
  void push_out_of_walls(const FluidState& s) override;

 private:
  void wait() const { check_cuda(cudaStreamSynchronize(stream_), "move fluid"); }
  FluidOnGpu view();
  /// Lists anew, by the corners that are on the GPU.
  void list(const FluidState& s, const DeviceArray<float>& corners, float skin);
  void list_walls(const FluidState& s, const FluidGrid& grid, float reach);
  FluidGrid make_grid(float reach);
  void sort(int count, int bits, DeviceArray<std::int32_t>& sorted);
  /// The sum of all.
  int scan(int count, DeviceArray<std::int32_t>& before);
  float walls_moved(const DeviceArray<float>& corners, int end);

  cudaStream_t stream_ = nullptr;
  int particles_ = 0, triangles_ = 0;
  FluidKernel kernel_{0};
  float spacing_ = 0, fastest_ = 0, moved_ = 0, walls_moved_[2] = {};
  DeviceArray<FluidLaw> laws_;
  DeviceArray<float> viscosity_, x_[3], v_[3], v_next_[3], volume_, pressure_, dense_;
  DeviceArray<std::uint8_t> kind_;
  DeviceArray<float> begin_corners_, end_corners_, impulse_;
  DeviceArray<WallTriangle> before_, now_;
  ListsOnGpu lists_;
  DeviceArray<float4> place_, motion_, wall_push_, seen_;
  DeviceArray<std::int32_t> met_;
  DeviceArray<float> strength_, tool_strength_, share_;
  DeviceArray<std::uint64_t> near_;
  DeviceArray<FluidClear> clear_;
  DeviceArray<Collider> colliders_;
  DeviceArray<unsigned long long> loads_, touched_;
  DeviceArray<FluidMost> most_;
  PinnedArray<FluidMost> host_most_;
  PinnedArray<unsigned long long> host_loads_;
  PinnedArray<Collider> host_colliders_;
};

void ParticlesOnGpu::send(const FluidState& s) {
  const FluidParticles& p = s.particles;
  particles_ = p.size();
  kernel_ = s.kernel;
  spacing_ = s.spacing;
  const auto n = static_cast<std::size_t>(particles_);
  for (int a = 0; a < 3; ++a) {
    x_[a].upload(p.x[a], stream_);
    v_[a].upload(p.v[a], stream_);
    v_next_[a].resize(n);
  }
  volume_.upload(p.volume, stream_);
  pressure_.upload(p.pressure, stream_);
  dense_.upload(p.dense, stream_);
  kind_.upload(p.kind, stream_);
  laws_.upload(s.laws, stream_);
  std::vector<float> viscosity;
  for (const FluidLaw& law : s.laws) {
    viscosity.push_back(fluid::artificial_viscosity(s.kernel, law));
  }
  viscosity_.upload(viscosity, stream_);
  for (auto* rows : {&place_, &motion_, &wall_push_}) rows->resize(n);
  for (auto* field : {&strength_, &tool_strength_}) field->resize(n);
  near_.resize(n);
  met_.resize(n);
  clear_.resize(n);
  most_.resize(1);
  host_most_.resize(1);
  wait();
  fastest_ = fastest_of(p);
  lists_.made = false;
}

void ParticlesOnGpu::bring(FluidState& s) {
  FluidParticles& p = s.particles;
  const auto n = static_cast<std::size_t>(particles_);
  for (int a = 0; a < 3; ++a) {
    x_[a].download(p.x[a].data(), n, stream_);
    v_[a].download(p.v[a].data(), n, stream_);
  }
  pressure_.download(p.pressure.data(), n, stream_);
  dense_.download(p.dense.data(), n, stream_);
  wait();
}

FluidOnGpu ParticlesOnGpu::view() {
  FluidOnGpu v{};
  v.size = particles_;
  v.kernel = kernel_;
  v.spacing = spacing_;
  v.laws = laws_.data();
  v.kind = kind_.data();
  v.volume = volume_.data();
  for (int a = 0; a < 3; ++a) {
    v.x[a] = x_[a].data();
    v.v[a] = v_[a].data();
    v.v_next[a] = v_next_[a].data();
    v.listed[a] = lists_.x[a].data();
  }
  v.pressure = pressure_.data();
  v.dense = dense_.data();
  v.wall_begin = lists_.wall_begin.data();
  v.wall_soon = lists_.wall_soon.data();
  v.wall_near = lists_.wall_near.data();
  v.wall = lists_.wall.data();
  v.before = before_.data();
  v.now = now_.data();
  v.walls_moved = std::max(walls_moved_[0], walls_moved_[1]);
  v.motion = reinterpret_cast<float*>(motion_.data());
  v.strength = strength_.data();
  v.tool_strength = tool_strength_.data();
  v.wall_push = reinterpret_cast<float*>(wall_push_.data());
  v.near = near_.data();
  v.clear = clear_.data();
  v.begin = lists_.begin.data();
  v.other = lists_.other.data();
  v.place = place_.data();
  v.viscosity = viscosity_.data();
  v.met = met_.data();
  v.entries = lists_.pairs;
  v.wall_of = lists_.wall_of.data();
  v.share = share_.data();
  v.seen = seen_.data();
  v.triangles = triangles_;
  v.pair_begin = lists_.pair_begin.data();
  v.pair_particle = lists_.pair_particle.data();
  v.pair_entry = lists_.pair_entry.data();
  v.impulse = impulse_.data();
  v.touched = touched_.data();
  v.most = most_.data();
  return v;
}

void ParticlesOnGpu::sort(int count, int bits, DeviceArray<std::int32_t>& sorted) {
  ListsOnGpu& l = lists_;
  l.sorted_key.resize(count);
  sorted.resize(count);
  std::size_t bytes = 0;
  launch_fluid_sort(l.key.data(), l.sorted_key.data(), l.number.data(), sorted.data(), count, bits,
                    nullptr, bytes, stream_);
  l.memory.resize(bytes);
  launch_fluid_sort(l.key.data(), l.sorted_key.data(), l.number.data(), sorted.data(), count, bits,
                    l.memory.data(), bytes, stream_);
}

int ParticlesOnGpu::scan(int count, DeviceArray<std::int32_t>& before) {
  ListsOnGpu& l = lists_;
  before.resize(count + 1);
  std::size_t bytes = 0;
  launch_fluid_scan(l.counts.data(), before.data(), count + 1, nullptr, bytes, stream_);
  l.memory.resize(bytes);
  launch_fluid_scan(l.counts.data(), before.data(), count + 1, l.memory.data(), bytes, stream_);
  std::int32_t all = 0;
  check_cuda(
      cudaMemcpyAsync(&all, before.data() + count, sizeof all, cudaMemcpyDeviceToHost, stream_),
      "send data");
  wait();
  return all;
}

FluidGrid ParticlesOnGpu::make_grid(float reach) {
  ListsOnGpu& l = lists_;
  const FluidOnGpu v = view();
  l.box.resize(6);
  launch_fluid_bounds(v, l.box.data(), stream_);
  float box[6];
  l.box.download(box, 6, stream_);
  wait();
  FluidGrid g{};
  g.edge = 0.5f * reach;
  // Drops that are far apart take larger cells, not more memory.
  const double most = 8.0 * particles_ + 4096;
  constexpr float kFarthest = 1e6f;  // [m]: of what is not even a number the end of the frame tells
  for (;; g.edge *= 1.5f) {
    double cells = 1;
    for (int a = 0; a < 3; ++a) {
      g.low[a] = box[a];
      const float across = std::min(kFarthest, std::max(0.0f, box[3 + a] - box[a]));
      g.size[a] = 1 + static_cast<int>(across / g.edge);
      cells *= g.size[a];
    }
    if (cells <= most) break;
  }
  const auto n = static_cast<std::size_t>(particles_);
  l.key.resize(n);
  l.number.resize(n);
  l.cell_begin.resize(g.cells() + 1);
  l.place.resize(n);
  g.begin = l.cell_begin.data();
  g.place = l.place.data();
  launch_fluid_cells(v, g, l.key.data(), l.number.data(), stream_);
  int bits = 1;
  while ((1 << bits) < g.cells()) ++bits;
  sort(particles_, bits, l.in_cells);
  g.sorted = l.in_cells.data();
  launch_fluid_grid(v, g, l.sorted_key.data(), stream_);
  return g;
}

void ParticlesOnGpu::list(const FluidState& s, const DeviceArray<float>& corners, float skin) {
  ListsOnGpu& l = lists_;
  const float reach = kernel_.reach + skin;
  const FluidGrid grid = make_grid(reach);
  const FluidOnGpu v = view();
  l.counts.resize(particles_ + 1);
  l.counts.clear(stream_);
  launch_fluid_neighbours(v, grid, reach, l.counts.data(), nullptr, nullptr, stream_);
  l.other.resize(scan(particles_, l.begin));
  launch_fluid_neighbours(v, grid, reach, nullptr, l.begin.data(), l.other.data(), stream_);
  launch_fluid_triangles(corners.data(), triangles_, nullptr, now_.data(), stream_);
  list_walls(s, grid, reach);
  for (int a = 0; a < 3; ++a) l.x[a].copy(x_[a], stream_);
  l.corners.copy(corners, stream_);
  // Nothing was looked at yet.
  check_cuda(cudaMemsetAsync(clear_.data(), 0xff, clear_.size() * sizeof(FluidClear), stream_),
             "clear memory");
  l.made = true;
  moved_ = 0;
}

void ParticlesOnGpu::list_walls(const FluidState& s, const FluidGrid& grid, float reach) {
  ListsOnGpu& l = lists_;
  FluidOnGpu v = view();
  if (!s.is_bit.empty()) l.is_bit.upload(s.is_bit, stream_);
  const FluidWallReach of{reach, 0.5f * kernel_.reach, fluid::kSoon * spacing_,
                          s.is_bit.empty() ? nullptr : l.is_bit.data()};
  l.counts.resize(triangles_ + 1);
  l.counts.clear(stream_);
  launch_fluid_pairs(v, grid, of, triangles_, l.counts.data(), nullptr, nullptr, nullptr, nullptr,
                     nullptr, stream_);
  l.pairs = scan(triangles_, l.pair_begin);
  const auto pairs = static_cast<std::size_t>(l.pairs);
  for (auto* numbers :
       {&l.number, &l.pair_triangle, &l.pair_particle, &l.pair_entry, &l.wall, &l.wall_of}) {
    numbers->resize(pairs);
  }
  l.key.resize(pairs);
  launch_fluid_pairs(v, grid, of, triangles_, nullptr, l.pair_begin.data(), l.key.data(),
                     l.number.data(), l.pair_triangle.data(), l.pair_particle.data(), stream_);
  int bits = 3;
  while ((1ll << bits) < 4ll * particles_) ++bits;
  if (l.pairs > 0) sort(l.pairs, bits, l.sorted_pair);
  l.wall_begin.resize(particles_ + 1);
  for (auto* ends : {&l.wall_soon, &l.wall_near}) ends->resize(particles_);
  launch_fluid_entries(particles_, l.pairs, l.sorted_key.data(), l.sorted_pair.data(),
                       l.pair_triangle.data(), l.wall_begin.data(), l.wall_soon.data(),
                       l.wall_near.data(), l.wall.data(), l.wall_of.data(), l.pair_entry.data(),
                       stream_);
  share_.resize(pairs);
  seen_.resize(pairs);
}

float ParticlesOnGpu::walls_moved(const DeviceArray<float>& corners, int end) {
  unsigned* const most = most_.data()->walls_moved2 + end;
  check_cuda(cudaMemsetAsync(most, 0, sizeof *most, stream_), "clear memory");
  launch_fluid_walls_moved(corners.data(), lists_.corners.data(), triangles_,
                           lists_.is_bit.size() == 0 ? nullptr : lists_.is_bit.data(), most,
                           stream_);
  unsigned bits = 0;
  check_cuda(cudaMemcpyAsync(&bits, most, sizeof bits, cudaMemcpyDeviceToHost, stream_),
             "send data");
  wait();
  return root_of(bits);
}

void ParticlesOnGpu::set_walls(const float* corners, int triangles, bool are_new) {
  const std::size_t count = std::size_t{9} * triangles;
  triangles_ = triangles;
  begin_corners_.swap(end_corners_);
  end_corners_.resize(count);
  check_cuda(cudaMemcpyAsync(end_corners_.data(), corners, count * sizeof(float), cudaMemcpyDefault,
                             stream_),
             "receive data");
  if (are_new) begin_corners_.copy(end_corners_, stream_);
  before_.resize(triangles_);
  now_.resize(triangles_);
  impulse_.resize(std::size_t{3} * triangles_);
  touched_.resize(std::size_t{3} * triangles_);
}

void ParticlesOnGpu::bring_impulses(FluidWalls& walls) {
  walls.impulse.resize(impulse_.size());
  impulse_.download(walls.impulse.data(), impulse_.size(), stream_);
  wait();
}

int ParticlesOnGpu::advance(const FluidState& s, const FluidDrive& drive,
                            std::vector<ColliderLoad>& loads) {
  impulse_.clear(stream_);
  touched_.clear(stream_);
  if (particles_ == 0) {
    wait();
    return 0;
  }
  const int count =
      std::max(1, static_cast<int>(std::ceil(drive.duration / stable_fluid_step(s, fastest_))));
  const float far = fluid::kMayMove * kernel_.reach;
  if (lists_.corners.size() != end_corners_.size()) lists_.made = false;
  walls_moved_[0] = walls_moved_[1];
  walls_moved_[1] = lists_.made ? walls_moved(end_corners_, 1) : 0;
  if (walls_moved_[1] > far) lists_.made = false;
  const std::size_t sums = kFluidLoadSums * std::max<std::size_t>(loads.size(), 16);
  loads_.resize(sums);
  loads_.clear(stream_);
  host_loads_.resize(sums);
  double weight = 0;
  for (int i = 0; i < count; ++i) {
    const bool listed = !lists_.made || moved_ > far;
    if (listed) {
      list(s, end_corners_, fluid::kSkin * kernel_.reach);
      walls_moved_[0] = i == 0 ? walls_moved(begin_corners_, 0) : 0;
      walls_moved_[1] = 0;
    }
    most_.clear(stream_);
    if (i == 0) {
      const std::int32_t* const met = lists_.pair_begin.data();
      if (listed) {
        launch_fluid_triangles(begin_corners_.data(), triangles_, met, before_.data(), stream_);
      } else {
        before_.swap(now_);
        launch_fluid_triangles(end_corners_.data(), triangles_, met, now_.data(), stream_);
      }
      launch_fluid_yield(view(), static_cast<float>(drive.duration), stream_);
    }
    const std::vector<Collider> colliders = drive.colliders((i + 1.0) / count);
    host_colliders_.resize(colliders.size());
    std::copy(colliders.begin(), colliders.end(), host_colliders_.data());
    colliders_.upload(host_colliders_.data(), colliders.size(), stream_);
    FluidSubstep step = fluid_substep(drive, count, colliders);
    step.colliders = colliders_.data();
    weight = step.weight;
    launch_fluid_substep(view(), step, i + 1 == count, loads_.data(), stream_);
    most_.download(host_most_.data(), 1, stream_);
    if (i + 1 == count) loads_.download(host_loads_.data(), sums, stream_);
    wait();
    moved_ = root_of(host_most_[0].moved2);
    fastest_ = root_of(host_most_[0].speed2);
  }
  for (std::size_t c = 0; c < loads.size(); ++c) {
    for (int a = 0; a < 3; ++a) {
      const auto sum = [&](int k) {
        const auto units = static_cast<long long>(host_loads_[kFluidLoadSums * c + k]);
        return weight * kFluidLoadUnit * static_cast<double>(units);
      };
      loads[c].force[a] += sum(a);
      loads[c].torque[a] += sum(3 + a);
    }
  }
  return count;
}

void ParticlesOnGpu::push_out_of_walls(const FluidState& s) {
  list(s, end_corners_, 0);
  launch_fluid_leave(view(), stream_);
  wait();
  lists_.made = false;
}

}  // namespace

std::unique_ptr<FluidDevice> make_fluid_on_gpu() { return std::make_unique<ParticlesOnGpu>(); }

}  // namespace tissue_sim
