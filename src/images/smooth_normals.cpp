#include "images/smooth_normals.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

namespace tissue_sim {
namespace {

constexpr float kSmooth = 0.64f;  // cosine of the largest angle between faces that count as one

float inner_product(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace

void SmoothNormals::group(const SurfaceTriangles& surface) {
  rest_ = surface.rest;
  fragment_ = surface.fragment;
  cut_ = surface.cut;
  corners_.resize(3 * fragment_.size());
  std::iota(corners_.begin(), corners_.end(), 0);
  const auto before = [this](std::int32_t a, std::int32_t b) {
    const int order = std::memcmp(&rest_[3 * a], &rest_[3 * b], 3 * sizeof(float));
    if (order != 0) return order < 0;
    if (fragment_[a / 3] != fragment_[b / 3]) return fragment_[a / 3] < fragment_[b / 3];
    if (cut_[a / 3] != cut_[b / 3]) return cut_[a / 3] < cut_[b / 3];
    return a < b;
  };
  std::sort(corners_.begin(), corners_.end(), before);
  begin_.clear();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const std::int32_t a = i == 0 ? 0 : corners_[i - 1], b = corners_[i];
    const bool same = i > 0 && std::memcmp(&rest_[3 * a], &rest_[3 * b], 3 * sizeof(float)) == 0 &&
                      fragment_[a / 3] == fragment_[b / 3] && cut_[a / 3] == cut_[b / 3];
    if (!same) begin_.push_back(static_cast<std::int32_t>(i));
  }
  begin_.push_back(static_cast<std::int32_t>(corners_.size()));
}

const std::vector<float>& SmoothNormals::of(const SurfaceTriangles& surface, Cpu& cpu) {
  if (surface.fragment != fragment_ || surface.cut != cut_ || surface.rest != rest_) group(surface);
  constexpr int kGrain = 1024;
  const std::size_t triangles = fragment_.size();
  faces_.resize(3 * triangles);  // twice the area long
  const auto face = [&](int t) {
    const float* x = &surface.corners[9 * t];
    float a[3], b[3];
    for (int i = 0; i < 3; ++i) a[i] = x[3 + i] - x[i], b[i] = x[6 + i] - x[i];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      faces_[3 * t + i] = a[j] * b[k] - a[k] * b[j];
    }
  };
  cpu.for_each(static_cast<int>(triangles), face, kGrain);
  normals_.resize(9 * triangles);
  const auto group = [&](int g) {
    for (std::int32_t i = begin_[g]; i < begin_[g + 1]; ++i) {
      const float* own = &faces_[3 * (corners_[i] / 3)];
      const float length = std::sqrt(inner_product(own, own));
      float sum[3] = {};
      for (std::int32_t k = begin_[g]; k < begin_[g + 1]; ++k) {
        const float* other = &faces_[3 * (corners_[k] / 3)];
        if (inner_product(own, other) < kSmooth * length * std::sqrt(inner_product(other, other)))
          continue;
        for (int a = 0; a < 3; ++a) sum[a] += other[a];
      }
      const float all = std::sqrt(inner_product(sum, sum));
      for (int a = 0; a < 3; ++a) {
        normals_[3 * corners_[i] + a] = all > 0 ? sum[a] / all : a == 2 ? 1.0f : 0.0f;
      }
    }
  };
  cpu.for_each(static_cast<int>(begin_.size()) - 1, group, kGrain);
  return normals_;
}

std::vector<float> SmoothNormals::means(const std::vector<float>& of_triangle) const {
  std::vector<float> means(corners_.size());
  for (std::size_t g = 0; g + 1 < begin_.size(); ++g) {
    float sum = 0;
    for (std::int32_t i = begin_[g]; i < begin_[g + 1]; ++i) sum += of_triangle[corners_[i] / 3];
    for (std::int32_t i = begin_[g]; i < begin_[g + 1]; ++i) {
      means[corners_[i]] = sum / static_cast<float>(begin_[g + 1] - begin_[g]);
    }
  }
  return means;
}

}  // namespace tissue_sim
