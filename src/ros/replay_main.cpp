// replay: runs a bag that the node recorded again and says whether the same came out.
//
//   rosrun tissue_sim replay BAG [--node NAME] [--device auto|cpu|cuda]
//   rosrun tissue_sim replay BAG --to NEW.bag       # needs a master, as replay.launch starts one
//
// Ends with 0 if every frame is the same, 1 if any differs, 2 if the bag cannot be run again.
#include <getopt.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>
#include <rosbag/view.h>

#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>

#include "ros/programs.h"
#include "ros/publications.h"
#include "ros/replay.h"
#include "scene/scene_text.h"

namespace tissue_sim {
namespace {

enum Result { kSame = 0, kDiffers = 1, kCannot = 2 };

const char kUsage[] =
    "replay BAG [options]\n"
    "  --node NAME    of the node that recorded it, where the bag holds several\n"
    "  --device NAME  auto, cpu or cuda in place of the scene's\n"
    "  --cameras FILE a scene file, whose cameras are drawn in place of the bag's\n"
    "  --to NEW.bag   records the new run, by the parameters of the node for clouds and rates\n"
    "  --publish      publishes the new run\n"
    "  --speed X      simulated time over wall time, 0 for as fast as it goes [0]\n"
    "  --folder PATH  that relative paths begin at\n";

struct Options {
  std::string bag, node, device, cameras, to, folder;
  bool publish = false;
  double speed = 0;
};

Options read_options(int argc, char** argv) {
  Options o;
  const option known[] = {{"node", 1, nullptr, 'n'},    {"device", 1, nullptr, 'd'},
                          {"cameras", 1, nullptr, 'c'}, {"to", 1, nullptr, 't'},
                          {"publish", 0, nullptr, 'p'}, {"speed", 1, nullptr, 's'},
                          {"folder", 1, nullptr, 'f'},  {nullptr, 0, nullptr, 0}};
  for (int c = 0; (c = getopt_long(argc, argv, "", known, nullptr)) != -1;) {
    if (c == 'n') o.node = optarg;
    if (c == 'd') o.device = optarg;
    if (c == 'c') o.cameras = optarg;
    if (c == 't') o.to = optarg;
    if (c == 'p') o.publish = true;
    if (c == 's') o.speed = std::stod(optarg);
    if (c == 'f') o.folder = optarg;
    if (c == '?') throw std::invalid_argument(std::string("usage: ") + kUsage);
  }
  if (optind + 1 != argc)
    throw std::invalid_argument(std::string("give one bag; usage: ") + kUsage);
  o.bag = argv[optind];
  if (!(o.speed >= 0 && o.speed <= 1000)) throw std::invalid_argument("speed must be 0 to 1000");
  const auto resolved = [&](const std::string& path) {
    if (path.empty()) return path;
    const std::filesystem::path start = o.folder.empty() ? "." : o.folder;
    return std::filesystem::absolute(start / path).lexically_normal().string();
  };
  o.bag = resolved(o.bag);
  o.to = resolved(o.to);
  o.cameras = resolved(o.cameras);
  return o;
}

/// The node's own publications and recorder, under the names that the bag has.
class Output {
 public:
  Output(const Options& options, const RecordedTopics& topics, const std::string& world)
      : topics_(topics), parameters_(read_parameters(ros::NodeHandle("~"))) {
    parameters_.world_frame = world;
    std::filesystem::path to(options.to);
    recorder_ =
        std::make_unique<Recorder>(to.parent_path().string(), parameters_.recording_queue * 1048576,
                                   parameters_.recording_reserve * 1048576);
    to_ = to.filename().string();
  }

  void begin(const Scene& scene, const ros::Time& stamp) {
    ros::NodeHandle node(topics_.node, remappings(scene));
    publications_.reset();
    publications_ = std::make_unique<Publications>(node, scene, parameters_, *recorder_);
    if (!to_.empty() && !recorder_->status().recording) {
      recorder_->start(to_, publications_->topics());
    }
    publications_->announce(stamp);
  }
  void frame(Simulation& simulation, const FrameReport& report, const RunState& run,
             const ros::Time& stamp) {
    publications_->publish(simulation, report, run, {stamp, simulation.time()}, false);
  }
  void restored(const Simulation& simulation, const std::vector<std::uint8_t>& state,
                const ros::Time& stamp) {
    publications_->record_state(simulation, state, stamp);
  }
  /// What there is to say of the new bag.
  std::string close() {
    if (to_.empty()) return "";
    const RecorderStatus s = recorder_->stop();
    return s.path + ": " + std::to_string(s.messages) + " messages";
  }

 private:
  // Instruments' topics often lie elsewhere: see launch/simulator.launch.
  ros::M_string remappings(const Scene& scene) const {
    ros::M_string map;
    for (const Tool& tool : scene.tools) {
      for (const char* side : {"/body/measured_cf", "/spatial/measured_cf"}) {
        const std::string name = "/" + tool.name + side;
        for (const std::string& topic : topics_.all) {
          const bool ends = topic.size() >= name.size() &&
                            topic.compare(topic.size() - name.size(), name.size(), name) == 0;
          if (ends) map[topics_.node + name] = topic;
        }
      }
    }
    return map;
  }

