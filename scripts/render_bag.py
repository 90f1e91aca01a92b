#!/usr/bin/python3
"""Draws pictures of a recorded bag, without a display: before the cut, during it and afterwards.

Each moment is drawn twice, as tissue (before.png, during.png, after.png) and coloured by von Mises
stress (stress_*.png); overview.png shows them all. Several bags, as of several methods, are drawn
beside one another instead, a row each, as tissue: beside.png. Needs no ROS master and no built
package."""
import argparse
import multiprocessing
import os
import sys

import matplotlib
import numpy as np
import yaml

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
import rosbag  # noqa: E402
import rospy  # noqa: E402

from picture.tissue_picture import Moment, camera_for, draw, stress_colors  # noqa: E402

NAMES = ("before", "during", "after")
TYPES = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}


def cloud_points(message):
    """A PointCloud2 as a structured array; its buffer is not copied."""
    layout = np.dtype({"names": [f.name for f in message.fields],
                       "formats": [TYPES[f.datatype] for f in message.fields],
                       "offsets": [f.offset for f in message.fields],
                       "itemsize": message.point_step})
    return np.frombuffer(message.data, layout)


def rotation_of(q):
    x, y, z, w = q.x, q.y, q.z, q.w
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def vector(p):
    return np.array([p.x, p.y, p.z])


