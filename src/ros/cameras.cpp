#include "ros/cameras.h"

#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include <cmath>
#include <cstring>
#include <utility>

#include "ros/conversions.h"
#include "ros/guarded.h"
#include "ros/pose_track.h"
#include "ros/warn_seldom.h"
#include "tools/pose_fault.h"

namespace tissue_sim {
namespace {

std::string frame_of(const Camera& camera) {
  return camera.tf_frame.empty() ? camera.name + "_optical" : camera.tf_frame;
}

/// REP 104. `baseline` is 0 for the left eye and for what belongs to it.
boost::shared_ptr<sensor_msgs::CameraInfo> camera_info(const Camera& camera, double baseline,
                                                       bool is_raw,
                                                       const std_msgs::Header& header) {
  auto m = boost::make_shared<sensor_msgs::CameraInfo>();
  m->header = header;
  m->width = camera.width;
  m->height = camera.height;
  m->distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  m->D.assign(5, 0.0);
  if (is_raw && !camera.distortion.empty()) m->D = camera.distortion;
  const double f = camera.focal_length();
  const double x = 0.5 * (camera.width - 1), y = 0.5 * (camera.height - 1);
  m->K = {f, 0, x, 0, f, y, 0, 0, 1};
  m->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  m->P = {f, 0, x, -f * baseline, 0, f, y, 0, 0, 0, 1, 0};
  return m;
}

/// A pixel takes `bytes`, at `data`.
boost::shared_ptr<sensor_msgs::Image> image(const CameraImages& images, const std::string& encoding,
                                            std::size_t bytes, const void* data,
                                            const std_msgs::Header& header) {
  auto m = boost::make_shared<sensor_msgs::Image>();
  m->header = header;
  m->width = images.width;
  m->height = images.height;
  m->encoding = encoding;
  m->step = static_cast<std::uint32_t>(bytes * images.width);
  m->data.resize(static_cast<std::size_t>(m->step) * images.height);
  std::memcpy(m->data.data(), data, m->data.size());
  return m;
}

boost::shared_ptr<sensor_msgs::Image> depth_image(const CameraImages& images, DepthUnit unit,
                                                  const std_msgs::Header& header) {
  namespace enc = sensor_msgs::image_encodings;
  if (unit == DepthUnit::kMetres) {
    return image(images, enc::TYPE_32FC1, sizeof(float), images.depth.data(), header);
  }
  std::vector<std::uint16_t> depth(images.depth.size());
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const float z = 1000 * images.depth[i] + 0.5f;
    depth[i] = z < 65536 ? static_cast<std::uint16_t>(z) : 0;  // of NaN: 0
  }
  return image(images, enc::TYPE_16UC1, sizeof(std::uint16_t), depth.data(), header);
}

/// Organised as the image: x, y, z in the camera's optical frame, rgb, label. `rgb` is rectified.
boost::shared_ptr<sensor_msgs::PointCloud2> points(const Camera& camera, const CameraImages& images,
                                                   const std::vector<std::uint8_t>& rgb,
                                                   const std_msgs::Header& header) {
  auto m = boost::make_shared<sensor_msgs::PointCloud2>();
  m->header = header;
  m->width = images.width;
  m->height = images.height;
  const auto field = [&m](const char* name, std::uint32_t offset, std::uint8_t type) {
    sensor_msgs::PointField f;
    f.name = name;
    f.offset = offset;
    f.datatype = type;
    f.count = 1;
    m->fields.push_back(f);
  };
  field("x", 0, sensor_msgs::PointField::FLOAT32);
  field("y", 4, sensor_msgs::PointField::FLOAT32);
  field("z", 8, sensor_msgs::PointField::FLOAT32);
  field("rgb", 12, sensor_msgs::PointField::FLOAT32);
  field("label", 16, sensor_msgs::PointField::UINT32);
  constexpr std::size_t kStep = 20;
  m->point_step = kStep;
  m->row_step = static_cast<std::uint32_t>(kStep * images.width);
  m->is_dense = false;  // NaN where nothing is seen
  m->data.resize(static_cast<std::size_t>(m->row_step) * images.height);
  const double f = camera.focal_length();
  for (int y = 0, i = 0; y < images.height; ++y) {
    for (int x = 0; x < images.width; ++x, ++i) {
      const float z = images.depth[i];
      const auto u = static_cast<float>((x - 0.5 * (camera.width - 1)) / f);
      const auto v = static_cast<float>((y - 0.5 * (camera.height - 1)) / f);
      const float at[3] = {u * z, v * z, z};
      const std::uint32_t colour =
          static_cast<std::uint32_t>(rgb[3 * i]) << 16 | rgb[3 * i + 1] << 8 | rgb[3 * i + 2];
      const std::uint32_t label = images.labels[i];
      std::uint8_t* point = &m->data[kStep * i];
      std::memcpy(point, at, sizeof at);
      std::memcpy(point + 12, &colour, sizeof colour);
      std::memcpy(point + 16, &label, sizeof label);
    }
  }
  return m;
}

}  // namespace

