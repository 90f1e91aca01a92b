#!/usr/bin/env python3
"""Clients that check, as CRTK's do, that all their topics are connected: by simulated time, too."""
import subprocess
import sys
import unittest

import rospy
import rostest
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState

CLIENTS, PATIENCE = 4, 5.0  # [s] of ROS time


def check_connections():
    """check_connections() of crtk_python_client, in its order: what is not connected."""
    rospy.init_node('clock_client', anonymous=True)
    topics = [rospy.Subscriber('/PSM1/setpoint_cp', PoseStamped, queue_size=10),
              rospy.Publisher('/PSM1/servo_cp', PoseStamped, queue_size=10),
              rospy.Publisher('/PSM1/servo_jp', JointState, queue_size=10)]
    start = rospy.Time.now()
    rate = rospy.Rate(100)
    missing = topics
    while missing and (rospy.Time.now() - start).to_sec() < PATIENCE:
        rate.sleep()
        missing = [t for t in topics if t.get_num_connections() == 0]
    return [t.name for t in topics if t.get_num_connections() == 0]


class ClockClient(unittest.TestCase):
    def test_the_first_clock_finds_all_connected(self):
        # The clock must be past what they wait for: its first message jumps as far.
        while rospy.Time.now().to_sec() < PATIENCE + 1:
            rospy.rostime.wallsleep(0.1)
        clients = [subprocess.Popen([sys.executable, __file__, 'client']) for _ in range(CLIENTS)]
        self.assertEqual([c.wait() for c in clients], [0] * CLIENTS)


if __name__ == '__main__':
    if sys.argv[1:] == ['client']:
        sys.exit(', '.join(check_connections()) or None)
    rospy.init_node('clock_client_test')
    rostest.rosrun('tissue_sim', 'clock_client', ClockClient)
