#!/usr/bin/python3
"""Writes the demo's instrument paths, scalpel.csv and probe.csv, to fit a body, and the scene.yaml
that goes with them.

The body is held at its low x end. The scalpel comes from the -y side and cuts the other end off
along a curve in the plane; then the probe pushes the loose end towards -y. Lines of a path: time
[s], position [m], orientation (x, y, z, w), jaw [rad]; 100 a second."""
import argparse
import io
import os
import subprocess
import sys

import numpy as np
import yaml

RATE = 100.0  # [Hz]
LEAN = np.radians(20)  # the scalpel's handle leans this far towards where it cuts


def rotation_to_quaternion(r):
    """(x, y, z, w) of rotation matrices (n, 3, 3), without jumps of sign along n."""
    q = np.empty((len(r), 4))
    for k, m in enumerate(r):
        values, vectors = np.linalg.eigh(np.array([
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[0, 1] + m[1, 0], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)]]) / 3)
        q[k] = vectors[:, np.argmax(values)]
        if k and q[k] @ q[k - 1] < 0:
            q[k] = -q[k]
    return q if q[0, 3] >= 0 else -q


def ease(t):
    """0 to 1 with speed and acceleration 0 at both ends; the largest speed is 1.875."""
    t = np.clip(t, 0, 1)
    return t ** 3 * (10 - 15 * t + 6 * t * t)


def along(keys, times, t):
    """Eases from one key position to the next; times of the keys [s]."""
    x = np.tile(np.asarray(keys[0], float), (len(t), 1))
    for a, b, begin, end in zip(keys, keys[1:], times, times[1:]):
        x += ease((t - begin) / (end - begin))[:, None] * (np.asarray(b) - np.asarray(a))
    return x


def seconds_for(distance, speed):
    """Time of an eased move whose largest speed is `speed` [m/s]."""
    return max(0.4, 1.875 * np.linalg.norm(distance) / speed)


class Cut:
    """The curve seen from above: a parabola over the body's width, straight beyond."""

    def __init__(self, lo, hi):
        size = hi - lo
        self.y, self.width = lo[1], size[1]
        self.bend = min(0.22 * size[1], 0.16 * size[0])
        self.slant = min(0.33 * size[1], 0.24 * size[0])
        self.x = lo[0] + 0.47 * size[0]

    def at(self, s):
        """Place (n, 2) and direction (n, 2) at s: 0 where the body's box begins, 1 where it ends."""
        inside = np.clip(s, 0, 1)
        slope = (self.slant + 2 * self.bend * inside) / self.width
        x = self.x + self.slant * s + self.bend * (inside ** 2 + 2 * inside * (s - inside))
        tangent = np.stack([slope, np.ones_like(slope)], 1)
        return (np.stack([x, self.y + self.width * s], 1),
                tangent / np.linalg.norm(tangent, axis=1, keepdims=True))


def scalpel_path(cut, lo, hi, ground):
    """(times, positions, rotations) and when the blade leaves the tissue."""
    run_up = 0.012 / cut.width
    tip = ground - 0.003
    over = hi[2] - tip + 0.015
    lead = np.tan(LEAN) * (hi[2] - tip) / cut.width  # the edge's upper end is ahead of the tip
    first, last = -run_up - lead, 1 + run_up
    begin = np.append(cut.at(np.array([first]))[0][0], tip)
    end = np.append(cut.at(np.array([last]))[0][0], tip)
    away = begin + [-0.03, -0.045, over]
    leave = end + [0, 0, over]
    aside = leave + [-0.06, 0.03, 0.02]
    steps = [1.2, seconds_for(begin - away, 0.12), 0.2,
             seconds_for((last - first) * cut.width * 1.15, 0.05), 0.1,
             seconds_for(leave - end, 0.12), seconds_for(aside - leave, 0.12)]
    times = np.cumsum([0] + steps)
    t = np.arange(0, times[-1] + 0.5 / RATE, 1 / RATE)
    s = first + (last - first) * ease((t - times[3]) / steps[3])
    place, tangent = cut.at(s)
    x = np.column_stack([place, np.full(len(t), tip)])
    x += along([away - begin, [0, 0, 0]], times[1:3], t)
    x += along([[0, 0, 0], leave - end, aside - end], times[5:8], t)
    heading = np.column_stack([tangent, np.zeros(len(t))])
    down = np.array([0, 0, -1.0])
    z = np.cos(LEAN) * down - np.sin(LEAN) * heading
    forward = np.cos(LEAN) * heading + np.sin(LEAN) * down
    return t, x, np.stack([forward, np.cross(z, forward), z], 2), times[4]


