// Bags that nobody closed: whatever was in whole chunks is read again, by rosbag itself.
#include <gtest/gtest.h>
#include <rosbag/view.h>
#include <signal.h>
#include <std_msgs/String.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <thread>

#include "ros/bag_repair.h"
#include "ros/recorder.h"
#include "support/temporary_folder.h"

namespace tissue_sim {
namespace {

namespace fs = std::filesystem;

constexpr double kMiB = 1024 * 1024;

class BagRepairTest : public testing::Test {
 protected:
  void SetUp() override { ros::Time::init(); }

  static std_msgs::String::ConstPtr text(std::size_t bytes, unsigned seed) {
    auto m = boost::make_shared<std_msgs::String>();
    m->data.resize(bytes);
    std::mt19937 random(seed);
    for (char& c : m->data) c = static_cast<char>(random());
    return m;
  }
  /// Numbers of the messages of /a in the bag, which text() wrote with their number as the seed.
  static std::vector<int> read(const std::string& path) {
    rosbag::Bag bag(path, rosbag::bagmode::Read);
    std::vector<int> numbers;
    for (const rosbag::MessageInstance& m : rosbag::View(bag, rosbag::TopicQuery("/a"))) {
      const int number = static_cast<int>(m.getTime().sec) - 1;
      EXPECT_EQ(m.instantiate<std_msgs::String>()->data, text(2000, number)->data) << number;
      numbers.push_back(number);
    }
    return numbers;
  }

  const TemporaryFolder temporary_;
  const std::string folder_ = temporary_.path();
};

TEST_F(BagRepairTest, ABagCutOffAnywhereKeepsItsWholeChunks) {
  const std::string whole = folder_ + "/whole.bag", cut = folder_ + "/cut.bag";
  constexpr int kCount = 600;
  {
    rosbag::Bag bag(whole, rosbag::bagmode::Write);
    bag.setCompression(rosbag::compression::LZ4);
    bag.setChunkThreshold(100000);
    for (int i = 0; i < kCount; ++i) {
      bag.write("/a", ros::Time(1 + i, 0), text(2000, i));
      bag.write("/b", ros::Time(1 + i, 5), text(10, i));
    }
  }
  EXPECT_EQ(repair_bag(whole).chunks, 0u) << "it has its index";
  ASSERT_EQ(read(whole).size(), static_cast<std::size_t>(kCount));
  const auto size = fs::file_size(whole);
  std::size_t before = 0;
  for (int k = 2; k <= 20; ++k) {
    fs::copy_file(whole, cut, fs::copy_options::overwrite_existing);
    {  // as a file that was never closed: its index is not known yet
      std::fstream file(cut, std::ios::in | std::ios::out | std::ios::binary);
      std::string start(4096, '\0');
      file.read(&start[0], 4096);
      const std::size_t at = start.find("index_pos=");
      ASSERT_NE(at, std::string::npos);
      file.seekp(static_cast<std::streamoff>(at) + 10);
      file.write("\0\0\0\0\0\0\0\0", 8);
    }
    fs::resize_file(cut, size * k / 20);
    const BagRepair done = repair_bag(cut);
    const std::vector<int> numbers = read(cut);
    EXPECT_GE(numbers.size(), before);
    EXPECT_GE(static_cast<double>(numbers.size()), kCount * (k / 20.0) - 120);
    for (std::size_t i = 0; i < numbers.size(); ++i) ASSERT_EQ(numbers[i], static_cast<int>(i));
    rosbag::Bag bag(cut, rosbag::bagmode::Read);
    EXPECT_EQ(rosbag::View(bag).size(), done.messages);
    before = numbers.size();
  }
  EXPECT_EQ(before, static_cast<std::size_t>(kCount));
}

TEST_F(BagRepairTest, WhatIsNoBagIsRefused) {
  std::ofstream(folder_ + "/a") << "no bag";
  std::ofstream(folder_ + "/b") << "#ROSBAG V2.0\n" << std::string(5000, '\xff');
  for (const char* name : {"/a", "/b", "/none"}) {
    EXPECT_THROW(repair_bag(folder_ + name), std::runtime_error) << name;
  }
}

// A process that writes 100 messages a second and then, in the middle of it, is no more.
TEST_F(BagRepairTest, AKilledRecorderLosesHalfASecondAtMost) {
  constexpr int kRuns = 5;
  for (int run = 0; run < kRuns; ++run) {
    const std::string name = "killed" + std::to_string(run);
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      Recorder recorder(folder_, 100 * kMiB, 1 * kMiB);
      recorder.start(name, {"/a"});
      for (int i = 0; i < 2000; ++i) {
        recorder.write("/a", text(2000, i), ros::Time(1 + i, 0));
        std::ofstream(folder_ + "/count") << i;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
      }
      _exit(0);
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1300 + 137 * run));
    kill(child, SIGKILL);
    int status;
    waitpid(child, &status, 0);
    int written = 0;
    std::ifstream(folder_ + "/count") >> written;
    const std::string bag = folder_ + "/" + name + ".bag.active";
    repair_bag(bag);
    const std::vector<int> numbers = read(bag);
    for (std::size_t i = 0; i < numbers.size(); ++i) ASSERT_EQ(numbers[i], static_cast<int>(i));
    EXPECT_GT(numbers.size(), 0u);
    EXPECT_LE(written - static_cast<int>(numbers.size()), 60) << "0.5 s, at 100 Hz at most";
  }
}

