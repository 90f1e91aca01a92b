// Fragments by hash grid on the GPU are those on the CPU. Skipped where there is no GPU.
#include <gtest/gtest.h>

#if defined(TISSUE_SIM_CUDA)
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "paper/cuda_hash_grid.h"
#include "paper/hash_grid.h"
#include "paper/torn_points.h"

namespace tissue_sim {
namespace {

class HashGridOnGpu : public testing::Test {
 protected:
  void SetUp() override {
    const std::string why = why_no_gpu();
    if (!why.empty()) GTEST_SKIP() << why;
  }
  PointGroups on_gpu(const PointPlaces& places, const CellBox& box) {
    PointPlaces there;
    there.count = places.count;
    for (int a = 0; a < 3; ++a) {
      if (places.x[a] == nullptr) continue;
      x_[a].upload(places.x[a], places.count, nullptr);
      there.x[a] = x_[a].data();
    }
    grid_.find_groups(there, box, nullptr);
    PointGroups groups;
    groups.count.resize(grid_.wait(nullptr));
    groups.of_point.resize(places.count);
    grid_.of_point().download(groups.of_point.data(), groups.of_point.size(), nullptr);
    grid_.count().download(groups.count.data(), groups.count.size(), nullptr);
    check_cuda(cudaStreamSynchronize(nullptr), "send data");
    return groups;
  }
  void expect_as_on_cpu(const PointPlaces& places, const CellBox& box, const std::string& what) {
    Cpu cpu(1);
    const PointGroups& expected = on_cpu_.find_groups(places, box, cpu);
    const PointGroups found = on_gpu(places, box);
    EXPECT_EQ(found.of_point, expected.of_point) << what;
    EXPECT_EQ(found.count, expected.count) << what;
  }

 private:
  CudaHashGrid grid_;  // one for all, as its memory is used again
  HashGrid on_cpu_;
  DeviceArray<float> x_[3];
};

TEST_F(HashGridOnGpu, FindsTornBodies) {
  for (const int dimensions : {2, 3}) {
    for (const int points : {25000, 100000, 1000000}) {
      const TornPoints torn = torn_points(dimensions, points, dimensions == 2 ? 20 : 25, 2);
      expect_as_on_cpu(torn.places(), torn.box, std::to_string(points));
    }
  }
}

TEST_F(HashGridOnGpu, FindsRandomPoints) {
  std::mt19937 random(1);
  for (const int dimensions : {2, 3}) {
    for (const int count : {1, 2, 33, 700, 20000, 300000}) {
      for (const double fill : {0.3, 0.55, 1.5}) {  // points a cell
        const double h = 0.37, extent = h * std::pow(count / fill, 1.0 / dimensions);
        std::uniform_real_distribution<float> u(static_cast<float>(-0.6 * extent),
                                                static_cast<float>(0.4 * extent));
        std::vector<float> x[3];
        PointPlaces places;
        for (int a = 0; a < dimensions; ++a) {
          for (int p = 0; p < count; ++p) x[a].push_back(u(random));
          places.x[a] = x[a].data();
        }
        places.count = count;
        expect_as_on_cpu(places, cell_box(places, h),
                         std::to_string(dimensions) + " " + std::to_string(count));
      }
    }
  }
}

TEST_F(HashGridOnGpu, FindsPointsThatFlewFarApart) {  // in a real hash table
  std::mt19937 random(2);
  std::uniform_int_distribution<int> offset(-400000, 400000), step(0, 5);
  std::vector<float> x[3];
  for (int clump = 0; clump < 300; ++clump) {
    float at[3];
    for (float& a : at) a = 0.5f + static_cast<float>(offset(random));
    for (int p = 0; p < 200; ++p) {
      const int k = step(random);
      at[k / 2] += k % 2 == 0 ? -1 : 1;
      for (int a = 0; a < 3; ++a) x[a].push_back(at[a]);
    }
  }
  PointPlaces places;
  for (int a = 0; a < 3; ++a) places.x[a] = x[a].data();
  places.count = static_cast<std::int32_t>(x[0].size());
  expect_as_on_cpu(places, cell_box(places, 1), "far apart");
}

TEST_F(HashGridOnGpu, RefusesAPointOutsideOfTheBox) {
  const TornPoints torn = torn_points(3, 1000, 5, 2);
  std::vector<float> x = torn.x[1];
  PointPlaces places = torn.places();
  places.x[1] = x.data();
  for (const float outside : {-2.0f, 1e6f, NAN}) {
    x[17] = outside;
    EXPECT_THROW(on_gpu(places, torn.box), std::invalid_argument) << outside;
  }
}

}  // namespace
}  // namespace tissue_sim
#endif
