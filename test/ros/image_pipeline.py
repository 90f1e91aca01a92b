#!/usr/bin/env python3
"""What image_proc, depth_image_proc, image_view and OpenCV make of the cameras' images.

Which of them is not installed is skipped, and said.
"""
import os
import subprocess
import sys
import tempfile
import time
import unittest

import numpy as np
import rospkg
import rospy
import rostest
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from tissue_sim.srv import Step

try:
    import cv2
except ImportError:
    cv2 = None

KINDS = {'rgb8': (np.uint8, 3), '32FC1': (np.float32, 1), '16UC1': (np.uint16, 1), 'bgr8': (np.uint8, 3)}


def pixels(message):
    kind, channels = KINDS[message.encoding]
    array = np.frombuffer(message.data, kind).reshape(message.height, message.width, channels)
    return array[..., ::-1] if message.encoding == 'bgr8' else array


def field(cloud, name, kind):
    offset = next(f.offset for f in cloud.fields if f.name == name)
    data = np.frombuffer(cloud.data, np.uint8).reshape(cloud.height, cloud.width, cloud.point_step)
    return np.ascontiguousarray(data[..., offset:offset + 4]).view(kind)[..., 0]


class Stream:
    """What came on a topic, by stamp."""

    def __init__(self, topic, kind=Image):
        self.topic, self.came = topic, {}
        self.subscriber = rospy.Subscriber(topic, kind, self.keep, queue_size=10, buff_size=1 << 24)

    def keep(self, message):
        self.came[message.header.stamp.to_nsec()] = message


def of_one_frame(*streams):
    """Steps until all have an image of one frame."""
    step = rospy.ServiceProxy('/simulator/step', Step)
    step.wait_for_service()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        step(1)
        time.sleep(0.1)
        common = set.intersection(*(set(s.came) for s in streams))
        if common:
            return [s.came[max(common)] for s in streams]
    raise AssertionError('nothing in common of ' + ', '.join(s.topic for s in streams))


class ImagePipeline(unittest.TestCase):

    def leave_out(self, why):
        """Skips, with a report of it, for rostest's own calls it passed."""
        folder = os.path.join(rospkg.get_test_results_dir(), 'tissue_sim')
        os.makedirs(folder, exist_ok=True)
        name = self._testMethodName
        with open(os.path.join(folder, 'rosunit-image_pipeline_' + name + '.xml'), 'w', encoding='utf-8') as report:
            report.write('<testsuite tests="1"><testcase classname="image_pipeline" name="%s"><skipped message="%s"/>'
                         '</testcase></testsuite>' % (name, why))
        self.skipTest(why)

    def start(self, package, program, *arguments, **environment):
        """A program of it, until the test ends."""
        try:
            has_nodelets = os.path.exists(rospkg.RosPack().get_path(package) + '/nodelet_plugins.xml')
        except rospkg.ResourceNotFound:
            self.leave_out(package + ' is not installed')
        if not has_nodelets:  # Debian has them in lib...-dev
            self.leave_out(package + ' has no nodelet_plugins.xml: its development package is not installed')
        process = subprocess.Popen(['rosrun', *program, *arguments], env={**os.environ, **environment})
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)  # image_saver waits for ever when it is asked to end

    def test_points_are_those_of_depth_image_proc(self):
        self.start('depth_image_proc',
                   ('nodelet', 'nodelet', 'standalone', 'depth_image_proc/point_cloud_xyzrgb'),
                   'rgb/image_rect_color:=/simulator/plain/left/image_raw',
                   'rgb/camera_info:=/simulator/plain/left/camera_info',
                   'depth_registered/image_rect:=/simulator/plain/depth/image_rect',
                   'depth_registered/points:=/made/points')
        made, own = of_one_frame(Stream('/made/points', PointCloud2),
                                 Stream('/simulator/plain/depth/points', PointCloud2))
        self.assertEqual((made.width, made.height), (own.width, own.height))
        for axis in 'xyz':
            np.testing.assert_allclose(field(own, axis, np.float32), field(made, axis, np.float32), rtol=1e-5,
                                       atol=1e-7)
        seen = np.isfinite(field(own, 'z', np.float32))
        self.assertGreater(seen.sum(), 100000)
        colours = [field(c, 'rgb', np.uint32)[seen] & 0xffffff for c in (own, made)]
        np.testing.assert_array_equal(*colours)

    def test_image_proc_takes_the_lens_out(self):
        self.start('image_proc', ('image_proc', 'image_proc'), ROS_NAMESPACE='/simulator/lens/left')
        made, plain, raw = of_one_frame(Stream('/simulator/lens/left/image_rect_color'),
                                        Stream('/simulator/plain/left/image_raw'),
                                        Stream('/simulator/lens/left/image_raw'))
        made, plain, raw = (pixels(m).astype(float) for m in (made, plain, raw))
        inside = made.sum(axis=2) > 0  # the lens saw it
        self.assertGreater(inside.mean(), 0.9)
        off = np.abs(made - plain)[inside].mean()
        print('image_proc: mean difference %.2f of 255, %.2f before' % (off, np.abs(raw - plain)[inside].mean()))
        self.assertLess(off, 2)
        self.assertGreater(np.abs(raw - plain)[inside].mean(), 3 * off)

    def test_image_view_saves_what_was_sent(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.start('image_view', ('image_view', 'image_saver'), 'image:=/simulator/plain/left/image_raw',
                   '_filename_format:=' + folder.name + '/%04d.png')
        if cv2 is None:
            self.leave_out('python3-opencv is not installed')
        stream = Stream('/simulator/plain/left/image_raw')
        end = time.monotonic() + 60
        saved = None
        while saved is None:  # it writes the camera's numbers beside, and images take a while
            self.assertLess(time.monotonic(), end)
            of_one_frame(stream)
            images = sorted(name for name in os.listdir(folder.name) if name.endswith('.png'))
            saved = cv2.imread(os.path.join(folder.name, images[0])) if images else None
        saved = saved[..., ::-1]
        self.assertTrue(any(np.array_equal(saved, pixels(m)) for m in stream.came.values()))

    def test_stereo_matching_finds_the_depth(self):
        if cv2 is None:
            self.leave_out('python3-opencv is not installed')
        left, right, depth, labels, info = of_one_frame(
            Stream('/simulator/plain/left/image_raw'), Stream('/simulator/plain/right/image_raw'),
            Stream('/simulator/plain/depth/image_rect'), Stream('/simulator/plain/labels'),
            Stream('/simulator/plain/right/camera_info', CameraInfo))
        grey = [cv2.cvtColor(pixels(m), cv2.COLOR_RGB2GRAY) for m in (left, right)]
        matcher = cv2.StereoSGBM_create(0, 64, 5, 200, 800, 1, 0, 10, 50, 1)
        disparity = matcher.compute(*grey) / 16.0
        true, label = pixels(depth)[..., 0], pixels(labels)[..., 0]
        found = (disparity > 1) & (label >= 1000)
        self.assertGreater(found.sum(), 0.7 * (label >= 1000).sum())
        error = np.abs(-info.P[3] / disparity[found] / true[found] - 1)
        print('stereo: median error of depth %.2f %%, of %d %% of the tissue' %
              (100 * np.median(error), 100 * found.sum() / (label >= 1000).sum()))
        self.assertLess(np.median(error), 0.02)


if __name__ == '__main__':
    rospy.init_node('image_pipeline')
    rostest.rosrun('tissue_sim', 'image_pipeline', ImagePipeline, sys.argv)
