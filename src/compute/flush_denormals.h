// Numbers too small for full precision count as zero while this lives: tissue at rest is full of
// them, and processors take a hundred times as long over each.
#pragma once

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace tissue_sim {

/// For the thread that makes it, until it is destroyed; without effect on other than x86-64 and
/// 64-bit ARM processors.
class FlushDenormals {
 public:
  FlushDenormals() : before_(get()) {
#if defined(__SSE2__)
    set(before_ | 0x8040);  // of results and of operands
#elif defined(__aarch64__)
    set(before_ | Control{1} << 24);
#endif
  }
  ~FlushDenormals() { set(before_); }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
#if defined(__SSE2__)
  using Control = unsigned;
  static Control get() { return _mm_getcsr(); }
  static void set(Control control) { _mm_setcsr(control); }
#elif defined(__aarch64__)
  using Control = unsigned long;
  static Control get() {
    Control control;
    asm volatile("mrs %0, fpcr" : "=r"(control));
    return control;
  }
  static void set(Control control) { asm volatile("msr fpcr, %0" : : "r"(control)); }
#else
  using Control = unsigned;
  static Control get() { return 0; }
  static void set(Control) {}
#endif

  const Control before_;
};

}  // namespace tissue_sim