Cameras::Cameras(ros::NodeHandle& node, const Scene& scene, const Parameters& parameters,
                 const Frames* frames, Recorder& recorder)
    : ground_(scene.ground),
      frames_(frames),
      recorder_(recorder),
      waits_(frames == nullptr || parameters.time == TimeMode::kLockstep ||
             (parameters.time == TimeMode::kWall && parameters.time_factor == 0)),
      transport_(node),
      renderer_(scene) {
  const auto output = [&](const std::string& name) -> ImageOutput {
    return {transport_.advertise(name, 2), node.resolveName(name)};
  };
  const auto camera_output = [&](const std::string& space, const char* name) -> CameraOutput {
    return {output(space + name), {node, space + "camera_info", 2, recorder}};
  };
  for (const Camera& camera : scene.cameras) {
    const std::string space = camera.name + "/";
    const std::size_t i = eyes_.size();
    eyes_.push_back({camera,
                     camera_output(space + "left/", "image_raw"),
                     camera_output(space + "depth/", "image_rect"),
                     {},
                     output(space + "labels"),
                     {},
                     {},
                     {node, space + "depth/points", 2, recorder},
                     Throttle(camera.rate, scene.frame_rate),
                     camera.pose});
    if (camera.baseline > 0) eyes_.back().right = camera_output(space + "right/", "image_raw");
    if (camera.flow) eyes_.back().flow = output(space + "flow");
    if (!camera.tf_frame.empty() || frames == nullptr) continue;
    subscribers_.push_back(listen<geometry_msgs::PoseStamped>(
        node, space + "measured_cp", 10,
        [this, i](const auto& event) { on_pose(i, *event.getConstMessage()); }));
  }
  thread_ = std::thread(&Cameras::run, this);
}

Cameras::~Cameras() {
  subscribers_.clear();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

std::set<std::string> Cameras::topics() const {
  std::set<std::string> names;
  for (const Eye& eye : eyes_) {
    names.insert({eye.left.topic, eye.left.info.topic(), eye.depth.topic, eye.depth.info.topic(),
                  eye.labels.topic, eye.points.topic()});
    if (eye.right) names.insert({eye.right->topic, eye.right->info.topic()});
    if (eye.flow) names.insert(eye.flow->topic);
  }
  return names;
}

bool Cameras::wanted(const ImageOutput& output) const {
  return output.images.getNumSubscribers() > 0 || recorder_.wants(output.topic);
}

bool Cameras::wanted(const CameraOutput& output) const {
  return wanted(static_cast<const ImageOutput&>(output)) || output.info.wanted();
}

bool Cameras::wanted(const Eye& eye) const {
  return wanted(eye.left) || wanted(eye.depth) || (eye.right && wanted(*eye.right)) ||
         wanted(eye.labels) || (eye.flow && wanted(*eye.flow)) || eye.points.wanted();
}

void Cameras::on_pose(std::size_t eye, const geometry_msgs::PoseStamped& message) {
  const char* name = eyes_[eye].camera.name.c_str();
  Pose pose = from_message(message.pose);
  if (const std::string wrong = problem_of(pose, kRounding); !wrong.empty()) {
    WARN_SELDOM(1, "camera %s: a pose %s", name, wrong.c_str());
    return;
  }
  pose.orientation.normalize();
  try {
    pose = frames_->in_world(message.header.frame_id, message.header.stamp) * pose;
  } catch (const tf2::TransformException& e) {
    WARN_SELDOM(1, "camera %s: %s", name, e.what());
    return;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  eyes_[eye].pose = pose;
}

void Cameras::publish(Simulation& simulation, const ros::Time& stamp, double time, bool all) {
  std::vector<Picture> pictures;
  for (std::size_t i = 0; i < eyes_.size(); ++i) {
    Eye& eye = eyes_[i];
    const bool due = eye.due.due(time) || all;
    if (!due || !wanted(eye)) continue;
    const Camera& camera = eye.camera;
    Pose pose;
    if (camera.tf_frame.empty() || frames_ == nullptr) {
      const std::lock_guard<std::mutex> lock(mutex_);
      pose = eye.pose;
    } else {
      try {
        ros::Time when;
        pose = frames_->newest(camera.tf_frame, when);
      } catch (const tf2::TransformException& e) {
        WARN_SELDOM(5, "camera %s: %s", camera.name.c_str(), e.what());
        continue;
      }
    }
    pictures.push_back({i, pose});
  }
  if (pictures.empty()) return;
  std::unique_lock<std::mutex> lock(mutex_);
  if (waits_) wake_.wait(lock, [this] { return !busy_ || stop_; });
  if (busy_ || stop_) return;
  read_view(simulation, view_);
  pictures_ = std::move(pictures);
  stamp_ = stamp;
  busy_ = true;
  lock.unlock();
  wake_.notify_all();
}

void Cameras::add_transforms(const std_msgs::Header& header, tf2_msgs::TFMessage& message) {
  for (const Eye& eye : eyes_) {
    if (!eye.camera.tf_frame.empty()) continue;
    geometry_msgs::TransformStamped t;
    t.header = header;
    t.child_frame_id = frame_of(eye.camera);
    const std::lock_guard<std::mutex> lock(mutex_);
    t.transform = to_transform(eye.pose);
    message.transforms.push_back(t);
  }
}

void Cameras::run() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return busy_ || stop_; });
    if (stop_) return;
    const std::vector<Picture> pictures = std::move(pictures_);
    const ros::Time stamp = stamp_;
    lock.unlock();
    guard("an image", [&] {
      renderer_.show(view_);
      for (const Picture& picture : pictures) draw(picture, stamp);
    });
    lock.lock();
    busy_ = false;
    wake_.notify_all();
  }
}

