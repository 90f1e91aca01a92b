// What cameras publish: images, depth, labels, points and their geometry, in step.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <rosgraph_msgs/Log.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>
#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <cstring>

#include "simulator_client.h"
#include "tissue_sim/camera.h"

namespace tissue_sim {
namespace {

using sensor_msgs::CameraInfo;
using sensor_msgs::Image;

float depth_at(const Image& image, int x, int y) {
  float depth;
  std::memcpy(&depth, &image.data[y * image.step + 4 * x], 4);
  return depth;
}

int millimetres_at(const Image& image, int x, int y) {
  std::uint16_t depth;
  std::memcpy(&depth, &image.data[y * image.step + 2 * x], 2);
  return depth;
}

int label_at(const Image& image, int x, int y) {
  std::uint16_t label;
  std::memcpy(&label, &image.data[y * image.step + 2 * x], 2);
  return label;
}

class Camera : public testing::Test {
 protected:
  /// The message of the frame that is stepped now.
  template <class M>
  static boost::shared_ptr<const M> of_next_frame(const Topic<M>& topic) {
    if (!wait_until([&] { return topic.connected(); })) return nullptr;
    ros::WallDuration(0.2).sleep();  // until the node knows, too
    const std::size_t before = topic.count();
    if (!step(1).success) return nullptr;
    if (!wait_until([&] { return topic.count() > before; })) return nullptr;
    return topic.all().back();
  }
};

TEST_F(Camera, ImagesOfAFrameBelongTogether) {
  Topic<Image> left("/simulator/endoscope/left/image_raw"),
      right("/simulator/endoscope/right/image_raw"), labels("/simulator/endoscope/labels");
  Topic<CameraInfo> info("/simulator/endoscope/left/camera_info"),
      right_info("/simulator/endoscope/right/camera_info");
  Topic<sensor_msgs::PointCloud2> points("/simulator/endoscope/depth/points");
  Topic<Image> depth("/simulator/endoscope/depth/image_rect");
  const auto all_came = [&](std::size_t count) {
    return left.count() > count && right.count() > count && labels.count() > count &&
           info.count() > count && right_info.count() > count && points.count() > count &&
           depth.count() > count;
  };
  ASSERT_TRUE(wait_until([&] { return step(1).success && all_came(0); }));  // the node knows of all
  const std::size_t before = depth.count();
  const auto d = of_next_frame(depth);
  ASSERT_TRUE(d);
  ASSERT_GT(depth.count(), before);
  ASSERT_TRUE(wait_until([&] {
    return left.all().back()->header.stamp == d->header.stamp &&
           right.all().back()->header.stamp == d->header.stamp &&
           labels.all().back()->header.stamp == d->header.stamp &&
           info.all().back()->header.stamp == d->header.stamp &&
           points.all().back()->header.stamp == d->header.stamp;
  }));
  EXPECT_EQ(d->header.frame_id, "endoscope_optical");
  EXPECT_EQ(d->encoding, "32FC1");
  EXPECT_EQ(left.last()->encoding, "rgb8");
  EXPECT_EQ(labels.last()->encoding, "16UC1");
  EXPECT_NEAR(depth_at(*d, 80, 60), 0.10, 2e-3);  // the slab's top
  EXPECT_NEAR(depth_at(*d, 0, 0), 0.12, 1e-5);    // the ground
  EXPECT_EQ(label_at(*labels.last(), 80, 60), kFirstFragmentLabel);
  EXPECT_EQ(label_at(*labels.last(), 0, 0), kGroundLabel);
  const double f = info.last()->P[0];
  EXPECT_NEAR(f, 80 / std::tan(M_PI / 6), 1e-9);
  EXPECT_NEAR(right_info.last()->P[3], -0.005 * f, 1e-9);
  // Points are what depth_image_proc makes of the depth.
  const auto cloud = points.last();
  ASSERT_EQ(cloud->width * cloud->height, 160u * 120u);
  sensor_msgs::PointCloud2ConstIterator<float> x(*cloud, "x"), z(*cloud, "z");
  for (int v = 0; v < 120; ++v) {
    for (int u = 0; u < 160; ++u, ++x, ++z) {
      EXPECT_EQ(*z, depth_at(*d, u, v));
      EXPECT_NEAR(*x, (u - info.last()->P[2]) / f * *z, 1e-6);
    }
  }
}

TEST_F(Camera, FollowsItsTopic) {
  ros::NodeHandle node;
  ros::Publisher pose =
      node.advertise<geometry_msgs::PoseStamped>("/simulator/endoscope/measured_cp", 1, true);
  Topic<Image> depth("/simulator/endoscope/depth/image_rect");
  ASSERT_TRUE(wait_until([&] { return pose.getNumSubscribers() > 0; }));
  geometry_msgs::PoseStamped m;
  m.pose.position.z = 0.15;
  m.pose.orientation.x = 1;
  pose.publish(m);
  EXPECT_TRUE(wait_until([&] {
    const auto d = of_next_frame(depth);
    return d && std::fabs(depth_at(*d, 0, 0) - 0.15) < 1e-5;
  }));
  m.pose.position.x = NAN;  // is left out
  pose.publish(m);
  const auto d = of_next_frame(depth);
  ASSERT_TRUE(d);
  EXPECT_NEAR(depth_at(*d, 0, 0), 0.15, 1e-5);
}

TEST_F(Camera, WithinTissueAndBelowTheGroundIsSaid) {
  ros::NodeHandle node;
  ros::Publisher pose =
      node.advertise<geometry_msgs::PoseStamped>("/simulator/endoscope/measured_cp", 1, true);
  Topic<rosgraph_msgs::Log> log("/rosout");
  Topic<Image> depth("/simulator/endoscope/depth/image_rect");
  ASSERT_TRUE(wait_until([&] { return pose.getNumSubscribers() > 0; }));
  const auto says = [&](double z, const std::string& what) {
    geometry_msgs::PoseStamped m;
    m.pose.position.z = z;
    m.pose.orientation.x = 1;
    pose.publish(m);
    return wait_until([&] {
      of_next_frame(depth);
      for (const auto& line : log.all()) {
        if (line->msg.find(what) != std::string::npos) return true;
      }
      return false;
    });
  };
  EXPECT_TRUE(says(0.01, "endoscope is inside tissue"));
  EXPECT_TRUE(says(-0.05, "endoscope is below the ground"));
}

/// The ground seen from straight above: what a camera that moves sideways sees moves back.
TEST_F(Camera, FlowIsSinceTheLastImage) {
  ros::NodeHandle node;
  ros::Publisher pose =
      node.advertise<geometry_msgs::PoseStamped>("/simulator/endoscope/measured_cp", 1, true);
  Topic<Image> flow("/simulator/endoscope/flow"), depth("/simulator/endoscope/depth/image_rect");
  Topic<CameraInfo> info("/simulator/endoscope/left/camera_info");
  ASSERT_TRUE(wait_until([&] { return pose.getNumSubscribers() > 0; }));
  geometry_msgs::PoseStamped m;
  m.pose.orientation.x = 1;
  const auto seen_from = [&](double x) {  // the first image from there
    m.pose.position.x = x;
    m.pose.position.z = 0.12;
    pose.publish(m);
    boost::shared_ptr<const Image> image;
    wait_until([&] {
      image = of_next_frame(flow);
      float moved = NAN;
      if (image) std::memcpy(&moved, image->data.data(), 4);
      return std::fabs(moved) > 0.01;
    });
    return image;
  };
  seen_from(0.01);
  const auto image = seen_from(0.004);
  ASSERT_TRUE(image);
  EXPECT_EQ(image->encoding, "32FC2");
  float moved[2];
  std::memcpy(moved, image->data.data(), 8);
  ASSERT_TRUE(info.last());
  EXPECT_NEAR(moved[0], info.last()->P[0] * 0.006 / 0.12, 0.01);
  EXPECT_NEAR(moved[1], 0, 0.01);
}

TEST_F(Camera, FollowsATfFrame) {
  ros::NodeHandle node;
  ros::Publisher tf = node.advertise<tf2_msgs::TFMessage>("/tf", 1);
  Topic<Image> depth("/simulator/side/depth/image_rect");
  Topic<CameraInfo> raw("/simulator/side/left/camera_info"),
      rect("/simulator/side/depth/camera_info");
  ASSERT_TRUE(wait_until([&] { return tf.getNumSubscribers() > 0; }));
  tf2_msgs::TFMessage m;
  m.transforms.resize(1);
  m.transforms[0].header.frame_id = "world";
  m.transforms[0].child_frame_id = "side_camera";
  m.transforms[0].transform.translation.z = 0.2;
  m.transforms[0].transform.rotation.x = 1;
  EXPECT_TRUE(wait_until([&] {
    m.transforms[0].header.stamp = ros::Time::now();
    tf.publish(m);
    ros::WallDuration(0.1).sleep();
    if (!step(1).success || depth.count() == 0) return false;
    return millimetres_at(*depth.all().back(), 0, 0) == 200;
  }));
  EXPECT_EQ(depth.last()->encoding, "16UC1");
  ASSERT_TRUE(raw.last());
  ASSERT_TRUE(rect.last());
  EXPECT_EQ(depth.last()->header.frame_id, "side_camera");
  EXPECT_EQ(raw.last()->D[0], -0.2);
  EXPECT_EQ(rect.last()->D[0], 0);
}

}  // namespace
}  // namespace tissue_sim

TISSUE_SIM_TEST_NODE("camera_test")
