"""Finds a material's values from what was measured on it.

  scripts/fit DATA.csv --scene phantom.yaml [--material NAME] [--fit young_modulus,viscosity]
              [--out FOLDER] [--scheduler ADDRESS | --processes N]

DATA.csv has a line a sample: t [s], the tip of the scene's first tool x, y, z [m] (qx, qy, qz, qw,
too, where it does not point down), and what was measured: forces on the tool fx, fy, fz [N] and
places of markers on or in the tissue, as a.x, a.y, a.z, b.x, ... [m]; any of them. Poisson's ratio
needs markers, viscosity needs speed. The scene starts at t = 0; its material's values are where the
search begins.

Writes FOLDER/fit.yaml, values with standard deviations and their covariance, and FOLDER/fit.png."""
import argparse
import copy
import json
import os
import sys

import numpy as np

import tissue_sim
from tissue_sim.runs import read_table, run
from tissue_sim.tasks import client_of, run_tasks

#: What can be found: bounds, and the step of a derivative.
PARAMETERS = {"young_modulus": (10.0, 1e8), "poisson_ratio": (0.0, 0.49), "viscosity": (0.0, 1000.0)}
FORCES = ("fx", "fy", "fz")


def channels_of(data):
    """The names of what was measured: forces, and the markers' coordinates."""
    forces = [name for name in FORCES if name in data]
    markers = sorted({name[:-2] for name in data if name[-2:] in (".x", ".y", ".z")})
    for marker in markers:
        for axis in "xyz":
            if marker + "." + axis not in data:
                raise ValueError("marker %s has no column %s.%s" % (marker, marker, axis))
    if not forces and not markers:
        raise ValueError("the data have neither fx, fy, fz nor markers: nothing to compare with")
    return forces, markers


def material_of(scene, name=None):
    """The entry of a body's material in the scene; a preset gets one of its own."""
    name = name or scene["bodies"][0]["material"]
    for material in scene.setdefault("materials", []):
        if material["name"] == name:
            return material
    raise ValueError("the scene has no material %s of its own: write it under materials" % name)


def predict(task):
    """What the scene shows where the data were measured: {channel: (n,)}: a task."""
    scene, data = task
    forces, markers = channels_of(data)
    tool = scene["tools"][0]["name"]
    times, seen = [0.0], {name: [0.0] for name in forces}
    marks, found = {m: [] for m in markers}, {}

    def look(simulation, report):
        times.append(simulation.time)
        if forces:
            force = report.result.loads[0].mean.force
            for name in forces:
                seen[name].append(force["xyz".index(name[1])])
        if markers:
            points = simulation.points(fields=["rest", "displacement"])
            for m in markers:
                at = np.array([data["%s.%s" % (m, axis)][0] for axis in "xyz"])
                if m not in found:  # the eight points about it, by how near they are
                    far = np.linalg.norm(np.asarray(points["rest"]) - at, axis=1)
                    near = np.argsort(far, kind="stable")[:8]
                    weight = 1 / (far[near] + 1e-6)
                    found[m] = near, weight / weight.sum()
                near, weight = found[m]
                marks[m].append(at + weight @ np.asarray(points["displacement"])[near])
    frames = int(np.ceil(data["t"][-1] * scene["frame_rate"] + 0.5 - 1e-9))  # the last middle is behind
    row = run(scene, frames, {tool: data}, each_frame=look)
    if row["error"]:
        raise ValueError(row["error"])
    for m in markers:
        start = [data["%s.%s" % (m, axis)][0] for axis in "xyz"]
        for axis, values in zip("xyz", np.array([start] + marks[m]).T):
            seen["%s.%s" % (m, axis)] = values
    # A frame's force is its mean: that of its middle.
    times = np.array(times)
    middles = np.maximum(times - 0.5 / scene["frame_rate"], 0)
    return {name: np.interp(data["t"], middles if name in forces else times, values)
            for name, values in seen.items()}


def scales_of(data):
    """What a channel is compared by: the largest force, the largest way of a marker."""
    forces, markers = channels_of(data)
    force = max([np.abs(data[name]).max() for name in forces] or [0])
    names = ["%s.%s" % (m, axis) for m in markers for axis in "xyz"]
    way = max([np.abs(data[name] - data[name][0]).max() for name in names] or [0])
    scales = {name: force for name in forces}
    scales.update({name: way for name in names})
    if not all(scale > 0 for scale in scales.values()):
        raise ValueError("all that was measured is zero: nothing to find")
    return scales