void Cameras::send(const ImageOutput& output, const boost::shared_ptr<sensor_msgs::Image>& image) {
  output.images.publish(image);
  recorder_.write(output.topic, boost::shared_ptr<const sensor_msgs::Image>(image),
                  image->header.stamp);
}

void Cameras::send(const CameraOutput& output, const Camera& camera, double baseline, bool is_raw,
                   const boost::shared_ptr<sensor_msgs::Image>& image) {
  send(output, image);
  output.info.send(true, image->header.stamp,
                   [&] { return camera_info(camera, baseline, is_raw, image->header); });
}

void Cameras::draw(const Picture& picture, const ros::Time& stamp) {
  Eye& eye = eyes_[picture.eye];
  const Camera& camera = eye.camera;
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = frame_of(camera);
  namespace enc = sensor_msgs::image_encodings;
  const bool has_flow = eye.flow && wanted(*eye.flow);
  if (!has_flow) eye.last = {};
  renderer_.render(camera, picture.pose, images_, has_flow ? &eye.last : nullptr);
  if (images_.inside_out > 0.5) {
    WARN_SELDOM(5, "camera %s is inside tissue: it sees the inside of its surface",
                camera.name.c_str());
  }
  if (ground_.enabled && picture.pose.position.z() < ground_.z) {
    WARN_SELDOM(5, "camera %s is below the ground: it sees its underside", camera.name.c_str());
  }
  send(eye.left, camera, 0, true, image(images_, enc::RGB8, 3, images_.rgb.data(), header));
  send(eye.depth, camera, 0, false, depth_image(images_, camera.depth, header));
  send(eye.labels, image(images_, enc::TYPE_16UC1, 2, images_.labels.data(), header));
  if (has_flow) {
    send(*eye.flow,
         image(images_, enc::TYPE_32FC2, 2 * sizeof(float), images_.flow.data(), header));
  }
  if (eye.points.wanted()) {
    CameraImages rectified;
    if (!camera.distortion.empty()) {  // colours where the depth is
      Camera pinhole = camera;
      pinhole.distortion.clear();
      renderer_.render(pinhole, picture.pose, rectified);
    }
    eye.points.publish(
        points(camera, images_, camera.distortion.empty() ? images_.rgb : rectified.rgb, header),
        stamp);
  }
  if (!eye.right || !wanted(*eye.right)) return;
  Pose pose = picture.pose;
  pose.position = picture.pose * Vec3(camera.baseline, 0, 0);
  renderer_.render(camera, pose, images_);
  send(*eye.right, camera, camera.baseline, true,
       image(images_, enc::RGB8, 3, images_.rgb.data(), header));
}

}  // namespace tissue_sim
