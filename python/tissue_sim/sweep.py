"""Runs a study: a scene, with some of its fields changed from run to run.

  scripts/sweep FILE.yaml [--out FOLDER] [--scheduler ADDRESS | --processes N]

FILE.yaml (docs/python.md#sweeps has all of it):
  scene: phantom.yaml            # beside the file, or a scene itself
  frames: 30
  tools: {probe: press.csv}      # t,x,y,z,qx,qy,qz,qw,jaw
  grid: {cell_size: [0.004, 0.005]}                          # each with each
  random: {bodies.0.size.2: {from: 0.03, to: 0.04}}          # drawn; log: true by ratios
  samples: 50                    # draws, for each of the grid
or dataset: {scenes: 60, ...}, for what the fragment network learns from.

Writes FOLDER/samples.parquet, a row a run, and FOLDER/sweep.png."""
import argparse
import copy
import itertools
import os
import shutil
import subprocess
import sys

import numpy as np

import tissue_sim
from tissue_sim.runs import beside, read_table, run, set_field
from tissue_sim.tasks import Progress, client_of, run_tasks

KEYS = {"scene", "frames", "tools", "cuts", "grid", "random", "samples", "repeats", "seed"}


def read_study(path):
    """The study of a file, with its scene and the tools' paths read."""
    with open(path) as file:
        study = tissue_sim.from_yaml(file.read())
    if not isinstance(study, dict):
        raise ValueError("%s: is no study: it needs a scene" % path)
    if "dataset" in study:
        return study
    unknown = set(study) - KEYS
    if unknown or "scene" not in study:
        raise ValueError("%s: %s" % (path, "unknown: " + ", ".join(sorted(unknown)) if unknown
                                     else "a study needs a scene, or a dataset"))
    scene = study["scene"]
    study["scene"] = (tissue_sim.load_scene(beside(scene, path)) if isinstance(scene, str)
                      else tissue_sim.from_yaml(tissue_sim.scene_to_yaml(scene)))
    study["tools"] = {name: read_table(beside(table, path))
                      for name, table in (study.get("tools") or {}).items()}
    return study


def samples_of(study):
    """All runs of a study, each plain data; the same for the same study."""
    grid, random = study.get("grid") or {}, study.get("random") or {}
    count, repeats = int(study.get("samples", 1)), int(study.get("repeats", 1))
    draw = np.random.RandomState(int(study.get("seed", 0)))
    samples = []
    for values in itertools.product(*grid.values()):
        for _ in range(count if random else 1):
            fields = dict(zip(grid, values))
            for name, law in random.items():
                low, high = float(law["from"]), float(law["to"])
                u = draw.uniform()
                fields[name] = (low * (high / low) ** u if law.get("log") else low + (high - low) * u)
            for repeat in range(repeats):
                scene = copy.deepcopy(study["scene"])
                scene["threads"] = 1  # tasks are what runs side by side
                for name, value in fields.items():
                    set_field(scene, name, value)
                if "seed" not in fields:
                    scene["seed"] = int(draw.randint(2 ** 31))
                samples.append({"run": len(samples), "repeat": repeat, "fields": fields, "scene": scene,
                                "frames": int(study.get("frames", 60)), "tools": study.get("tools"),
                                "cuts": study.get("cuts") or []})
    return samples


def run_sample(sample):
    """The row of a run: a task."""
    row = {"run": sample["run"], "repeat": sample["repeat"], "seed": sample["scene"]["seed"]}
    row.update(sample["fields"])
    row.update(run(sample["scene"], sample["frames"], sample["tools"], sample["cuts"]))
    return row


def run_dataset_scene(task):
    """One scene of what the fragment network learns from, by tissue_sim_dataset: a task. The folder is
    one that all workers see; a scene that is there is left alone."""
    program, out, index, options = task
    done = subprocess.run([program, "--out", out, "--first", str(index), "--scenes", "1"] + options,
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    return {"run": index, "error": "" if done.returncode == 0 else done.stdout.strip()}


def dataset_tasks(dataset, out):
    dataset = dict(dataset)
    program = dataset.pop("program", None) or shutil.which("tissue_sim_dataset")
    if not program or not os.access(program, os.X_OK):
        raise ValueError("dataset.program is %s: name tissue_sim_dataset, which the build has" % program)
    first, count = int(dataset.pop("first", 0)), int(dataset.pop("scenes", 60))
    options = [word for name, value in dataset.items()
               for word in ("--" + name.replace("_", "-"), ",".join(value) if isinstance(value, list)
                            else str(value))]
    return [(os.path.abspath(program), os.path.abspath(out), i, options)
            for i in range(first, first + count)]


def plot(rows, varied, path):
    """How each force, or else the energy, depends on each field that varied."""
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    good = [row for row in rows if not row["error"]]
    varied = [name for name in varied if all(isinstance(row[name], (int, float)) for row in good)]
    results = [name for name in (good[0] if good else ()) if name.endswith(".peak_force")]
    results = results or ["elastic_energy"]
    if not good or not varied:
        return False
    figure, axes = plt.subplots(len(results), len(varied), squeeze=False,
                                figsize=(3.6 * len(varied), 2.8 * len(results)))
    for line, result in zip(axes, results):
        for axis, name in zip(line, varied):
            axis.plot([row[name] for row in good], [row[result] for row in good], ".")
            axis.set_xlabel(name)
        line[0].set_ylabel(result + (" [N]" if result.endswith("force") else " [J]"))
    figure.tight_layout()
    figure.savefig(path, dpi=100)
    plt.close(figure)
    return True


def write_parquet(rows, path):
    import pyarrow
    import pyarrow.parquet
    names = list(dict.fromkeys(name for row in rows for name in row))
    table = pyarrow.table({name: [row.get(name) for row in rows] for name in names})
    pyarrow.parquet.write_table(table, path + ".part")
    os.replace(path + ".part", path)


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="sweep", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("study", metavar="FILE.yaml")
    parser.add_argument("--out", metavar="FOLDER", help="(the file's name without .yaml)")
    parser.add_argument("--scheduler", metavar="ADDRESS", help="of Dask, as tcp://host:8786")
    parser.add_argument("--processes", type=int, help="of this machine (as many as it has cores)")
    options = parser.parse_args(arguments)
    out = options.out or os.path.splitext(options.study)[0]
    try:
        study = read_study(options.study)
        if "dataset" in study:
            function, items, varied = run_dataset_scene, dataset_tasks(study["dataset"], out), []
        else:
            function, items = run_sample, samples_of(study)
            varied = list(items[0]["fields"]) if items else []
        if not items:
            raise ValueError("%s: has no runs" % options.study)
        os.makedirs(out, exist_ok=True)
    except (ValueError, OSError) as e:
        parser.exit(2, "sweep: %s\n" % e)
    with client_of(options.scheduler, options.processes) as client:
        rows = run_tasks(client, function, items, Progress())
    path = os.path.join(out, "samples.parquet")
    if "dataset" in study:
        program, folder, first, extra = items[0]  # all are there: it writes its table, if it has one
        subprocess.run([program, "--out", folder, "--first", str(first), "--scenes", str(len(items))]
                       + extra, check=not any(row["error"] for row in rows))
    else:
        write_parquet(rows, path)
        print("%d runs: %s" % (len(rows), path))
        picture = os.path.join(out, "sweep.png")
        if plot(rows, varied, picture):
            print(picture)
    failed = [row for row in rows if row["error"]]
    for row in failed[:5]:
        print("run %d: %s" % (row["run"], row["error"]), file=sys.stderr)
    if failed:
        print("%d of %d runs failed" % (len(failed), len(rows)), file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
