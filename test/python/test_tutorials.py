"""The notebooks, and the README's Python, run as they are written."""
import glob
import json
import os
import re

import numpy as np
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

TOP = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
NOTEBOOKS = sorted(glob.glob(os.path.join(TOP, "examples", "notebooks", "*.ipynb")))


def run_cells(path):
    with open(path, encoding="utf-8") as file:
        cells = [c for c in json.load(file)["cells"] if c["cell_type"] == "code"]
    space = {}
    for i, cell in enumerate(cells):
        assert not cell["outputs"], "notebooks are kept without outputs"
        exec(compile("".join(cell["source"]), "%s, cell %d" % (path, i), "exec"), space)
    matplotlib.pyplot.close("all")
    return space


@pytest.fixture
def bag(tmp_path, monkeypatch):
    """As the node records, of a few frames."""
    rosbag = pytest.importorskip("rosbag")
    messages = pytest.importorskip("sensor_msgs.msg")
    import genpy
    from geometry_msgs.msg import WrenchStamped
    from std_msgs.msg import String
    import tissue_sim
    scene = {"bodies": [{"name": "block"}], "tools": [{"name": "probe", "type": "probe"}]}
    simulation = tissue_sim.Simulation(scene)
    path = str(tmp_path / "some.bag")
    with rosbag.Bag(path, "w") as out:
        stamp = genpy.Time(1)
        out.write("/simulator/scene", String(tissue_sim.scene_to_yaml(scene)), stamp)
        for frame in range(3):
            force = simulation.advance(tools={"probe": [0, 0, 0.05]}).result.loads[0].mean.force
            points = np.asarray(simulation.points())
            stamp = genpy.Time(1 + frame)
            wrench = WrenchStamped()
            wrench.header.stamp = stamp
            wrench.wrench.force.x, wrench.wrench.force.y, wrench.wrench.force.z = force
            out.write("/probe/spatial/measured_cf", wrench, stamp)
            fields = [messages.PointField(n, 4 * i, k, 1) for i, (n, k) in enumerate(
                [("x", 7), ("y", 7), ("z", 7), ("rgb", 6), ("id", 6), ("fragment", 5), ("stress", 7)])]
            out.write("/simulator/tissue/points", messages.PointCloud2(
                height=1, width=len(points), fields=fields, point_step=32, row_step=32 * len(points),
                data=points.tobytes()), stamp)
    monkeypatch.setenv("TISSUE_SIM_BAG", path)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=[os.path.basename(p) for p in NOTEBOOKS])
def test_notebook(path, request):
    if path.endswith("read_a_bag.ipynb"):
        request.getfixturevalue("bag")
    run_cells(path)


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 4


def test_python_of_the_readme(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with open(os.path.join(TOP, "README.md"), encoding="utf-8") as file:
        blocks = re.findall(r"```python\n(.*?)```", file.read(), re.S)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert (tmp_path / "cut.png").stat().st_size > 1000
