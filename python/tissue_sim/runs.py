"""Runs as plain data, so that any process can do them: a scene, what instruments do, what comes out."""
import csv
import os

import numpy as np

POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")


def read_table(path):
    """The columns of a CSV with a header: {name: (n,) floats}; lines that begin with # are left out."""
    with open(path, newline="") as file:
        lines = [line for line in file if line.strip() and not line.startswith("#")]
    rows = list(csv.reader(lines))
    names = [name.strip() for name in rows[0]] if rows else []
    try:
        values = np.array([[float(x) for x in row] for row in rows[1:]])
    except ValueError as e:
        raise ValueError("%s: %s" % (path, e))
    if values.ndim != 2 or values.shape[1] != len(names):
        raise ValueError("%s: must have a header and rows of as many numbers" % path)
    if not np.isfinite(values).all():
        raise ValueError("%s: has numbers that are not finite" % path)
    return dict(zip(names, values.T))


def poses_at(path, times):
    """A tool's poses (n, 7) and jaw angles (n,) [rad] at these times [s], from a table with t, x, y,
    z and, if they are given, qx, qy, qz, qw, jaw; linear between its rows."""
    missing = [name for name in ("t",) + POSE[:3] if name not in path]
    if missing:
        raise ValueError("a tool's path has no column %s" % ", ".join(missing))
    down = {"qx": [1.0]}  # the shaft is above
    columns = [path.get(name, np.resize(down.get(name, [0.0]), len(path["t"]))) if "qw" not in path
               else path[name] for name in POSE]
    poses = np.stack([np.interp(times, path["t"], column) for column in columns], 1)
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    jaw = np.interp(times, path["t"], path["jaw"]) if "jaw" in path else np.zeros(len(times))
    return poses, jaw


def run(scene, frames, tools=None, cuts=(), each_frame=None):
    """Runs a scene (a dictionary) and returns what came of it: one row. `tools` are paths by name,
    `cuts` have frame, edge and path. Calls each_frame(simulation, report) after each. What the core
    refuses, and a blow-up, are rows as well: their `error` says so."""
    from tissue_sim import Simulation, ToolRequest
    row = {"error": "", "frames": 0}
    try:
        simulation = Simulation(scene)
        rate = simulation.scene["frame_rate"]
        names = [tool["name"] for tool in simulation.scene.get("tools") or []]
        times = np.arange(1, frames + 1) / rate
        paths = {name: poses_at(path, times) for name, path in (tools or {}).items()}
        peaks = dict.fromkeys(names, 0.0)
        substeps = 0
        for frame in range(frames):
            report = simulation.advance(
                tools={n: ToolRequest(p[frame], float(j[frame])) for n, (p, j) in paths.items()},
                cuts=[(cut["edge"], cut["path"]) for cut in cuts if cut.get("frame", 0) == frame])
            result = report.result
            substeps += result.substeps
            for name, load in zip(names, result.loads):
                peaks[name] = max(peaks[name], load.peak_force)
            row["frames"] = frame + 1
            if result.blew_up:
                row["error"] = "blew up"
                break
            if each_frame:
                each_frame(simulation, report)
        pieces = simulation.fragments()
        row.update(points=simulation.point_count, substeps=substeps, pieces=len(pieces),
                   loose_volume=float(pieces["volume"][pieces["loose"]].sum()),
                   elastic_energy=result.elastic_energy, kinetic_energy=result.kinetic_energy,
                   checksum="%016x" % simulation.checksum())
        for name, load in zip(names, result.loads):
            row.update({name + ".peak_force": peaks[name]})
            row.update({name + ".f" + axis: f for axis, f in zip("xyz", load.mean.force.tolist())})
    except (ValueError, MemoryError, RuntimeError) as e:
        row["error"] = str(e)
    return row


def field_of(scene, path):
    """The container and key of a field, as in bodies.0.size.2 or materials.liver.viscosity; names
    stand for the one of a list that has it."""
    keys, here = path.split("."), scene
    for i, key in enumerate(keys):
        if isinstance(here, list):
            named = [k for k, item in enumerate(here)
                     if isinstance(item, dict) and item.get("name") == key]
            key = named[0] if named else int(key) if key.isdigit() and int(key) < len(here) else None
        if key is None or isinstance(here, dict) and key not in here or not isinstance(here, (dict, list)):
            raise ValueError("the scene has no field %s (%s is not there)" % (path, keys[i]))
        if i + 1 == len(keys):
            return here, key
        here = here[key]
    raise ValueError("the path of a field is empty")


def set_field(scene, path, value):
    here, key = field_of(scene, path)
    here[key] = value


def beside(path, file):
    """A path in a file is relative to the file's folder."""
    return os.path.join(os.path.dirname(os.path.abspath(file)), path)
