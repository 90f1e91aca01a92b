#include "compute/array.h"

#if defined(__linux__)
#include <sys/mman.h>
#endif

namespace tissue_sim {
namespace {

// Of x86-64, and of ARM with pages of 4 KiB.
constexpr std::size_t kLargePage = std::size_t{1} << 21;

}  // namespace

void* allocate_lines(std::size_t bytes) {
  const bool large = bytes >= kLargePage;
  const std::size_t alignment = large ? kLargePage : 64;
  void* const p = std::aligned_alloc(alignment, (bytes + alignment - 1) / alignment * alignment);
  if (p == nullptr) throw std::bad_alloc();
#if defined(MADV_HUGEPAGE)
  // Who goes through much memory at random waits for addresses as often as for what lies there:
  // a large page has 512 times the addresses. A wish; without it all is as ever.
  if (large) madvise(p, bytes, MADV_HUGEPAGE);
#endif
  return p;
}

}  // namespace tissue_sim