// The disk is full in the middle of a chunk: here a file that may not grow.
TEST_F(BagRepairTest, WhatADiskTakesStaysReadable) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    signal(SIGXFSZ, SIG_IGN);
    const rlimit most = {3000000, 3000000};
    setrlimit(RLIMIT_FSIZE, &most);
    Recorder recorder(folder_, 100 * kMiB, 1 * kMiB);
    recorder.start("full", {"/a"});
    for (int i = 0; i < 20000 && recorder.status().recording; ++i) {
      recorder.write("/a", text(2000, i), ros::Time(1 + i, 0));
      if (i % 50 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    std::ofstream(folder_ + "/said") << recorder.status().error;
    _exit(recorder.status().recording ? 1 : 0);
  }
  int status;
  waitpid(child, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  std::ifstream file(folder_ + "/said");
  const std::string said((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  EXPECT_NE(said.find("what came before is in"), std::string::npos) << said;
  ASSERT_TRUE(fs::exists(folder_ + "/full.bag")) << said;
  const std::vector<int> numbers = read(folder_ + "/full.bag");
  EXPECT_GT(numbers.size(), 900u);
  for (std::size_t i = 0; i < numbers.size(); ++i) ASSERT_EQ(numbers[i], static_cast<int>(i));
}

TEST_F(BagRepairTest, AFolderThatIsRemovedEndsTheRecordingAndIsSaid) {
  Recorder recorder(folder_ + "/below", 100 * kMiB, 1 * kMiB);
  recorder.start("gone", {"/a"});
  recorder.write("/a", text(2000, 0), ros::Time(1, 0));
  fs::remove_all(folder_ + "/below");
  for (int i = 1; i < 300 && recorder.status().recording; ++i) {
    recorder.write("/a", text(2000, i), ros::Time(1 + i, 0));
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  const RecorderStatus s = recorder.status();
  EXPECT_FALSE(s.recording);
  EXPECT_NE(s.error.find("removed"), std::string::npos) << s.error;
  EXPECT_EQ(s.error.find("whole"), std::string::npos) << s.error;
  recorder.start("next", {"/a"});
  recorder.stop();
}

TEST_F(BagRepairTest, TheLargestRecordingEndsReadable) {
  Recorder recorder(folder_, 100 * kMiB, 1 * kMiB, 1 * kMiB);
  const std::string path = recorder.start("limit", {"/a"});
  for (int i = 0; i < 20000 && recorder.status().recording; ++i) {
    recorder.write("/a", text(2000, i), ros::Time(1 + i, 0));
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  const RecorderStatus s = recorder.status();
  EXPECT_NE(s.error.find("recording_limit"), std::string::npos) << s.error;
  EXPECT_GT(read(path).size(), 300u);
}

}  // namespace
}  // namespace tissue_sim