  const RecordedTopics topics_;
  Parameters parameters_;
  std::unique_ptr<Recorder> recorder_;
  std::string to_;
  std::unique_ptr<Publications> publications_;
};

std::string world_of(const rosbag::Bag& bag, const RecordedTopics& topics) {
  rosbag::View inputs(bag, rosbag::TopicQuery(topics.inputs));
  const auto first = inputs.begin();
  if (first == inputs.end()) return "world";
  const auto input = first->instantiate<FrameInputMessage>();
  return input ? input->header.frame_id : "world";
}

/// A device without its number of threads, of which no bit depends.
std::string machine_of(const std::string& device) {
  return device.substr(0, device.find_first_of(",;"));
}

void report_on(const ReplayReport& r, double seconds) {
  std::printf("%" PRId64 " frames of %d runs in %.1f s, %" PRId64 " states compared, %" PRId64
              " of them by checksum\n",
              r.frames, r.runs, seconds, r.compared, r.checksums);
  if (r.left_out > 0) {
    std::printf("%" PRId64 " frames left out: the beginning of their run is not in the bag\n",
                r.left_out);
  }
  if (!r.first.empty()) {
    std::printf("first difference: %s\n%" PRId64 " frames differ\n", r.first.c_str(), r.differing);
    if (machine_of(r.recorded_on) != machine_of(r.run_on)) {
      std::printf("recorded on %s, run on %s: the bits of one are not those of the other\n",
                  r.recorded_on.c_str(), r.run_on.c_str());
    }
  }
}

std::optional<Device> device_of(const std::string& name) {
  if (name.empty()) return std::nullopt;
  for (const Spelling<Device>& s : kDeviceNames) {
    if (s.name == name) return s.value;
  }
  throw std::invalid_argument("device is '" + name + "': must be auto, cpu or cuda");
}

int replay(const Options& options) {
  const std::optional<Device> device = device_of(options.device);
  rosbag::Bag bag;
  bag.open(options.bag, rosbag::bagmode::Read);
  const RecordedTopics topics = recorded_topics(bag, options.node);
  std::optional<Output> output;
  std::optional<ros::AsyncSpinner> spinner;
  if (options.publish || !options.to.empty()) {
    if (!ros::master::check()) {
      throw std::runtime_error(
          "there is no ROS master, which --to and --publish need: use "
          "'roslaunch tissue_sim replay.launch' or start roscore");
    }
    output.emplace(options, topics, world_of(bag, topics));
    spinner.emplace(1);
    spinner->start();
  }

  std::optional<std::vector<Camera>> cameras;
  if (!options.cameras.empty()) cameras = load_scene(options.cameras).cameras;

  const WallTime start = WallClock::now();
  WallTime said = start;
  std::int64_t frames = 0;
  double simulated = 0;
  ReplayObserver observer;
  observer.goes_on = [] { return !ros::isShuttingDown(); };
  observer.begin = [&](const Scene& scene, const ros::Time& stamp) {
    if (output) output->begin(scene, stamp);
  };
  observer.restored = [&](const Simulation& simulation, const std::vector<std::uint8_t>& state,
                          const ros::Time& stamp) {
    if (output) output->restored(simulation, state, stamp);
  };
  observer.frame = [&](Simulation& simulation, const FrameReport& report, const RunState& run,
                       const ros::Time& stamp) {
    if (output) output->frame(simulation, report, run, stamp);
    ++frames;
    simulated += 1 / simulation.scene().frame_rate;
    if (options.speed > 0) {
      std::this_thread::sleep_until(start +
                                    std::chrono::duration_cast<WallClock::duration>(
                                        std::chrono::duration<double>(simulated / options.speed)));
    }
    if (WallClock::now() - said < std::chrono::seconds(2)) return;
    said = WallClock::now();
    std::fprintf(stderr, "%" PRId64 " frames done\n", frames);
  };
  Replay run(observer, [&](Scene& scene) {
    if (device) scene.device = *device;
    if (cameras) scene.cameras = *cameras;
  });
  const ReplayReport report = run.run(bag, topics);
  report_on(report, seconds(WallClock::now()) - seconds(start));
  if (output) {
    const std::string said_of = output->close();
    if (!said_of.empty()) std::printf("recorded %s\n", said_of.c_str());
  }
  if (ros::isShuttingDown()) throw std::runtime_error("stopped before the bag's end");
  if (report.compared == 0) {
    throw std::runtime_error(
        "the bag holds no state of the frames that were run: nothing compared");
  }
  if (report.first.empty()) std::printf("the same\n");
  return report.first.empty() ? kSame : kDiffers;
}

}  // namespace

int replay(int argc, char** argv) {
  ros::init(argc, argv, "replay", ros::init_options::AnonymousName);
  ros::Time::init();
  std::string bag;
  try {
    const Options options = read_options(argc, argv);
    bag = options.bag;
    return replay(options);
  } catch (const rosbag::BagException& e) {
    std::fflush(stdout);
    std::fprintf(stderr,
                 "cannot replay: %s. Where the bag was not closed, or is cut short, 'rosrun "
                 "tissue_sim repair_bag %s' makes what is whole of it readable\n",
                 e.what(), bag.c_str());
    return kCannot;
  } catch (const std::exception& e) {
    std::fflush(stdout);
    std::fprintf(stderr, "cannot replay: %s\n", e.what());
    return kCannot;
  }
}

}  // namespace tissue_sim
