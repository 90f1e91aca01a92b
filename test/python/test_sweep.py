"""Studies and fits: tasks that many processes share."""
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from tissue_sim import from_yaml
from tissue_sim.runs import field_of, poses_at, read_table, run
from tissue_sim.sweep import read_study, samples_of

STUDY = """
scene:
  cell_size: 0.004
  device: cpu
  materials: [{name: mine, young_modulus: 4000, viscosity: 1}]
  bodies: [{name: block, material: mine, size: [0.032, 0.024, 0.016], pose: {position: [0, 0, 0.008]}}]
  tools: [{name: ball, type: ball, radius: 0.006}]
frames: 6
tools: {ball: press.csv}
grid: {materials.mine.young_modulus: [3000, 6000], bodies.block.size.0: [0.032, 0.04]}
random: {materials.mine.poisson_ratio: {from: 0.3, to: 0.45}}
samples: 3
repeats: 2
seed: 7
"""


def study(folder):
    (folder / "press.csv").write_text("t,x,y,z\n0,0,0,0.0165\n0.1,0,0,0.0125\n")
    path = folder / "study.yaml"
    path.write_text(STUDY)
    return path


def test_a_study_has_the_same_runs_again(tmp_path):
    samples = samples_of(read_study(str(study(tmp_path))))
    assert len(samples) == 2 * 2 * 3 * 2
    again = samples_of(read_study(str(study(tmp_path))))
    assert [s["scene"] for s in samples] == [s["scene"] for s in again]
    assert len({s["scene"]["seed"] for s in samples}) == 24
    assert len({s["fields"]["materials.mine.poisson_ratio"] for s in samples}) == 12
    assert samples[-1]["scene"]["bodies"][0]["size"][0] == 0.04
    for wrong in ("grid: {materials.mine.colour: [1]}", "grid: {bodies.9.size: [1]}"):
        with pytest.raises(ValueError, match="no field"):
            samples_of(dict(read_study(str(study(tmp_path))), **from_yaml("{%s}" % wrong)))


def test_what_the_core_refuses_is_a_row():
    row = run({"cell_size": -1, "bodies": [{}]}, 3)
    assert "cell_size" in row["error"]
    assert field_of({"a": [{"name": "b", "c": 3}]}, "a.b.c") == ({"name": "b", "c": 3}, "c")


def test_paths_are_linear_between_rows(tmp_path):
    path = tmp_path / "path.csv"
    path.write_text("# a comment\nt,x,y,z,jaw\n0,0,0,1,0\n1,2,0,1,0.5\n")
    poses, jaw = poses_at(read_table(str(path)), np.array([0.5, 9]))
    assert poses.tolist() == [[1, 0, 1, 1, 0, 0, 0], [2, 0, 1, 1, 0, 0, 0]] and jaw[0] == 0.25
    path.write_text("t,x\n0,a\n")
    with pytest.raises(ValueError, match="path.csv"):
        read_table(str(path))


@pytest.fixture
def cluster(tmp_path):
    """The address of a scheduler, and three workers, each a process of its own."""
    pytest.importorskip("distributed")
    address = str(tmp_path / "scheduler.json")
    common = [sys.executable, "-m"]
    processes = [subprocess.Popen(common + ["distributed.cli.dask_scheduler", "--port", "0",
                                            "--no-dashboard", "--scheduler-file", address])]
    try:
        while not os.path.exists(address):
            assert processes[0].poll() is None, "the scheduler ended"
            time.sleep(0.1)
        processes += [subprocess.Popen(common + ["distributed.cli.dask_worker", "--scheduler-file",
                                                 address, "--nthreads", "1", "--no-nanny",
                                                 "--no-dashboard", "--local-directory", str(tmp_path)])
                      for _ in range(3)]
        yield address, processes[1:]
    finally:
        for process in processes:
            process.kill()
            process.wait()


def test_a_worker_that_is_killed_loses_nothing(cluster, tmp_path):
    from distributed import Client
    from tissue_sim.sweep import run_sample
    from tissue_sim.tasks import run_tasks
    address, workers = cluster
    samples = samples_of(read_study(str(study(tmp_path))))
    killed = []

    def kill_one(finished, of_all):
        if finished == of_all // 2 and not killed:
            workers[0].send_signal(signal.SIGKILL)
            killed.append(workers[0].wait())
    with Client(scheduler_file=address) as client:
        client.wait_for_workers(3)
        rows = run_tasks(client, run_sample, samples, kill_one)
    assert killed == [-signal.SIGKILL]
    assert rows == [run_sample(sample) for sample in samples]
    assert not any(row["error"] for row in rows) and len({row["checksum"] for row in rows}) > 11


def test_the_command_writes_parquet_and_a_plot(tmp_path):
    pytest.importorskip("distributed")
    pytest.importorskip("matplotlib")
    parquet = pytest.importorskip("pyarrow.parquet")
    out = tmp_path / "out"
    subprocess.run([sys.executable, "-m", "tissue_sim.sweep", str(study(tmp_path)), "--out", str(out),
                    "--processes", "2"], check=True, timeout=300)
    table = parquet.read_table(str(out / "samples.parquet")).to_pydict()
    assert table["run"] == list(range(24)) and min(table["ball.peak_force"]) > 0
    assert (out / "sweep.png").stat().st_size > 1000


def test_scenes_of_the_network_are_tasks(tmp_path):
    pytest.importorskip("distributed")
    program = os.environ.get("TISSUE_SIM_DATASET")
    if not program:
        pytest.skip("TISSUE_SIM_DATASET does not name the program tissue_sim_dataset")
    options = "kinds: [tension], frames: 8, horizon: 4, level: 1, seed: 3"
    path = tmp_path / "data.yaml"
    path.write_text("dataset: {program: %s, scenes: 3, %s}" % (program, options))
    subprocess.run([sys.executable, "-m", "tissue_sim.sweep", str(path), "--processes", "2"],
                   check=True, timeout=300)
    alone = tmp_path / "alone"
    subprocess.run([program, "--out", str(alone), "--scenes", "3", "--kinds", "tension", "--frames",
                    "8", "--horizon", "4", "--level", "1", "--seed", "3"], check=True, timeout=300)
    arrays = sorted(p.name for p in alone.glob("*.npy"))
    assert len(arrays) == 6  # features and labels
    for name in arrays:
        assert (tmp_path / "data" / name).read_bytes() == (alone / name).read_bytes(), name