def fit(scene, data, names, material=None, client=None):
    """Least squares. Returns values, their covariance, the prediction and the root mean square of what
    is left, as a share of each channel's scale."""
    from scipy.optimize import least_squares
    unknown = [name for name in names if name not in PARAMETERS]
    if unknown or not names:
        raise ValueError("cannot fit %s: there are %s" % (", ".join(unknown) or "nothing",
                                                          ", ".join(PARAMETERS)))
    scales = scales_of(data)
    start = material_of(scene, material)

    def value_of(x):  # a modulus by its logarithm: what it changes goes by ratios
        return {n: float(np.exp(v)) if n == "young_modulus" else float(v) for n, v in zip(names, x)}

    def task_of(x):
        changed = copy.deepcopy(scene)
        changed["threads"] = 0 if client is None else 1
        material_of(changed, start["name"]).update(value_of(x))
        return changed, data

    def residual(seen):
        return np.concatenate([(seen[n] - data[n]) / scales[n] for n in scales])

    done = {}

    def evaluate(points):
        new = [x for x in dict.fromkeys(tuple(x) for x in points) if x not in done]
        tasks = [task_of(x) for x in new]
        results = run_tasks(client, predict, tasks) if client else [predict(t) for t in tasks]
        done.update(zip(new, results))
        return [residual(done[tuple(x)]) for x in points]

    lower, upper = np.array([PARAMETERS[n] for n in names]).T
    step = np.array([0.01 if n == "young_modulus" else 0.005 if n == "poisson_ratio"
                     else max(0.05 * start[n], 0.05) for n in names])
    log = np.array([n == "young_modulus" for n in names])
    lower, upper = (np.where(log, np.log(np.maximum(b, 1e-9)), b) for b in (lower, upper))

    def jacobian(x):
        ends = [x + np.eye(len(x))[i] * step[i] * (1 if x[i] + step[i] <= upper[i] else -1)
                for i in range(len(x))]
        here, *there = evaluate([x] + ends)
        return np.stack([(t - here) / (e - x)[i] for i, (t, e) in enumerate(zip(there, ends))], 1)

    first = np.array([np.log(start[n]) if n == "young_modulus" else start[n] for n in names])
    first = np.clip(first, lower + 1e-6, upper - 1e-6)
    found = least_squares(lambda x: evaluate([x])[0], first, jacobian, bounds=(lower, upper),
                          x_scale=10 * step, xtol=1e-4, ftol=1e-6, max_nfev=40)
    values = value_of(found.x)
    freedom = max(len(found.fun) - len(names), 1)
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * (found.fun @ found.fun) / freedom
    turn = np.diag([values[n] if n == "young_modulus" else 1.0 for n in names])
    return {"values": values, "covariance": turn @ covariance @ turn, "prediction": done[tuple(found.x)],
            "rms": float(np.sqrt(np.mean(found.fun ** 2))), "runs": len(done)}


def plot(data, result, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    forces, markers = channels_of(data)
    figure, axes = plt.subplots(1, 1 + bool(forces and markers), squeeze=False, figsize=(9, 3.4))
    groups = [g for g in (forces, ["%s.%s" % (m, a) for m in markers for a in "xyz"]) if g]
    for axis, group in zip(axes[0], groups):
        for i, name in enumerate(group):
            less = 0 if name in forces else data[name][0]
            unit = 1 if name in forces else 1e3
            axis.plot(data["t"], unit * (data[name] - less), ".", color="C%d" % (i % 10), ms=3,
                      label=name)
            axis.plot(data["t"], unit * (result["prediction"][name] - less), color="C%d" % (i % 10))
        axis.set_xlabel("t [s]")
        axis.set_ylabel("force [N]" if group is forces else "marker's way [mm]")
        axis.legend(fontsize=7)
    deviation = np.sqrt(np.diag(result["covariance"]))
    figure.suptitle(", ".join("%s %.4g ± %.2g" % (n.replace("_", " "), v, d) for (n, v), d in
                              zip(result["values"].items(), deviation)), fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="fit", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", metavar="DATA.csv")
    parser.add_argument("--scene", required=True, metavar="FILE.yaml")
    parser.add_argument("--material", metavar="NAME", help="of the scene's (the first body's)")
    parser.add_argument("--fit", default=",".join(PARAMETERS), metavar="NAMES", help="(%(default)s)")
    parser.add_argument("--out", metavar="FOLDER", help="(the data's name without .csv)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of Dask, as tcp://host:8786")
    parser.add_argument("--processes", type=int, help="of this machine (as many as it has cores)")
    options = parser.parse_args(arguments)
    out = options.out or os.path.splitext(options.data)[0]
    try:
        scene, data = tissue_sim.load_scene(options.scene), read_table(options.data)
        channels_of(data)
        if not scene.get("tools"):
            raise ValueError("%s has no tool that could press" % options.scene)
        os.makedirs(out, exist_ok=True)
        with client_of(options.scheduler, options.processes) as client:
            result = fit(scene, data, options.fit.split(","), options.material, client)
    except (ValueError, OSError) as e:
        parser.exit(2, "fit: %s\n" % e)
    deviation = np.sqrt(np.diag(result["covariance"]))
    for (name, value), d in zip(result["values"].items(), deviation):
        print("%s: %.5g +- %.2g" % (name, value, d))
    print("left over: %.2f %% of the largest, %d runs" % (100 * result["rms"], result["runs"]))
    with open(os.path.join(out, "fit.yaml"), "w") as file:  # JSON is YAML
        json.dump({"values": result["values"], "deviations": dict(zip(result["values"], deviation)),
                   "covariance": result["covariance"].tolist(), "rms": result["rms"]}, file, indent=1)
    plot(data, result, os.path.join(out, "fit.png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
