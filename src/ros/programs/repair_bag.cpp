#include <cstdio>
#include <exception>

#include "ros/bag_repair.h"

// repair_bag FILE...: gives bags their index whose writer was killed or ran out of disk.
int main(int argc, char** argv) {
  if (argc < 2)
    std::fprintf(stderr, "repair_bag FILE...: bags, or .bag.active, without an index\n");
  int status = argc < 2 ? 1 : 0;
  for (int i = 1; i < argc; ++i) {
    try {
      const tissue_sim::BagRepair done = tissue_sim::repair_bag(argv[i]);
      if (done.chunks == 0) {
        std::printf("%s: has its index, is left as it is\n", argv[i]);
      } else {
        std::printf("%s: %llu messages, %llu bytes behind them are cut off\n", argv[i],
                    static_cast<unsigned long long>(done.messages),
                    static_cast<unsigned long long>(done.lost));
      }
    } catch (const std::exception& e) {
      std::fprintf(stderr, "%s\n", e.what());
      status = 1;
    }
  }
  return status;
}
