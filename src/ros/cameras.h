// Cameras: images of a scene's cameras, drawn in a thread of their own.
#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <image_transport/image_transport.h>
#include <ros/node_handle.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include <condition_variable>
#include <deque>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "ros/frames.h"
#include "ros/output.h"
#include "ros/pace.h"
#include "ros/parameters.h"
#include "tissue_sim/renderer.h"

namespace tissue_sim {

/// Nothing is drawn that nobody listens to or records.
class Cameras {
 public:
  /// Listens to `<camera>/measured_cp` of each camera that follows no tf frame; without `frames`
  /// all stay at the scene's poses. Throws std::runtime_error where this build cannot draw.
  Cameras(ros::NodeHandle& node, const Scene& scene, const Parameters& parameters,
          const Frames* frames, Recorder& recorder);
  ~Cameras();

  /// Names of the topics as they are in bags.
  std::set<std::string> topics() const;
  /// A frame is done at `time` [s], by the clock that rates are of: what is due of it is drawn.
  /// While the last images are still being drawn it is passed over, but where nothing keeps to the
  /// wall clock it waits for them. `all`: also what is not due yet.
  void publish(Simulation& simulation, const ros::Time& stamp, double time, bool all);
  /// The cameras' frames, but for those that follow one, for /tf.
  void add_transforms(const std_msgs::Header& header, tf2_msgs::TFMessage& message);

 private:
  struct ImageOutput {
    image_transport::Publisher images;
    std::string topic;
  };
  struct CameraOutput : ImageOutput {
    Output<sensor_msgs::CameraInfo> info;
  };
  struct Eye {
    Camera camera;
    CameraOutput left, depth;
    std::optional<CameraOutput> right;  // where there is a baseline
    ImageOutput labels;
    std::optional<ImageOutput> flow;
    LastLook last;  // of the thread, for the flow
    Output<sensor_msgs::PointCloud2> points;
    Throttle due;
    Pose pose;  // under mutex_
  };
  struct Picture {
    std::size_t eye;
    Pose pose;
  };

  bool wanted(const ImageOutput& output) const;
  bool wanted(const CameraOutput& output) const;
  bool wanted(const Eye& eye) const;
  void on_pose(std::size_t eye, const geometry_msgs::PoseStamped& message);
  void run();  // the thread
  void draw(const Picture& picture, const ros::Time& stamp);
  void send(const ImageOutput& output, const boost::shared_ptr<sensor_msgs::Image>& image);
  void send(const CameraOutput& output, const Camera& camera, double baseline, bool is_raw,
            const boost::shared_ptr<sensor_msgs::Image>& image);

  const Ground ground_;
  const Frames* frames_;
  Recorder& recorder_;
  const bool waits_;
  image_transport::ImageTransport transport_;
  std::deque<Eye> eyes_;
  Renderer renderer_;  // of the thread, as what follows
  CameraImages images_;

  std::mutex mutex_;  // of what follows
  std::condition_variable wake_;
  SceneView view_;  // the thread's while it is busy
  std::vector<Picture> pictures_;
  ros::Time stamp_;
  bool busy_ = false, stop_ = false;

  std::vector<ros::Subscriber> subscribers_;
  std::thread thread_;  // last
};

}  // namespace tissue_sim
