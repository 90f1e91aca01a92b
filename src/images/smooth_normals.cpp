#include "images/smooth_normals.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace tissue_sim {
namespace {

constexpr float kSmooth = 0.64f;  // cosine of the largest angle between faces that count as one

float inner_product(const float* a, const float* b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

}  // namespace

void SmoothNormals::group(const SurfaceTriangles& surface) {
  const std::vector<float>& rest = surface.rest;
  corners_.resize(3 * surface.fragment.size());
  std::iota(corners_.begin(), corners_.end(), 0);
  const auto order = [&](std::int32_t a, std::int32_t b) {
    for (int i = 0; i < 3; ++i) {
      if (rest[3 * a + i] != rest[3 * b + i]) return rest[3 * a + i] < rest[3 * b + i] ? -1 : 1;
    }
    const int by_piece = surface.fragment[a / 3] - surface.fragment[b / 3];
    return by_piece != 0 ? by_piece : surface.cut[a / 3] - surface.cut[b / 3];
  };
  std::sort(corners_.begin(), corners_.end(), [&](std::int32_t a, std::int32_t b) {
    const int o = order(a, b);
    return o != 0 ? o < 0 : a < b;
  });
  begin_.clear();
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    if (i == 0 || order(corners_[i - 1], corners_[i]) != 0) {
      begin_.push_back(static_cast<std::int32_t>(i));
    }
  }
  begin_.push_back(static_cast<std::int32_t>(corners_.size()));
}

void SmoothNormals::put(const SurfaceTriangles& surface, Cpu& cpu, std::vector<float>& normals) {
  if (surface.made == 0 || surface.made != made_) group(surface);
  made_ = surface.made;
  constexpr int kGrain = 1024;
  const std::size_t triangles = surface.fragment.size();
  faces_.resize(4 * triangles);
  const auto face = [&](int t) {
    const float* x = &surface.corners[9 * t];
    float a[3], b[3];
    for (int i = 0; i < 3; ++i) a[i] = x[3 + i] - x[i], b[i] = x[6 + i] - x[i];
    float* to = &faces_[4 * t];
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      to[i] = a[j] * b[k] - a[k] * b[j];
    }
    to[3] = std::sqrt(inner_product(to, to));
  };
  cpu.for_each(static_cast<int>(triangles), face, kGrain);
  normals.resize(9 * triangles);
  const auto group = [&](int g) {
    for (std::int32_t i = begin_[g]; i < begin_[g + 1]; ++i) {
      const float* own = &faces_[4 * (corners_[i] / 3)];
      float sum[3] = {};
      for (std::int32_t k = begin_[g]; k < begin_[g + 1]; ++k) {
        const float* other = &faces_[4 * (corners_[k] / 3)];
        if (inner_product(own, other) < kSmooth * own[3] * other[3]) continue;
        for (int a = 0; a < 3; ++a) sum[a] += other[a];
      }
      const float all = std::sqrt(inner_product(sum, sum));
      for (int a = 0; a < 3; ++a) {
        normals[3 * corners_[i] + a] = all > 0 ? sum[a] / all : a == 2 ? 1.0f : 0.0f;
      }
    }
  };
  cpu.for_each(static_cast<int>(begin_.size()) - 1, group, kGrain);
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
