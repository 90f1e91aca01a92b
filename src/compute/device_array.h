// Arrays on the GPU, and arrays on the host that the GPU copies from and to at full speed.
#pragma once

#include <atomic>
#include <cstddef>
#include <string>
#include <utility>

#include "compute/cuda_check.h"
#include "tissue_sim/limits.h"

namespace tissue_sim {

/// Bytes that all DeviceArrays have.
inline std::atomic<std::size_t> device_bytes_held{0};

/// `n` elements of device memory. Growing does not keep what was in it; where it grows again, a
/// little more than is asked for.
template <class T>
class DeviceArray {
 public:
  DeviceArray() = default;
  ~DeviceArray() { free(); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;

  /// Throws OutOfMemory saying how much memory was wanted and how much is free.
  void resize(std::size_t n) {
    size_ = n;
    if (n <= capacity_) return;
    if (capacity_ > 0) n += n / 16;
    free();
    if (cudaMalloc(reinterpret_cast<void**>(&data_), n * sizeof(T)) != cudaSuccess) {
      cudaGetLastError();
      std::size_t free = 0, total = 0;
      cudaMemGetInfo(&free, &total);
      throw OutOfMemory("the GPU's memory does not suffice: " + megabytes(n * sizeof(T)) +
                        " more are needed, " + megabytes(free) + " of " + megabytes(total) +
                        " are free");
    }
    capacity_ = n;
    device_bytes_held += n * sizeof(T);
  }
  void upload(const T* from, std::size_t n, cudaStream_t stream) {
    resize(n);
    if (n == 0) return;
    check_cuda(cudaMemcpyAsync(data_, from, n * sizeof(T), cudaMemcpyHostToDevice, stream),
               "receive data");
  }
  template <class Container>
  void upload(const Container& from, cudaStream_t stream) {
    upload(from.data(), from.size(), stream);
  }
  void copy(const DeviceArray& from, cudaStream_t stream) {
    resize(from.size_);
    if (size_ == 0) return;
    check_cuda(
        cudaMemcpyAsync(data_, from.data_, size_ * sizeof(T), cudaMemcpyDeviceToDevice, stream),
        "copy");
  }
  void download(T* to, std::size_t n, cudaStream_t stream) const {
    if (n == 0) return;
    check_cuda(cudaMemcpyAsync(to, data_, n * sizeof(T), cudaMemcpyDeviceToHost, stream),
               "send data");
  }
  void clear(cudaStream_t stream) {
    if (size_ == 0) return;
    check_cuda(cudaMemsetAsync(data_, 0, size_ * sizeof(T), stream), "clear memory");
  }

  /// Grows to `n` elements and keeps what was in it.
  void extend(std::size_t n, cudaStream_t stream) {
    if (n > capacity_) {
      DeviceArray larger;
      larger.resize(n + n / 16);
      larger.size_ = size_;
      larger.copy(*this, stream);
      check_cuda(cudaStreamSynchronize(stream), "copy");
      swap(larger);
    }
    size_ = n;
  }
  void swap(DeviceArray& other) {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    std::swap(capacity_, other.capacity_);
  }

  T* data() const { return data_; }
  std::size_t size() const { return size_; }

  static std::string megabytes(std::size_t bytes) {
    return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MB";
  }

 private:
  void free() {
    cudaFree(data_);
    device_bytes_held -= capacity_ * sizeof(T);
    data_ = nullptr;
    capacity_ = 0;
  }

  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

/// Page-locked host memory. Growing does not keep what was in it; where it grows again, a little
/// more than is asked for.
template <class T>
class PinnedArray {
 public:
  PinnedArray() = default;
  ~PinnedArray() { cudaFreeHost(data_); }
  PinnedArray(const PinnedArray&) = delete;
  PinnedArray& operator=(const PinnedArray&) = delete;

  void resize(std::size_t n) {
    size_ = n;
    if (n <= capacity_) return;
    if (capacity_ > 0) n += n / 8;
    cudaFreeHost(data_);
    data_ = nullptr;
    capacity_ = 0;
    check_cuda(cudaMallocHost(reinterpret_cast<void**>(&data_), n * sizeof(T)), "lock host memory");
    capacity_ = n;
  }
  T* data() const { return data_; }
  std::size_t size() const { return size_; }
  T& operator[](std::size_t i) const { return data_[i]; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0, capacity_ = 0;
};

}  // namespace tissue_sim