# How high the probe comes, of the body's height: an organ's loose piece sinks and tips over.
TOUCH = {"box": 0.22, "mesh": 0.3}


def probe_path(cut, lo, hi, ground, radius, shape, start, push=0.03):
    """Pushes the piece beyond the cut by `push` [m] towards -y, through its middle."""
    rounded = shape != "box"
    gx, gy = np.meshgrid(np.linspace(lo[0], hi[0], 200), np.linspace(lo[1], hi[1], 200))
    s = (gy - cut.y) / cut.width
    piece = gx > cut.at(s.ravel())[0][:, 0].reshape(s.shape)
    middle, half = (lo + hi) / 2, (hi - lo) / 2
    if rounded:
        piece &= ((gx - middle[0]) / half[0]) ** 2 + ((gy - middle[1]) / half[1]) ** 2 < 1
    direction = np.array([-0.10, -1.0])
    direction /= np.linalg.norm(direction)
    center = np.array([gx[piece].mean(), gy[piece].mean()])
    edge = gy[piece & (np.abs(gx - center[0]) < 0.03 * half[0] * 2)].max()
    height = ground + TOUCH[shape] * (hi[2] - ground) if shape in TOUCH else middle[2]
    touch = center - direction * (edge - center[1]) / -direction[1]
    clear = cut.at(np.array([1.0]))[0][0, 0] + 1.5 * radius  # the probe passes beside the parent
    if not rounded:
        touch[0] = max(touch[0], clear)
    begin = np.append(touch - direction * (radius + 0.008), height)
    end = np.append(touch - direction * (radius - push), height)
    away = begin + [0.03, 0.05, 0.05]
    keys = [away, away, begin, end]
    steps = [start, seconds_for(begin - away, 0.12), seconds_for(end - begin, 0.025)]
    times = np.cumsum([0] + steps)
    t = np.arange(0, times[-1] + 0.5 / RATE, 1 / RATE)
    tilt = np.radians(7)
    z = np.append(np.sin(tilt) * direction, -np.cos(tilt))
    x = np.append(np.cos(tilt) * direction, np.sin(tilt))
    rotation = np.stack([x, np.cross(z, x), z], 1)
    return t, along(keys, times, t), np.tile(rotation, (len(t), 1, 1))


def write_path(path, t, x, rotation):
    rows = np.column_stack([t, x, rotation_to_quaternion(rotation), np.zeros(len(t))])
    with open(path, "w") as file:
        file.write("# t x y z qx qy qz qw jaw; made by scripts/make_demo_paths.py\n")
        np.savetxt(file, rows, fmt="%.3f" + ",%.6f" * 8)


TETRAHEDRA = (".msh", ".vtk", ".vtu", ".mesh", ".node", ".ele")


def mesh_points(path):
    """Vertices (n, 3) in the file's unit, as the simulator reads them. Raises ValueError."""
    read = subprocess.run(["rosrun", "tissue_sim", "mesh_vertices", path], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE, universal_newlines=True)
    if read.returncode != 0:
        raise ValueError(read.stderr.strip())
    return np.loadtxt(io.StringIO(read.stdout), ndmin=2)


def box_of(body, folder):
    """Lowest and highest corner of a body of a scene, and its shape."""
    pose = body.get("pose", {})
    qx, qy, qz, qw = pose.get("orientation", [0, 0, 0, 1])
    v = np.array([qx, qy, qz])
    shape = body.get("shape", "box")
    if shape == "mesh":
        name = body["mesh"] if "://" in body["mesh"] else os.path.join(folder, body["mesh"])
        points = mesh_points(name) * body.get("scale", 1.0)
    else:
        r = body.get("radius", 0.02)
        half = {"box": np.array(body.get("size", [0.08, 0.05, 0.03])) / 2, "ball": [r, r, r],
                "ellipsoid": body.get("radii", [0.03, 0.02, 0.015]),
                "cylinder": [r, r, body.get("height", 0.04) / 2]}[shape]
        points = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]) * half
    points = points + 2 * np.cross(v, np.cross(v, points) + qw * points)
    points = points + pose.get("position", [0, 0, 0])
    return points.min(0), points.max(0), shape


