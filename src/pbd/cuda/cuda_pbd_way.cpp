// How the steps of a frame are launched.
#include <algorithm>
#include <stdexcept>

#include "pbd/cuda/on_device.h"
#include "pbd/cuda/section_words.h"
#include "tools/frame_colliders.h"

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

void CudaPbdTissue::upload_sections() {
  OnDevice& d = *device_;
  const pbd::State& s = *state_;
  d.in_sections = {};
  const bool is_whole = s.components == 1 && d.sweeps == 1;
  const bool is_surface = s.elastics.blocks.empty() && s.strains.blocks.empty();
  const int most = pbd::most_pbd_sections();
  if (!is_whole || !is_surface || most == 0 || d.count >= 1 << 16) return;
  const pbd::Sections sections = pbd::find_sections(s, most);
  if (sections.count == 0) return;
  const pbd::SectionWords words = pbd::section_words(s, sections);
  d.sections.upload(words.of, d.stream);
  d.section_words.upload(words.words, d.stream);
  d.wait("receive data");
  d.in_sections = {d.sections.data(), d.section_words.data(), sections.count,
                   words.most_words,  words.most_own,         {}};
  std::copy_n(sections.first, 6, d.in_sections.first);
  const int colliders = s.scene.pbd.steps * collider_count(s.scene);
  if (!pbd::fits_pbd_sections(d.field(), d.in_sections, colliders)) d.in_sections = {};
}

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
  const Way was = d.way;
  // Where vertices are few, one block has few constraints of a colour, too, and fewer colours.
  constexpr int kLeastInSections = 1000;
  if (d.wanted == Way::kSections || (d.wanted == Way::kFaster && d.count >= kLeastInSections)) {
    upload_sections();
  } else {
    d.in_sections = {};
  }
  if (d.wanted == Way::kFaster || d.wanted == Way::kSections) {
    d.way = d.in_sections.count > 0 ? Way::kSections : faster_way();
  } else if (d.wanted == Way::kOneBlock && !pbd::fits_pbd_block(d.field())) {
    throw std::runtime_error("one block of threads has no room for " + std::to_string(d.count) +
                             " vertices; let the tissue choose");
  } else {
    d.way = d.wanted;
  }
  if (d.way != was) upload_constraints();  // in another order
}

void CudaPbdTissue::set_way(Way way) {
  device_->wanted = way;
  choose_way();
  if (way == Way::kSections && device_->way != way) {
    throw std::runtime_error("this tissue's steps cannot be taken by sections; let it choose");
  }
}

CudaPbdTissue::Way CudaPbdTissue::way() const { return device_->way; }

}  // namespace tissue_sim
