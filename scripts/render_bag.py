#!/usr/bin/python3
"""Draws pictures of a recorded bag, without a display: before the cut, during it and afterwards.

The bag is replayed before two cameras: each moment is drawn as tissue (before.png, during.png,
after.png) and coloured by von Mises stress (stress_*.png); overview.png shows them all. Several
bags, as of several methods, are drawn beside one another instead, a row each, as tissue:
beside.png. Needs the environment of the built package (devel/setup.bash), but no ROS master."""
import argparse
import os
import re
import shutil
import socket
import subprocess
import sys
import tempfile

import matplotlib
import numpy as np
import yaml

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.colors import LinearSegmentedColormap  # noqa: E402
import rosbag  # noqa: E402

NAMES = ("before", "during", "after")
HFOV = 26.0  # angle of view from left to right [deg]
PICTURES = 40  # of each camera, at most
STRESS_COLORS = ["#4d121a", "#9e1a1f", "#ed611a", "#ffc238", "#fffacc"]  # as the cameras have them
TYPES = {1: "i1", 2: "u1", 3: "<i2", 4: "<u2", 5: "<i4", 6: "<u4", 7: "<f4", 8: "<f8"}


def cloud_points(message):
    """A PointCloud2 as a structured array; its buffer is not copied."""
    layout = np.dtype({"names": [f.name for f in message.fields],
                       "formats": [TYPES[f.datatype] for f in message.fields],
                       "offsets": [f.offset for f in message.fields],
                       "itemsize": message.point_step})
    return np.frombuffer(message.data, layout)


def vector(p):
    return np.array([p.x, p.y, p.z])


class Recording:
    """What pictures need of a bag."""

    def __init__(self, path):
        self.path, self.bag = path, rosbag.Bag(path)
        topics = self.bag.get_type_and_topic_info().topics
        cloud_topic = self.find(topics, "/tissue/points", path)
        scene_topic = self.find(topics, "/scene", path)
        input_topic = self.find(topics, "/inputs", path)
        for _, message, _ in self.bag.read_messages([scene_topic]):
            self.scene = yaml.safe_load(message.data)
        self.times, self.boxes, self.damage, self.stress = [], [], [], []
        for _, message, time in self.bag.read_messages([cloud_topic]):
            points = cloud_points(message)
            x = np.stack([points["x"], points["y"], points["z"]], 1).astype(float)
            self.times.append(time)
            # All but a thousandth of the points: a crumb that flew off does not count.
            self.boxes.append(np.percentile(x, (0.05, 99.95), axis=0))
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
        """At each cloud: the simulated time, and whether a tool moves."""
        wanted = np.array([t.to_sec() for t in self.times])
        nearest, self.seconds = np.full(len(wanted), np.inf), np.zeros(len(wanted))
        self.moving = [False] * len(wanted)
        for _, message, time in self.bag.read_messages([topic]):
            k = int(np.argmin(np.abs(wanted - time.to_sec())))
            off = abs(wanted[k] - time.to_sec())
            if off >= nearest[k]:
                continue
            nearest[k] = off
            self.seconds[k] = (message.frame + 1) / self.scene.get("frame_rate", 60.0)
            self.moving[k] = any(np.linalg.norm(vector(m.end.position) - vector(m.begin.position)) >
                                 1e-5 for m in message.tools if m.present)

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


def camera_for(boxes, size, azimuth=-80.0, elevation=31.0):
    """Position (3,) and orientation [x, y, z, w] of a camera that sees all boxes [(min, max)] from
    azimuth and elevation [deg]."""
    lo, hi = np.min([b[0] for b in boxes], 0), np.max([b[1] for b in boxes], 0)
    corners = np.array([[(lo, hi)[i][0], (lo, hi)[j][1], (lo, hi)[k][2]]
                        for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    a, e = np.radians([azimuth, elevation])
    forward = -np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
    right = np.cross(forward, [0, 0, 1]) / np.cos(e)
    axes = np.stack([right, np.cross(forward, right), forward])  # x, y, z of the camera
    x, y, z = axes @ (corners - (lo + hi) / 2).T
    room = 0.9 * np.tan(np.radians(HFOV) / 2) * np.array([1, size[1] / size[0]])
    distance = max((np.abs(x) / room[0] - z).max(), (np.abs(y) / room[1] - z).max())
    w = np.sqrt(max(1e-12, 1 + np.trace(axes))) / 2
    q = np.array([axes[1][2] - axes[2][1], axes[2][0] - axes[0][2], axes[0][1] - axes[1][0]]) / (4 * w)
    return (lo + hi) / 2 - distance * forward, [float(v) for v in (*q, w)]


def cameras_for(recordings, moments, size, stress_end):
    """Entries for the scene's `cameras`."""
    boxes = [r.boxes[k] for r, chosen in zip(recordings, moments) for k in chosen]
    position, orientation = camera_for(boxes, size)
    longest = max(r.seconds.max() for r in recordings)
    camera = {"width": size[0], "height": size[1], "hfov": HFOV, "far": 10.0,
              "rate": float(np.clip(PICTURES / longest, 0.2, 30)),
              "pose": {"position": [float(v) for v in position], "orientation": orientation}}
    cameras = [dict(camera, name="picture")]
    if stress_end:
        cameras.append(dict(camera, name="picture_of_stress", colours="stress", stress_end=stress_end))
    return cameras


def replayed(recording, cameras, moments, folder):
    """The pictures (height, width, 3) of the moments, a list for each camera."""
    scene, new = os.path.join(folder, "scene.yaml"), os.path.join(folder, "pictures.bag")
    with open(scene, "w") as file:
        yaml.safe_dump(dict(recording.scene, cameras=cameras), file)
    if os.path.exists(new):
        os.remove(new)
    roslaunch = shutil.which("roslaunch")
    if roslaunch is None:
        raise ValueError("roslaunch is not on the PATH: source devel/setup.bash first")
    with socket.socket() as s:
        s.bind(("localhost", 0))
        port = s.getsockname()[1]
    command = ["/usr/bin/python3", roslaunch, "-p", str(port), "tissue_sim", "replay.launch",
               "bag:=" + os.path.abspath(recording.path), "cameras:=" + scene, "to:=" + new,
               "cloud_rate:=0.1"]
    environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % port, ROS_HOSTNAME="localhost")
    environment.pop("ROS_IP", None)
    frames = int(round(recording.seconds.max() * recording.scene.get("frame_rate", 60.0)))
    lines = []
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          env=environment) as replay:
        for line in replay.stdout:
            lines.append(line.rstrip())
            done = re.match(r"(\d+) frames done", line)
            if done:
                print("   %s of %d frames replayed" % (done.group(1), frames), flush=True)
    different = [line for line in lines if line.startswith(("first difference", "recorded on"))]
    if different:
        print("   note: the bag ran otherwise, pictures are of its replay here: " + "; ".join(different))
    if not os.path.exists(new):
        raise ValueError("the replay failed:\n" + "\n".join(lines[-12:]))
    pictures = []
    with rosbag.Bag(new) as bag:
        for camera in cameras:
            nearest = [(np.inf, None)] * len(moments)
            topics = [t for t in bag.get_type_and_topic_info().topics
                      if t.endswith("/" + camera["name"] + "/left/image_raw")]
            for _, image, _ in bag.read_messages(topics):
                off = [abs((image.header.stamp - recording.times[k]).to_sec()) for k in moments]
                data = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)
                nearest = [(o, data) if o < n[0] else n for o, n in zip(off, nearest)]
            if nearest[0][1] is None:
                raise ValueError("the replay drew nothing:\n" + "\n".join(lines[-12:]))
            pictures.append([data for _, data in nearest])
    return pictures