def scene_of_mesh(mesh, scale, cell_size):
    """A scene with the mesh lying on the ground, its longest side along x, its shortest upwards."""
    points = mesh_points(mesh) * scale
    order = np.argsort(-np.ptp(points, axis=0))
    turn = np.zeros((3, 3))
    turn[[0, 1, 2], order] = 1
    if np.linalg.det(turn) < 0:
        turn[2] *= -1
    placed = points @ turn.T
    lo, hi = placed.min(0), placed.max(0)
    size = hi - lo
    if not 0.02 < size[0] < 1:
        raise ValueError("%s is %.3g m long with --scale %g: give the scale that makes it 0.02 to 1 m"
                         " (0.001 for a file in millimetres)" % (mesh, size[0], scale))
    if cell_size is None:  # about 60 000 points at most, if the mesh fills half of its box
        cell_size = max(0.003, round((0.5 * size.prod() * 8 / 60000) ** (1 / 3), 4))
    q = rotation_to_quaternion(turn[None])[0]
    position = [0, 0, 0.002] - np.array([lo[0], (lo[1] + hi[1]) / 2, lo[2]])
    anchor = {"min": [-0.01, -size[1], -0.01], "max": [0.15 * size[0], size[1], size[2] + 0.01]}
    body = {"name": "organ", "shape": "mesh", "mesh": os.path.abspath(mesh), "scale": scale,
            "pose": {"position": position, "orientation": q}, "material": "liver",
            "anchors": [{"box": anchor}]}
    # The preset without its viscosity, which would take half of real time on two cores: drag brings it to rest.
    material = {"name": "liver", "young_modulus": 5000, "poisson_ratio": 0.45, "density": 1060}
    scene = {"name": "organ", "cell_size": cell_size, "damping": 2.0, "materials": [material],
             "bodies": [body], "mls": {"spacing": cell_size}}
    if mesh.lower().endswith(TETRAHEDRA):
        scene["pbd"] = {"model": "tetrahedra"}
    return scene


def plain(x):
    """The same without numpy's types, for YAML."""
    if isinstance(x, dict):
        return {k: plain(v) for k, v in x.items()}
    if isinstance(x, (list, tuple, np.ndarray)):
        return [plain(v) for v in x]
    return float("%.6g" % x) if isinstance(x, (float, np.floating)) else x


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--scene", help="scene file whose first body is to be cut")
    parser.add_argument("--mesh", help="mesh file to make a scene of instead")
    parser.add_argument("--scale", type=float, default=1.0, help="metres per unit of the mesh")
    parser.add_argument("--cell-size", type=float, help="spacing of the grid, or of nodes [m]")
    parser.add_argument("--grading", type=float, help="method mls: nodes dense at the surface, so many times as "
                        "far apart inside (1 to 4)")
    parser.add_argument("--only-paths", action="store_true", help="write no scene.yaml")
    parser.add_argument("--out", required=True, help="folder to write into")
    args = parser.parse_args()
    if args.mesh:
        scene = scene_of_mesh(args.mesh, args.scale, args.cell_size)
        folder = ""
    else:
        with open(args.scene) as file:
            scene = yaml.safe_load(file)
        folder = os.path.dirname(os.path.abspath(args.scene))
        if args.cell_size:
            scene["cell_size"] = args.cell_size
            scene["mls"] = {**scene.get("mls", {}), "spacing": args.cell_size}
    if args.grading:
        scene["mls"] = {**scene.get("mls", {}), "placement": "graded", "grading": args.grading}
    body = scene["bodies"][0]
    lo, hi, shape = box_of(body, folder)
    ground = scene.get("ground", {}).get("z", 0.0)
    tools = {tool["name"]: tool for tool in scene.get("tools", [])}
    radius = tools.get("probe", {}).get("radius", 0.004)
    blade = round((hi[2] - ground + 0.015) / np.cos(LEAN), 3)
    if set(tools) != {"scalpel", "probe"}:
        tools = {"scalpel": {"name": "scalpel", "type": "scalpel", "blade_width": 0.008,
                             "blade_length": blade},
                 "probe": {"name": "probe", "type": "probe", "radius": 0.004, "length": 0.1}}
        scene["tools"] = list(tools.values())
    os.makedirs(args.out, exist_ok=True)
    cut = Cut(lo, hi)
    t, x, rotation, cut_done = scalpel_path(cut, lo, hi, ground)
    write_path(os.path.join(args.out, "scalpel.csv"), t, x, rotation)
    t, x, rotation = probe_path(cut, lo, hi, ground, radius, shape, cut_done)
    write_path(os.path.join(args.out, "probe.csv"), t, x, rotation)
    if not args.only_paths:
        if "mesh" in body and "://" not in body["mesh"]:
            body["mesh"] = os.path.abspath(os.path.join(folder, body["mesh"]))
        with open(os.path.join(args.out, "scene.yaml"), "w") as file:
            yaml.safe_dump(plain(scene), file, sort_keys=False, default_flow_style=None)


if __name__ == "__main__":
    try:
        main()
    except (ValueError, OSError) as e:
        sys.exit("make_demo_paths: %s" % e)
