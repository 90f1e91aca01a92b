// for_each: where a kernel runs. A kernel is a named functor with a host/device operator()(int);
// the CPU spreads it over threads, a .cu file launches the same functor on the GPU.
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <thread>

#include "compute/flush_denormals.h"

namespace tissue_sim {

/// The CPU with a number of threads (0 for all that the process may use).
class Cpu {
 public:
  explicit Cpu(int threads) : arena_(threads_of(threads)) {}
  /// One whose threads go where others have work, as soon as they are done with what they began.
  struct Yields {};
#if __has_include(<tbb/version.h>)  // oneTBB: before it, arenas have no priority
  Cpu(int threads, Yields) : arena_(threads_of(threads), 1, tbb::task_arena::priority::low) {}
#else
  Cpu(int threads, Yields) : Cpu(threads) {}
#endif
  int threads() { return arena_.max_concurrency(); }

  /// Calls f(i) for each i in [0, n), `grain` at a time on a thread. Which thread does what is
  /// open: for the same bits, f(i) writes only what is i's. Denormal numbers count as zero.
  template <class F>
  void for_each(int n, const F& f, int grain = 1) {
    if (threads() == 1) {
      const FlushDenormals flush;
      for (int i = 0; i < n; ++i) f(i);
      return;
    }
    arena_.execute([&] {
      tbb::parallel_for(tbb::blocked_range<int>(0, n, grain),
                        [&](const tbb::blocked_range<int>& r) {
                          const FlushDenormals flush;
                          for (int i = r.begin(); i < r.end(); ++i) f(i);
                        });
    });
  }
  /// Calls f() on each thread: see SharedWork.
  template <class F>
  void on_each_thread(const F& f) {
    const auto flushed = [&f](int) {
      const FlushDenormals flush;
      f();
    };
    if (threads() == 1) {
      flushed(0);
      return;
    }
    arena_.execute([&] { tbb::parallel_for(0, threads(), flushed, tbb::static_partitioner()); });
  }
  /// Calls f and g, side by side where there are threads: neither may write what the other one
  /// reads.
  template <class F, class G>
  void both(const F& f, const G& g) {
    if (threads() == 1) {
      f();
      g();
      return;
    }
    arena_.execute([&] { tbb::parallel_invoke(f, g); });
  }
  /// Calls f(), whose own parallel work takes these threads.
  template <class F>
  void execute(const F& f) {
    arena_.execute(f);
  }

 private:
  static int threads_of(int n) { return n > 0 ? n : tbb::task_arena::automatic; }
  tbb::task_arena arena_;
};

/// f(i) for each i in [0, n), which threads take one after the other, `grain` at a time. One such
/// work may follow another without a barrier between them. What f throws leaves on_each_thread().
class SharedWork {
 public:
  SharedWork(int n, int grain) : n_(n), grain_(grain) {}
  /// Calls f(i) for what no thread has begun.
  template <class F>
  void help(const F& f) {
    for (int begin; (begin = begun_.fetch_add(grain_)) < n_;) {
      const int end = begin + grain_ < n_ ? begin + grain_ : n_;
      const Part part{done_, end - begin};
      for (int i = begin; i < end; ++i) f(i);
    }
  }
  /// After help(): until other threads are done with what they began.
  void wait() const {
    while (done_.load(std::memory_order_acquire) < n_) std::this_thread::yield();
  }

 private:
  /// Is done with at its end, however it ends: nobody waits for what was thrown out of it.
  struct Part {
    std::atomic<int>& done;
    const int count;
    ~Part() { done.fetch_add(count, std::memory_order_release); }
  };
  const int n_, grain_;
  std::atomic<int> begun_{0}, done_{0};
};

}  // namespace tissue_sim