def overview(pictures, seconds, stress_end, path):
    """Both rows of pictures in one, with times and the legend of the stress."""
    height, width = pictures[0][0].shape[:2]
    size = (19.2, 2 * 6.4 * height / width + 0.9)
    figure = plt.figure(figsize=size, dpi=100, facecolor="#0c1a1f")
    ink, top = "#dfe9ea", 2 * 6.4 * height / width / size[1]
    for row, moments in enumerate(pictures):
        for column, picture in enumerate(moments):
            axes = figure.add_axes([column / 3 + 0.001, 1 - (row + 1) * top / 2 + 0.002,
                                    1 / 3 - 0.002, top / 2 - 0.004])
            axes.imshow(picture, interpolation="lanczos")
            axes.axis("off")
            if row == 0:
                axes.text(0.025, 0.93, "%s, %.1f s" % (NAMES[column], seconds[column]), color=ink,
                          fontsize=17, transform=axes.transAxes, va="top")
    bar = figure.add_axes([0.37, 0.036, 0.26, 0.018])
    colors = LinearSegmentedColormap.from_list("stress", STRESS_COLORS)
    bar.imshow(np.linspace(0, 1, 256)[None], aspect="auto", cmap=colors,
               extent=[0, stress_end / 1000, 0, 1])
    bar.set_yticks([])
    bar.tick_params(colors=ink, labelsize=12)
    figure.text(0.36, 0.045, "von Mises stress [kPa]", color=ink, fontsize=14, ha="right", va="center")
    figure.savefig(path, facecolor=figure.get_facecolor())


def beside(recordings, size, path, folder):
    """The moments of several bags, a row each, all from the place that shows all."""
    moments = [r.moments() for r in recordings]
    cameras = cameras_for(recordings, moments, size, None)
    figure = plt.figure(figsize=(19.2, 6.4 * size[1] / size[0] * len(recordings)), dpi=100)
    for row, (recording, chosen) in enumerate(zip(recordings, moments)):
        pictures = replayed(recording, cameras, chosen, folder)[0]
        for column, (picture, k) in enumerate(zip(pictures, chosen)):
            axes = figure.add_axes([column / 3 + 0.001, 1 - (row + 1) / len(recordings) + 0.002,
                                    1 / 3 - 0.002, 1 / len(recordings) - 0.004])
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
    os.makedirs(args.out, exist_ok=True)
    recordings = [Recording(bag) for bag in args.bag]
    with tempfile.TemporaryDirectory() as folder:
        if len(recordings) > 1:
            beside(recordings, size, os.path.join(args.out, "beside.png"), folder)
            return
        recording = recordings[0]
        chosen = recording.moments()
        if args.at:
            chosen = [int(np.argmin(np.abs(recording.seconds - float(s)))) for s in args.at.split(",")]
        stress_end = max(recording.stress[k] for k in chosen)
        digits = 10 ** np.floor(np.log10(max(stress_end, 1.0)))
        stress_end = float(np.ceil(stress_end / digits * 2) * digits / 2)
        pictures = replayed(recording, cameras_for([recording], [chosen], size, stress_end), chosen,
                            folder)
    for prefix, moments in zip(("", "stress_"), pictures):
        for name, picture in zip(NAMES, moments):
            plt.imsave(os.path.join(args.out, prefix + name + ".png"), picture)
            print("   %s%s.png" % (prefix, name), flush=True)
    overview(pictures, recording.seconds[chosen], stress_end, os.path.join(args.out, "overview.png"))
    print("   overview.png")


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError, rosbag.ROSBagException) as e:
        sys.exit("render_bag: %s" % e)
