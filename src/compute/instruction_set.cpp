#include <cstdlib>
#include <stdexcept>
#include <string>

#include "compute/simd.h"

namespace tissue_sim {
namespace {

InstructionSet best() {
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw")) {
    return InstructionSet::kAvx512;
  }
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return InstructionSet::kAvx2;
#endif
  return InstructionSet::kSse2;
}

}  // namespace

const char* name(InstructionSet set) {
  switch (set) {
    case InstructionSet::kAvx512:
      return "AVX-512";
    case InstructionSet::kAvx2:
      return "AVX2";
    default:
      return "SSE2";
  }
}

InstructionSet instruction_set() {
  const char* wish = std::getenv("TISSUE_SIM_INSTRUCTION_SET");
  if (wish == nullptr || *wish == 0) return best();
  const std::string s = wish;
  InstructionSet set;
  if (s == "sse2") {
    set = InstructionSet::kSse2;
  } else if (s == "avx2") {
    set = InstructionSet::kAvx2;
  } else if (s == "avx512") {
    set = InstructionSet::kAvx512;
  } else {
    throw std::runtime_error("TISSUE_SIM_INSTRUCTION_SET is '" + s +
                             "': it must be sse2, avx2 or avx512");
  }
  if (set > best()) {
    throw std::runtime_error("TISSUE_SIM_INSTRUCTION_SET is '" + s + "': this processor has only " +
                             name(best()) + "; unset the variable");
  }
  return set;
}

}  // namespace tissue_sim
