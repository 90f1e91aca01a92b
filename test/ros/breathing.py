#!/usr/bin/env python3
"""An organ on a moving anchor goes with it, 12 times a minute, and pulls it with a force of that rhythm."""
import unittest

import numpy as np
import rospy
import rostest
from geometry_msgs.msg import WrenchStamped
from tissue_sim.msg import FragmentArray

BREATH = 5.0  # [s]


class Breathing(unittest.TestCase):
    def test_the_organ_follows_and_its_reaction_is_told(self):
        pieces, forces = [], []
        rospy.Subscriber('/simulator/fragments', FragmentArray, pieces.append)
        rospy.Subscriber('/simulator/anchors/diaphragm/spatial/measured_cf', WrenchStamped, forces.append)
        while not pieces or pieces[-1].time - pieces[0].time < 2.5 * BREATH:  # of simulated time
            rospy.rostime.wallsleep(0.1)
        time = np.array([p.time for p in pieces])
        x = np.array([p.fragments[0].centroid.x for p in pieces])
        z = np.array([f.wrench.force.z for f in forces])
        self.assertTrue(all(len(p.fragments) == 1 for p in pieces))
        # By simulated time, after the first breath: as far as the anchor goes, and back.
        late = time > time[0] + BREATH
        self.assertAlmostEqual(np.ptp(x[late]), 0.012, delta=0.003)
        wave = np.exp(2j * np.pi * time[late] / BREATH)
        swing = x[late] - x[late].mean()
        self.assertGreater(abs((swing * wave).mean()) * 2, 0.8 * 0.006)
        # It is lifted by 3 mm in each breath: the table bears less of it, the anchor more.
        self.assertLess(z.min(), -0.1)
        self.assertGreater(np.ptp(z), 0.05)
        print('organ moves %.1f mm; force on the anchor %.2f to %.2f N' %
              (1e3 * np.ptp(x[late]), z.min(), z.max()))


if __name__ == '__main__':
    rospy.init_node('breathing_test')
    rostest.rosrun('tissue_sim', 'breathing', Breathing)
