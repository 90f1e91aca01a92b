// Archives: the bytes of a state, written and read by one list of its fields:
//
//   template <class Archive>
//   void fields(Archive& archive, Nodes& n) { archive(n.u, n.v, n.mass); }
//
//   ArchiveWriter out;  out(nodes);
//   ArchiveReader in(out.bytes());  in(nodes);
//
// What has no such list and can be copied byte by byte is. Bytes are those of this machine: a state
// goes to other processes on the same kind of machine, not to other ones.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "tissue_sim/types.h"

namespace tissue_sim {

template <class Archive, class T, class = void>
struct HasFields : std::false_type {};
template <class Archive, class T>
struct HasFields<Archive, T,
                 std::void_t<decltype(fields(std::declval<Archive&>(), std::declval<T&>()))>>
    : std::true_type {};

/// What both have in common: how what is made of others is taken apart.
template <class Archive>
class ArchiveFields {
 public:
  template <class... T>
  void operator()(T&... all) {
    (item(all), ...);
  }

 private:
  Archive& self() { return static_cast<Archive&>(*this); }

  template <class T>
  void item(T& x) {
    if constexpr (HasFields<Archive, T>::value) {
      fields(self(), x);
    } else if constexpr (std::is_array_v<T>) {
      for (auto& each : x) item(each);
    } else {
      static_assert(std::is_trivially_copyable_v<T> && !std::is_pointer_v<T>,
                    "this type needs a list of its fields");
      self().raw(&x, sizeof x);
    }
  }
  template <class T, class Allocator>
  void item(std::vector<T, Allocator>& x) {
    static_assert(!std::is_same_v<T, bool>, "its elements have no address");
    constexpr bool plain =
        std::is_trivially_copyable_v<T> && !HasFields<Archive, T>::value && !std::is_pointer_v<T>;
    x.resize(self().count(x.size(), plain ? sizeof(T) : 1));
    if constexpr (plain) {
      self().raw(x.data(), x.size() * sizeof(T));
    } else {
      for (T& each : x) item(each);
    }
  }
  template <class T, std::size_t N>
  void item(std::array<T, N>& x) {
    for (T& each : x) item(each);
  }
  void item(std::string& x) {
    x.resize(self().count(x.size(), 1));
    self().raw(x.data(), x.size());
  }
  template <class T, int Rows, int Columns, int Options>
  void item(Eigen::Matrix<T, Rows, Columns, Options, Rows, Columns>& x) {
    static_assert(Rows > 0 && Columns > 0, "of a size that is not fixed");
    self().raw(x.data(), sizeof(T) * Rows * Columns);
  }
  void item(Quat& x) { self().raw(x.coeffs().data(), 4 * sizeof(double)); }
  template <class T>
  void item(std::set<T>& x) {
    std::vector<T> all(x.begin(), x.end());
    item(all);
    x = std::set<T>(all.begin(), all.end());
  }
  template <class T>
  void item(std::unique_ptr<T>& x) {
    std::uint8_t there = x != nullptr;
    item(there);
    if (there == 0) {
      x.reset();
      return;
    }
    if (x == nullptr) x = std::make_unique<T>();
    item(*x);
  }
};

class ArchiveWriter : public ArchiveFields<ArchiveWriter> {
 public:
  static constexpr bool kReads = false;
  void raw(void* data, std::size_t size) {
    const auto* const begin = static_cast<const std::uint8_t*>(data);
    bytes_.insert(bytes_.end(), begin, begin + size);
  }
  std::size_t count(std::size_t n, std::size_t) {
    std::uint64_t written = n;
    raw(&written, sizeof written);
    return n;
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }
  std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  std::vector<std::uint8_t> bytes_;
};

/// Throws std::runtime_error where there are not enough bytes.
class ArchiveReader : public ArchiveFields<ArchiveReader> {
 public:
  static constexpr bool kReads = true;
  /// The bytes must outlive it.
  explicit ArchiveReader(Span<const std::uint8_t> bytes) : at_(bytes.begin()), end_(bytes.end()) {}

  void raw(void* data, std::size_t size) {
    if (size > left()) throw std::runtime_error("the state ends too early");
    if (size > 0) std::memcpy(data, at_, size);
    at_ += size;
  }
  std::size_t count(std::size_t, std::size_t bytes_each) {
    std::uint64_t n = 0;
    raw(&n, sizeof n);
    if (n > left() / bytes_each) throw std::runtime_error("the state ends too early");
    return static_cast<std::size_t>(n);
  }
  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

 private:
  const std::uint8_t *at_, *end_;
};

}  // namespace tissue_sim