class Recording:
    """What pictures need of a bag."""

    def __init__(self, path):
        self.bag = rosbag.Bag(path)
        topics = self.bag.get_type_and_topic_info().topics
        self.cloud_topic = self.find(topics, "/tissue/points", path)
        self.surface_topic = next((t for t in topics if t.endswith("/surface")), None)
        scene_topic = self.find(topics, "/scene", path)
        input_topic = self.find(topics, "/inputs", path)
        for _, message, _ in self.bag.read_messages([scene_topic]):
            self.scene = yaml.safe_load(message.data)
        self.times, self.damage, self.stress = [], [], []
        for _, message, time in self.bag.read_messages([self.cloud_topic]):
            points = cloud_points(message)
            self.times.append(time)
            self.damage.append(float(points["damage"].sum()))
            self.stress.append(float(np.percentile(points["stress"], 98.5)) if len(points) else 0.0)
        if not self.times:
            raise ValueError("%s: holds no point cloud to draw" % path)
        self.read_tools(input_topic)

    @staticmethod
    def find(topics, ending, path):
        for topic in sorted(topics, key=len):
            if topic.endswith(ending):
                return topic
        raise ValueError("%s: has no topic ...%s, so it is no recording of the simulator" %
                         (path, ending))

    def read_tools(self, topic):
        """At each cloud: the simulated time, the poses of the tools, and whether one moves."""
        wanted = np.array([t.to_sec() for t in self.times])
        nearest, self.seconds = np.full(len(wanted), np.inf), np.zeros(len(wanted))
        self.tools, self.moving = [[] for _ in wanted], [False] * len(wanted)
        shape_of = {tool["name"]: tool for tool in self.scene.get("tools", [])}
        for _, message, time in self.bag.read_messages([topic]):
            k = int(np.argmin(np.abs(wanted - time.to_sec())))
            off = abs(wanted[k] - time.to_sec())
            if off >= nearest[k]:
                continue
            nearest[k] = off
            self.seconds[k] = (message.frame + 1) / self.scene.get("frame_rate", 60.0)
            present = [m for m in message.tools if m.present]
            self.tools[k] = [(dict(shape_of[m.name], jaw=m.jaw_end), vector(m.end.position),
                              rotation_of(m.end.orientation)) for m in present]
            self.moving[k] = any(np.linalg.norm(vector(m.end.position) - vector(m.begin.position)) >
                                 1e-5 for m in present)

    def moments(self):
        """Indices of the clouds before, during and after the cut."""
        n, damage = len(self.times), np.array(self.damage)
        if damage[-1] <= 0:
            return [0, n // 2, n - 1]
        cut = self.seconds[np.nonzero(damage == damage[0])[0][-1]]
        before = int(np.argmin(np.abs(self.seconds - cut + 1.0)))
        during = int(np.argmin(np.abs(damage - damage[0] - 0.6 * (damage[-1] - damage[0]))))
        after = [k for k in range(n) if self.moving[k] and damage[k] == damage[-1]]
        return [before, during, after[-1] if after else n - 1]

    def moment(self, k):
        time = self.times[k]
        message = next(self.bag.read_messages([self.cloud_topic], time, time))[1]
        ground = self.scene.get("ground", {}).get("z", 0.0)
        return Moment(cloud_points(message), self.tools[k], ground,
                      self.surface(time, message.header.stamp))

    def surface(self, time, stamp):
        """Corners of the triangles (m, 3, 3) of the surface with that stamp, recorded from that
        time on, of a method that has some; else None."""
        if self.surface_topic is None:
            return None
        # What a frame writes stands milliseconds apart, by what the machine has to do.
        soon = time + rospy.Duration(0.5)
        for _, marker, _ in self.bag.read_messages([self.surface_topic], time, soon):
            if marker.header.stamp == stamp:
                return np.array([[p.x, p.y, p.z] for p in marker.points]).reshape(-1, 3, 3)
        return None


def draw_one(job):
    moment, camera, stress_end, name, out = job
    pictures = draw(moment, camera, (None, stress_end))
    for picture, prefix in zip(pictures, ("", "stress_")):
        plt.imsave(os.path.join(out, prefix + name + ".png"), picture)
    print("   %s.png, stress_%s.png" % (name, name), flush=True)
    return pictures


def overview(pictures, seconds, stress_end, path):
    """Both rows of pictures in one, with times and the legend of the stress."""
    height, width = pictures[0][0].shape[:2]
    size = (19.2, 2 * 6.4 * height / width + 0.9)
    figure = plt.figure(figsize=size, dpi=100, facecolor="#0c1a1f")
    ink, top = "#dfe9ea", 2 * 6.4 * height / width / size[1]
    for column, pair in enumerate(pictures):
        for row, picture in enumerate(pair):
            axes = figure.add_axes([column / 3 + 0.001, 1 - (row + 1) * top / 2 + 0.002,
                                    1 / 3 - 0.002, top / 2 - 0.004])
            axes.imshow(picture, interpolation="lanczos")
            axes.axis("off")
            if row == 0:
                axes.text(0.025, 0.93, "%s, %.1f s" % (NAMES[column], seconds[column]), color=ink,
                          fontsize=17, transform=axes.transAxes, va="top")
    bar = figure.add_axes([0.37, 0.036, 0.26, 0.018])
    bar.imshow(stress_colors(np.linspace(0, 1, 256))[None], aspect="auto",
               extent=[0, stress_end / 1000, 0, 1])
    bar.set_yticks([])
    bar.tick_params(colors=ink, labelsize=12)
    figure.text(0.36, 0.045, "von Mises stress [kPa]", color=ink, fontsize=14, ha="right", va="center")
    figure.text(0.645, 0.045, "grid: 10 mm; orange: came loose", color=ink, fontsize=14, va="center")
    figure.savefig(path, facecolor=figure.get_facecolor())


def beside(bags, size, path):
    """The moments of several bags, a row each, all from the place that shows the first."""
    first = Recording(bags[0])
    moments = [first.moment(k) for k in first.moments()]
    camera = camera_for([np.percentile(m.x, (0.05, 99.95), axis=0) for m in moments], size)
    figure = plt.figure(figsize=(19.2, 6.4 * size[1] / size[0] * len(bags)), dpi=100)
    for row, bag in enumerate(bags):
        recording = Recording(bag)
        for column, k in enumerate(recording.moments()):
            picture = draw(recording.moment(k), camera)[0]
            axes = figure.add_axes([column / 3 + 0.001, 1 - (row + 1) / len(bags) + 0.002,
                                    1 / 3 - 0.002, 1 / len(bags) - 0.004])
            axes.imshow(picture, interpolation="lanczos")
            axes.axis("off")
            axes.text(0.025, 0.93, "%s, %.1f s" % (recording.scene.get("method", "mpm"),
                                                    recording.seconds[k]), color="#dfe9ea",
                      fontsize=17, transform=axes.transAxes, va="top")
    figure.savefig(path, facecolor="#0c1a1f")
    print("   " + os.path.basename(path))


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("bag", nargs="+")
    parser.add_argument("--out", default=".", help="folder for the pictures")
    parser.add_argument("--size", default="1280x720", help="of a picture, WIDTHxHEIGHT")
    parser.add_argument("--at", help="simulated seconds of the three moments, as in 1,4.5,10")
    args = parser.parse_args()
    size = tuple(int(s) for s in args.size.split("x"))
    if len(args.bag) > 1:
        os.makedirs(args.out, exist_ok=True)
        beside(args.bag, size, os.path.join(args.out, "beside.png"))
        return
    recording = Recording(args.bag[0])
    chosen = recording.moments()
    if args.at:
        chosen = [int(np.argmin(np.abs(recording.seconds - float(s)))) for s in args.at.split(",")]
    moments = [recording.moment(k) for k in chosen]
    # All but a thousandth of the points: a crumb that flew off does not count.
    camera = camera_for([np.percentile(m.x, (0.05, 99.95), axis=0) for m in moments], size)
    stress_end = max(recording.stress[k] for k in chosen)
    digits = 10 ** np.floor(np.log10(max(stress_end, 1.0)))
    stress_end = float(np.ceil(stress_end / digits * 2) * digits / 2)
    os.makedirs(args.out, exist_ok=True)
    jobs = [(m, camera, stress_end, name, args.out) for m, name in zip(moments, NAMES)]
    try:
        pool = multiprocessing.Pool(min(3, os.cpu_count() or 1))
    except OSError:  # some containers have no /dev/shm
        pictures = [draw_one(job) for job in jobs]
    else:
        with pool:
            pictures = pool.map(draw_one, jobs, chunksize=1)
    overview(pictures, recording.seconds[chosen], stress_end, os.path.join(args.out, "overview.png"))
    print("   overview.png")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError, rosbag.ROSBagException) as e:
        sys.exit("render_bag: %s" % e)
