// tissue_sim_dataset: runs scenes that tear and writes what the fragment network learns from.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <stdexcept>
#include <string>

#include "fragments/features.h"
#include "programs/dataset/dataset_run.h"
#include "programs/dataset/npy.h"
#include "programs/dataset/outcome.h"

namespace tissue_sim {
namespace {

constexpr char kUsage[] =
    R"(usage: tissue_sim_dataset --out FOLDER [options]
  --scenes N       how many (60)
  --first N        number of the first (0)
  --seed N         of all that is drawn (1)
  --kinds A,B      of tension, fall, compression, cut, blow, anchored, in turn (all)
  --level N        how many times finer truths are (3)
  --frames N       of each run, 1/960 s each (40)
  --horizon N      frames ahead that labels are for (8)
  --per-frame N    samples of a frame at most (100)
  --truths N       how many, 0.95 to 1.05 times that fine (1)
  --converge N     no data: runs each scene with cells 1, 2 .. N times finer, and writes how each
                   comes out into FOLDER/convergence.csv
  --compare FILE   no data: runs each scene plain, with the network, with cells half as large and
                   as the truth, and writes how each comes out into FOLDER/comparison.csv. FILE
                   is the network's
  --baselines FILE of threshold and logistic regression for that
Scenes that are in FOLDER are left alone: the same command goes on with what is missing.
One process does one scene after another: scripts/sweep shares them out over processes and machines.
)";

struct Arguments {
  std::string out;
  ComparedRuns compared;
  std::vector<std::string> kinds = dataset_kinds();
  int scenes = 60, first = 0, converge = 0;
  std::uint64_t seed = 1;
  DatasetOptions options;
};

Arguments read_arguments(int argc, char** argv) {
  Arguments a;
  for (int i = 1; i < argc; ++i) {
    const std::string name = argv[i];
    if (name == "--help") {
      std::fputs(kUsage, stdout);
      std::exit(0);
    }
    if (i + 1 == argc) throw std::invalid_argument(name + " needs a value");
    const std::string value = argv[++i];
    const auto number = [&](int least) {
      std::size_t used = 0;
      int n = 0;
      try {
        n = std::stoi(value, &used);
      } catch (const std::exception&) {
        used = 0;
      }
      if (used != value.size() || n < least) {
        throw std::invalid_argument(name + " is " + value + ": it must be a whole number from " +
                                    std::to_string(least) + " on");
      }
      return n;
    };
    if (name == "--out") {
      a.out = value;
    } else if (name == "--scenes") {
      a.scenes = number(1);
    } else if (name == "--first") {
      a.first = number(0);
    } else if (name == "--seed") {
      a.seed = number(0);
    } else if (name == "--level") {
      a.options.level = number(1);
    } else if (name == "--frames") {
      a.options.frames = number(2);
    } else if (name == "--horizon") {
      a.options.horizon = number(1);
    } else if (name == "--per-frame") {
      a.options.per_frame = number(1);
    } else if (name == "--truths") {
      a.options.truths = number(1);
    } else if (name == "--converge") {
      a.converge = number(2);
    } else if (name == "--compare") {
      a.compared.network = std::filesystem::absolute(value);
    } else if (name == "--baselines") {
      a.compared.baselines = value;
    } else if (name == "--kinds") {
      a.kinds.clear();
      std::istringstream list(value);
      for (std::string kind; std::getline(list, kind, ',');) {
        a.kinds.push_back(kind);
        make_dataset_scene(0, 0, {kind});  // throws for one that there is not
      }
      if (a.kinds.empty()) throw std::invalid_argument("--kinds names none");
    } else {
      throw std::invalid_argument("there is no option " + name);
    }
  }
  if (a.out.empty()) throw std::invalid_argument("--out is missing: a folder for the data");
  a.compared.level = a.options.level;
  return a;
}

std::string path_of(const Arguments& a, int index, const std::string& what) {
  char number[16];
  std::snprintf(number, sizeof number, "%06d", index);
  return a.out + "/" + number + what;
}

/// What is known of a scene, as JSON without its end: held-out scenes are chosen by it.
std::string describe(const DatasetScene& d, const DatasetOptions& options) {
  const Scene& s = d.scene;
  const Material& m = s.materials[0];
  const char* shapes[] = {"box", "ball", "ellipsoid", "cylinder", "mesh"};
  std::ostringstream out;
  out.precision(9);
  out << "{\"index\": " << d.index << ", \"kind\": \"" << d.kind << "\", \"shape\": \""
      << shapes[static_cast<int>(s.bodies[0].shape)] << "\", \"cell_size\": " << s.cell_size
      << ", \"young_modulus\": " << m.young_modulus << ", \"poisson_ratio\": " << m.poisson_ratio
      << ", \"viscosity\": " << m.viscosity << ", \"tear_stretch\": " << m.tear_stretch
      << ", \"tear_length\": " << m.tear_length << ", \"speed\": " << d.speed
      << ", \"horizon\": " << options.horizon / s.frame_rate;
  return out.str();
}

void write_scene(const Arguments& a, int index) {
  const std::string path = path_of(a, index, ".json"), unfinished = path + ".part";
  if (std::filesystem::exists(path)) return;
  const auto begin = std::chrono::steady_clock::now();
  const DatasetScene scene = make_dataset_scene(a.seed, index, a.kinds);
  const DatasetSamples samples = run_dataset_scene(scene, a.options);
  write_npy(path_of(a, index, "_x.npy"), samples.x, kPartingFeatureCount);
  write_npy(path_of(a, index, "_torn.npy"), samples.torn, 1 + a.options.truths);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  // Last, and whole at once: where it is, the others are.
  std::ofstream(unfinished) << describe(scene, a.options) << ", \"crushed\": " << samples.crushed
                            << ", \"seconds\": " << took.count() << "}\n";
  std::filesystem::rename(unfinished, path);
  std::printf("scene %d of %d, %s: %zu samples, %d truths crushed, %.1f s\n", index - a.first + 1,
              a.scenes, scene.kind.c_str(), samples.x.size() / kPartingFeatureCount,
              samples.crushed, took.count());
  std::fflush(stdout);
}

/// How all runs of a scene come out; those that are there are left alone.
void write_outcomes(const Arguments& a, int index, const std::vector<RunKind>& kinds) {
  const std::string path = path_of(a, index, ".csv"), unfinished = path + ".part";
  if (std::filesystem::exists(path)) return;
  const DatasetScene scene = make_dataset_scene(a.seed, index, a.kinds);
  std::string lines;
  for (const RunKind& kind : kinds) {
    const Outcome o = run_outcome(scene, kind, a.options.frames);
    lines += outcome_line(scene, kind, o);
    if (a.converge == 0) write_npy(path_of(a, index, "_" + kind.name + ".npy"), o.cloud, 4);
  }
  std::ofstream(unfinished) << lines;
  std::filesystem::rename(unfinished, path);
  std::fputs(lines.c_str(), stdout);
  std::fflush(stdout);
}

/// Calls work(index) for each scene. Returns how many failed.
int for_each_scene(const Arguments& a, const std::function<void(int)>& work) {
  int failed = 0;
  for (int scene = a.first; scene < a.first + a.scenes; ++scene) {
    try {
      work(scene);
    } catch (const std::exception& e) {
      std::fprintf(stderr, "scene %d: %s\n", scene, e.what());
      ++failed;
    }
  }
  return failed;
}

int run(int argc, char** argv) {
  const Arguments a = read_arguments(argc, argv);
  std::filesystem::create_directories(a.out);
  std::vector<RunKind> kinds;
  if (!a.compared.network.empty()) {
    kinds = compared_runs(a.compared);
  } else if (a.converge > 0) {
    for (int level = 1; level <= a.converge; ++level)
      kinds.push_back({"level", static_cast<double>(level), "", {}});
  } else {
    return for_each_scene(a, [&](int index) { write_scene(a, index); });
  }
  const int failed = for_each_scene(a, [&](int index) { write_outcomes(a, index, kinds); });
  const std::string table = a.out + (a.converge > 0 ? "/convergence.csv" : "/comparison.csv"),
                    unfinished = table + "." + std::to_string(a.first) + ".part";
  std::ofstream all(unfinished);
  all << kOutcomeColumns;
  for (int i = a.first; i < a.first + a.scenes; ++i) {
    std::ifstream part(path_of(a, i, ".csv"));
    if (part.peek() != EOF) all << part.rdbuf();
  }
  all.close();
  std::filesystem::rename(unfinished, table);
  return failed;
}

}  // namespace
}  // namespace tissue_sim

int main(int argc, char** argv) {
  try {
    return tissue_sim::run(argc, argv) == 0 ? 0 : 1;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "tissue_sim_dataset: %s (--help tells the options)\n", e.what());
    return 2;
  }
}
