// How the steps of a frame are launched.
#include <stdexcept>

#include "pbd/cuda/on_device.h"

namespace tissue_sim {
namespace {

/// Time that one block of threads takes for all colours once [us]: `colour` for each colour, and
/// `round` for each time that its threads have a constraint each.
double time_of(const std::vector<std::int32_t>& begin, int threads, double colour, double round) {
  double sum = 0;
  for (std::size_t c = 0; c + 1 < begin.size(); ++c) {
    const int lanes = (begin[c + 1] - begin[c]) * pbd::kLanes;
    sum += colour + round * ((lanes + threads - 1) / threads);
  }
  return sum;
}

}  // namespace

CudaPbdTissue::Way CudaPbdTissue::faster_way() const {
  const OnDevice& d = *device_;
  const pbd::State& s = *state_;
  // On an H100, in us; what a launch takes within a graph is 1.6, of tetrahedra 2.9, and each
  // further colour that it is of 0.8, of tetrahedra 1.
  const bool is_surface = s.elastics.blocks.empty() && s.strains.blocks.empty();
  const int threads = is_surface ? 1024 : 512;
  const double one_block =
      time_of(s.elastics.begin, threads, 1.0, 0.6) + time_of(s.strains.begin, threads, 1.3, 0.7) +
      time_of(s.links.begin, threads, 0.2, 0.2) + time_of(s.bends.begin, threads, 0.3, 0.7);
  const int count = pbd::pbd_projection_launches(
      {s.elastics.begin, s.strains.begin, s.links.begin, s.bends.begin});
  const int all = static_cast<int>(s.elastics.begin.size() + s.strains.begin.size() +
                                   s.links.begin.size() + s.bends.begin.size()) -
                  4;
  const double launches =
      (is_surface ? 1.6 : 2.9) * (3 + count) + (is_surface ? 0.8 : 1.0) * (all - count);
  return pbd::fits_pbd_block(d.field()) && one_block < launches ? Way::kOneBlock : Way::kLaunches;
}

void CudaPbdTissue::choose_way() {
  OnDevice& d = *device_;
  if (d.wanted == Way::kOneBlock && !pbd::fits_pbd_block(d.field())) {
    throw std::runtime_error("one block of threads has no room for " + std::to_string(d.count) +
                             " vertices; let the tissue choose");
  }
  d.way = d.wanted == Way::kFaster ? faster_way() : d.wanted;
}

void CudaPbdTissue::set_way(Way way) {
  device_->wanted = way;
  choose_way();
}

CudaPbdTissue::Way CudaPbdTissue::way() const { return device_->way; }

}  // namespace tissue_sim
