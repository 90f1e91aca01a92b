#include <gtest/gtest.h>
#include <rosbag/view.h>
#include <std_msgs/String.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "ros/recorder.h"
#include "ros/recording_path.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

constexpr double kMiB = 1024 * 1024;

class RecorderTest : public testing::Test {
 protected:
  void SetUp() override { ros::Time::init(); }

  // That no compression makes smaller.
  static std_msgs::String::ConstPtr text(std::size_t bytes) {
    auto m = boost::make_shared<std_msgs::String>();
    m->data.resize(bytes);
    std::mt19937 random(static_cast<unsigned>(bytes));
    for (char& c : m->data) c = static_cast<char>(random());
    return m;
  }

  const TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
};

TEST_F(RecorderTest, ABagIsNoLargerThanItsLimit) {
  for (const bool compresses : {false, true}) {
    Recorder recorder(folder_, 1000 * kMiB, 1 * kMiB, 2 * kMiB);
    const std::string path = recorder.start(compresses ? "a" : "b", {"/a", "/b", "/c"});
    for (int i = 0; i < 3000 && recorder.status().recording; ++i) {
      auto m = boost::make_shared<std_msgs::String>();
      m->data.assign(20000, 'a');
      const char* const topics[] = {"/a", "/b", "/c"};
      recorder.write<std_msgs::String>(topics[i % 3], compresses ? m : text(20000 + i),
                                       ros::Time(1 + i, 0));
      if (i % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    if (compresses) {
      recorder.stop();
    } else {
      EXPECT_THROW(recorder.stop(), std::runtime_error);
    }
    EXPECT_LE(fs::file_size(path), 2 * kMiB);
    EXPECT_GT(fs::file_size(path), compresses ? 0.1 * kMiB : 1.8 * kMiB);
    EXPECT_NO_THROW(rosbag::Bag(path, rosbag::bagmode::Read));
  }
}

TEST_F(RecorderTest, WritesWhatItIsGiven) {
  Recorder recorder(folder_, 100 * kMiB, 1 * kMiB);
  EXPECT_FALSE(recorder.wants("/a"));
  const std::string path = recorder.start("one", {"/a", "/b"});
  EXPECT_EQ(path, folder_ + "/one.bag");
  EXPECT_TRUE(recorder.wants("/a"));
  for (int i = 0; i < 100; ++i) {
    recorder.write("/a", text(1000 + i), ros::Time(1 + i, 0));
    recorder.write("/c", text(10), ros::Time(1 + i, 0));
  }
  const RecorderStatus s = recorder.stop();
  EXPECT_EQ(s.messages, 100u);
  EXPECT_TRUE(s.dropped.empty());
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  rosbag::View view(bag);
  int i = 0;
  for (const rosbag::MessageInstance& m : view) {
    EXPECT_EQ(m.getTopic(), "/a");
    EXPECT_EQ(m.getTime(), ros::Time(1 + i, 0));
    ASSERT_EQ(m.instantiate<std_msgs::String>()->data, text(1000 + i)->data);
    ++i;
  }
  EXPECT_EQ(i, 100);
}

TEST_F(RecorderTest, NeverOverwrites) {
  Recorder recorder(folder_, 100 * kMiB, 1 * kMiB);
  std::ofstream(folder_ + "/there.bag") << "precious";
  std::ofstream(folder_ + "/busy.bag.active") << "precious";
  EXPECT_THROW(recorder.start("there", {"/a"}), std::runtime_error);
  EXPECT_THROW(recorder.start("busy", {"/a"}), std::runtime_error);
  recorder.start("later", {"/a"});
  std::ofstream(folder_ + "/later.bag") << "precious";  // comes while it is recorded
  recorder.write("/a", text(100), ros::Time(1, 0));
  EXPECT_THROW(recorder.stop(), std::runtime_error);
  EXPECT_TRUE(fs::exists(folder_ + "/later.bag.active"));
  for (const char* name : {"there.bag", "busy.bag.active", "later.bag"}) {
    EXPECT_EQ(fs::file_size(folder_ + "/" + name), 8u);
  }
}

TEST_F(RecorderTest, SaysWhatAFullQueueLosesButKeepsWhatItMust) {
  Recorder recorder(folder_, 0.2 * kMiB, 1 * kMiB);
  const std::string path = recorder.start("slow", {"/cloud", "/inputs"});
  const auto cloud = text(190 * 1024), input = text(10);
  for (int i = 0; i < 200; ++i) {  // faster than any disk
    recorder.write("/cloud", cloud, ros::Time(1 + i, 0));
    recorder.write("/inputs", input, ros::Time(1 + i, 0), true);
  }
  const RecorderStatus s = recorder.stop();
  ASSERT_EQ(s.dropped.size(), 1u);
  const std::uint64_t lost = s.dropped.at("/cloud");
  EXPECT_GT(lost, 0u);
  EXPECT_EQ(s.messages, 400 - lost);
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  EXPECT_EQ(rosbag::View(bag, rosbag::TopicQuery("/inputs")).size(), 200u);
  EXPECT_EQ(rosbag::View(bag, rosbag::TopicQuery("/cloud")).size(), 200 - lost);
}

TEST_F(RecorderTest, EndsReadableWhenTheDiskIsFull) {
  // As much may be written as is free beyond the reserve: others on this disk may change that, so
  // this writes until it ends.
  const double reserve = free_space(folder_) - 60 * kMiB;
  ASSERT_GT(reserve, 0);
  Recorder recorder(folder_, 2000 * kMiB, reserve);
  const std::string path = recorder.start("full", {"/a"});
  const auto message = text(4 << 20);
  int sent = 0;
  while (recorder.status().recording && sent < 2000) {
    recorder.write("/a", message, ros::Time(1 + sent++, 0));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const RecorderStatus s = recorder.status();
  ASSERT_FALSE(s.recording);
  EXPECT_NE(s.error.find("disk is full"), std::string::npos) << s.error;
  EXPECT_FALSE(recorder.wants("/a"));
  EXPECT_THROW(recorder.stop(), std::runtime_error) << "it says why it ended";
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  EXPECT_EQ(rosbag::View(bag).size(), s.messages);
  EXPECT_GT(s.messages, 0u);
  fs::remove(path);
  recorder.start("next", {"/a"});  // and may begin again
  recorder.stop();
}

TEST_F(RecorderTest, RefusesToStartOnAFullDisk) {
  Recorder recorder(folder_, kMiB, 1e18);
  EXPECT_THROW(recorder.start("x", {"/a"}), std::runtime_error);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(RecorderTest, PathsStayInTheFolder) {
  for (const char* name : {"/etc/x", "../x", "a/../../x", "..", ".", "a/", "/", ".bag"}) {
    EXPECT_THROW(recording_path(folder_, name), std::runtime_error) << name;
  }
  fs::create_directory_symlink("/tmp", folder_ + "/out");
  fs::create_directory(folder_ + "/in");
  fs::create_directory_symlink("in", folder_ + "/also_in");
  EXPECT_THROW(recording_path(folder_, "out/x"), std::runtime_error);
  EXPECT_THROW(recording_path(folder_, "out/new/x"), std::runtime_error);
  EXPECT_FALSE(fs::exists("/tmp/new"));
  fs::create_symlink("/tmp/elsewhere", folder_ + "/dangling.bag.active");
  EXPECT_THROW(recording_path(folder_, "dangling"), std::runtime_error);
  EXPECT_EQ(recording_path(folder_, "also_in/x"), folder_ + "/in/x.bag");
  EXPECT_EQ(recording_path(folder_, "x"), folder_ + "/x.bag");
  EXPECT_EQ(recording_path(folder_, "x.bag"), folder_ + "/x.bag");
  EXPECT_EQ(recording_path(folder_, "new/deep/x.y"), folder_ + "/new/deep/x.y.bag");
  const std::string dated = recording_path(folder_, "");
  std::ofstream(dated) << "";
  EXPECT_NE(recording_path(folder_, ""), dated) << "two in the same second";
}

}  // namespace
}  // namespace tissue_sim
