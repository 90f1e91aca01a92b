"""The Python module: what it takes, what it gives, what it refuses; and the core's bits."""
import math
import os
import subprocess
import threading

import numpy as np
import pytest

import tissue_sim
from tissue_sim import Simulation, ToolRequest

DOWN = [1, 0, 0, 0]  # a tool whose shaft is above


def block(**more):
    scene = {"cell_size": 0.004, "device": "cpu", "bodies": [
        {"name": "block", "size": [0.04, 0.024, 0.016], "pose": {"position": [0, 0, 0.008]},
         "anchors": [{"name": "left", "box": {"min": [-1, -1, -1], "max": [-0.012, 1, 1]}}]}],
        "tools": [{"name": "probe", "type": "probe", "radius": 0.004}]}
    scene.update(more)
    return scene


def upright(x):
    """A cut across the block."""
    return [[0, 0, -0.1], [0, 0, 0.1]], [[x, -0.1, 0], [x, 0.1, 0]]


def sweep(a, b, steps):
    return [a, b], steps


def test_frames_have_the_bits_of_the_core():
    golden = os.environ.get("TISSUE_SIM_GOLDEN")
    if not golden:
        pytest.skip("TISSUE_SIM_GOLDEN does not name the program tissue_sim_golden")
    lines = subprocess.run([golden, "--scene", "service_cuts", "--threads", "1"], check=True,
                           stdout=subprocess.PIPE, universal_newlines=True).stdout.splitlines()
    expected = [line.split()[2] for line in lines]
    simulation = Simulation({
        "cell_size": 0.003, "device": "cpu", "threads": 1, "bodies": [
            {"name": "body0", "size": [0.045, 0.030, 0.018], "pose": {"position": [0, 0, 0.0095]},
             "anchors": [{"box": {"min": [-1, -1, -1], "max": [-0.018, 1, 1]}}]}]})
    wave = [[0.012 + 0.004 * math.sin(0.6 * i), 0.03 - 0.0031 * i, 0] for i in range(21)]
    edge = [0, 0, -0.1], [0, 0, 0.1]
    cuts = {1: [sweep(*edge, [[0.0013, -0.05, 0], [0.0013, 0.0013, 0]])],
            3: [sweep(*edge, [[-0.008, -0.0057, 0], [0.05, -0.0022, 0]])],
            6: [sweep([-0.01, -0.1, 0], [-0.008, 0.1, 0], [[0, 0, -0.01], [0, 0, 0.05]])],
            8: [sweep(*edge, wave), sweep([0, -0.1, 0.0083], [0, 0.1, 0.0089],
                                          [[0.05, 0, 0], [-0.004, 0, 0]])]}
    got = []
    for frame in range(len(expected)):
        simulation.advance(cuts=cuts.get(frame, ()))
        got.append("%016x" % simulation.checksum())
    assert len(expected) == 12 and got == expected


def test_scene_from_text_dictionary_and_file(tmp_path):
    text = tissue_sim.scene_to_yaml(block())
    path = tmp_path / "scene.yaml"
    path.write_text(text)
    of = [Simulation(s) for s in (block(), text, path, str(path), tissue_sim.load_scene(path))]
    for simulation in of:
        simulation.advance()
    assert len({s.checksum() for s in of}) == 1
    assert of[0].scene == tissue_sim.load_scene(path)
    assert of[0].scene["bodies"][0]["size"] == [0.04, 0.024, 0.016]
    sized = block(cell_size=np.float64(0.004))
    sized["bodies"][0]["size"] = np.array([0.04, 0.024, 0.016])
    assert Simulation(sized).point_count == of[0].point_count


def test_yaml_as_the_core_reads_it():
    got = tissue_sim.from_yaml("{a: 1e4, b: 1, c: [true, off], d: '1', e: -.5, f: }")
    assert got == {"a": 1e4, "b": 1, "c": [True, "off"], "d": "1", "e": -0.5, "f": None}
    assert isinstance(got["b"], int)
    with pytest.raises(ValueError):
        tissue_sim.from_yaml("{a: [")


def test_points_pieces_surface_and_loads():
    simulation = Simulation(block())
    rest = simulation.points(fields=["rest", "displacement"])
    assert rest.shape == (simulation.point_count,) and rest["position"].dtype == np.float32
    assert np.allclose(rest["position"] - rest["displacement"], rest["rest"], atol=1e-7)
    assert len(simulation.points(stride=2)) == (simulation.point_count + 1) // 2
    before = rest["position"].copy()
    simulation.advance(tools={"probe": [0.01, 0, 0.03] + DOWN})
    for i in range(8):
        report = simulation.advance(tools=[[0.01, 0, 0.0175 - 0.0005 * i] + DOWN])
    load = report.result.loads[0]
    assert load.mean.force[2] > 0.01 and load.peak_force >= load.mean.force[2]
    assert report.result.anchor_loads[0].force.shape == (3,)
    assert np.abs(simulation.points()["position"] - before).max() > 1e-4
    assert simulation.tools[0].end[2] == pytest.approx(0.014) and simulation.frame == 9
    simulation.advance(cuts=[upright(0.0013)])
    pieces = simulation.fragments()
    assert simulation.fragment_count == len(pieces) == 2
    assert sorted(pieces["loose"]) == [False, True] and pieces["centroid"].shape == (2, 3)
    assert pieces["volume"].sum() == pytest.approx(0.04 * 0.024 * 0.016)
    surface = simulation.surface()
    assert surface.corners.shape == (len(surface.fragment), 3, 3) and surface.cut.any()
    assert set(np.unique(surface.fragment)) == set(pieces["id"])
    assert len(simulation.points(loose_only=True)) == pieces["point_count"][pieces["loose"]][0]


def test_arrays_are_read_in_place_until_the_next_frame():
    simulation = Simulation(block())
    points = simulation.points()
    heights = points["position"][:, 2]
    assert isinstance(heights, tissue_sim.Array)
    assert np.shares_memory(np.asarray(points), np.asarray(heights))
    kept, plain = heights.copy(), np.asarray(heights)
    assert np.mean(heights) == heights.mean() and ((heights + 1) == kept + 1).all()
    with pytest.raises(ValueError):
        np.asarray(heights)[0] = 1
    simulation.points(stride=3)  # does not take the memory of what is still read
    assert (heights == kept).all()
    simulation.advance()
    for stale in (points, heights):
        for read in (lambda a: a[0], np.asarray, len, np.sum, lambda a: a.shape, lambda a: a == 1,
                     repr, list, lambda a: a.copy()):
            with pytest.raises(RuntimeError, match="next frame"):
                read(stale)
    simulation.points()
    assert type(kept) is np.ndarray and (plain == kept).all()


@pytest.mark.parametrize("what", [
    {"tools": {"probe": [0, 0]}}, {"tools": {"probe": [0, 0, "x"]}}, {"tools": {"probe": [0, 0, 1j]}},
    {"tools": {"probe": [0, 0, np.nan]}}, {"tools": {"probe": [0, 0, 0, 0, 0, 0, 0]}},
    {"tools": {"probe": np.eye(4) * 2}}, {"tools": {"probe": [[0, 0], [1]]}},
    {"tools": {"knife": [0, 0, 0]}}, {"tools": [None, None]}, {"tools": 3},
    {"cuts": [upright(np.inf)]}, {"cuts": [([[0, 0, 1]], [[0, 0, 0]])]}, {"cuts": [[1, 2, 3]]},
    {"cuts": [([[0, 0], [0, 1]], np.zeros((2, 3)))]}, {"anchors": {"right": [0, 0, 0]}},
    {"anchors": {"left": [0, 0, np.nan]}}, {"gravity": [0, 0]}, {"gravity": [0, 0, np.nan]},
    {"damping": -1}])
def test_nonsense_is_refused_before_anything_is_done(what):
    simulation = Simulation(block())
    before = simulation.checksum()
    with pytest.raises(ValueError):
        simulation.advance(**what)
    assert simulation.frame == 0 and simulation.checksum() == before


def test_scenes_are_refused_with_the_core_s_text():
    with pytest.raises(ValueError, match="cell_size"):
        Simulation(block(cell_size=-1))
    with pytest.raises(ValueError, match="cell_size"):
        Simulation(block(cell_size=float("nan")))
    with pytest.raises(ValueError, match="colour"):
        Simulation(block(colour=1))
    with pytest.raises(ValueError, match="nowhere.yaml"):
        Simulation("nowhere.yaml")
    with pytest.raises(TypeError):
        Simulation(3)
    with pytest.raises(ValueError, match="velocities"):
        Simulation(block()).points(fields=["velocities"])


@pytest.mark.parametrize("method", ["mpm", "mls", "pbd"])
def test_what_is_too_large_is_a_memory_error(method):
    scene = block(cell_size=1e-3, method=method)
    scene["bodies"][0].update(size=[10, 10, 10], pose={"position": [0, 0, 5]})
    with pytest.raises(MemoryError, match="cell_size"):
        Simulation(scene)


def test_poses_in_all_their_forms_are_the_same():
    turn = np.eye(4)
    turn[:3, :3] = np.diag([1, -1, -1])
    sums = set()
    turn[:3, 3] = [0.01, 0, 0.017]
    for pose in ([0.01, 0, 0.017] + DOWN, turn, ToolRequest([0.01, 0, 0.017] + DOWN)):
        simulation = Simulation(block())
        simulation.advance(tools={"probe": pose})
        sums.add(simulation.checksum())
    assert len(sums) == 1


def test_points_of_a_cpu_are_not_on_a_gpu():
    with pytest.raises(RuntimeError, match="not on a GPU: points()"):
        Simulation(block()).points_on_gpu()


@pytest.mark.parametrize("method", ["mpm", "mls", "pbd"])
def test_points_are_read_where_they_lie(method):
    torch = pytest.importorskip("torch")
    if not torch.cuda.is_available():
        pytest.skip("no GPU")
    simulation = Simulation(block(method=method, device="cuda", seed=1))
    for fields in [(), ("velocity", "volume")]:
        kept = {name: torch.from_dlpack(a) for name, a in simulation.points_on_gpu(fields=fields).items()}
        before = simulation.points(fields=fields).copy()
        simulation.advance(cuts=[upright(0.004)])
        simulation.points_on_gpu(fields=fields)
        assert set(kept) == set(before.dtype.names)
        for name, tensor in kept.items():
            assert tensor.is_cuda and tensor.shape == before[name].shape
            assert (tensor.cpu().numpy().view(before[name].dtype) == before[name]).all(), name
        some = simulation.points_on_gpu(stride=3, loose_only=True)["position"]
        assert some.shape == simulation.points(stride=3, loose_only=True)["position"].shape


def test_saved_and_repeated_frames_have_the_same_bits():
    one, other, third = (Simulation(block()) for _ in range(3))
    inputs = [one.advance(tools={"probe": [0, 0, 0.021 - 0.001 * i] + DOWN},
                          anchors={"left": one.anchor("left") + [0, 0, 1e-4, 0, 0, 0, 0]}).input
              for i in range(5)]
    other.restore(one.save())
    third.restore(bytes(one.save()))
    one.advance()
    other.advance()
    third.advance()
    assert one.checksum() == other.checksum() == third.checksum() and other.frame == 6
    again = Simulation(block())
    for applied in inputs:
        again.repeat(applied)
    again.advance()
    assert again.checksum() == one.checksum()
    with pytest.raises(RuntimeError):
        Simulation(block()).restore(b"nothing")


def test_other_threads_run_during_a_frame_and_are_refused_in_it():
    simulation, refused = Simulation(block()), ""
    while not refused:  # until this thread came in the middle of the other's frames
        thread = threading.Thread(target=simulation.settle, kwargs={"speed": 0, "time": 1})
        thread.start()
        while thread.is_alive():
            try:
                simulation.checksum()
            except RuntimeError as e:
                refused = str(e)
        thread.join()
    assert "another thread" in refused and simulation.frame % 60 == 0
    simulation.advance()


def test_settles():
    report = Simulation(block()).settle(speed=1e-3, time=2, damping=50)
    assert report.at_rest and 0.1 <= report.time <= 2 and report.speed < 1e-3


def test_cameras():
    scene = block(cameras=[{"name": "eye", "width": 64, "height": 48,
                            "pose": {"position": [0, 0, 0.1], "orientation": DOWN}}])
    if not tissue_sim.can_render():
        pytest.skip("this build has no Embree")
    simulation = Simulation(scene)
    images = simulation.render("eye")
    assert images.rgb.shape == (48, 64, 3) and images.rgb.dtype == np.uint8
    assert images.labels[24, 32] == 1000
    assert images.depth[24, 32] == pytest.approx(0.1 - 0.016, abs=2e-3)
    assert simulation.render(0, pose=[0, 0, 0.2] + DOWN).depth[24, 32] > 0.15
    assert images.labels[24, 32] == 1000  # the second image has memory of its own
    simulation.advance()
    with pytest.raises(RuntimeError):
        images.depth[0, 0]
    with pytest.raises(ValueError, match="ear"):
        simulation.render("ear")
    assert simulation.render("eye").flow is None


def test_flow_says_how_far_what_is_seen_moved():
    scene = block(cameras=[{"name": "eye", "width": 64, "height": 48, "hfov": 90, "flow": True}])
    if not tissue_sim.can_render():
        pytest.skip("this build has no Embree")
    simulation = Simulation(scene)
    assert np.isnan(np.array(simulation.render("eye", pose=[0, 0, 0.1] + DOWN).flow)).all()
    # The eye goes along the world's x by a tenth of its depth above the tissue.
    seen = simulation.render("eye", pose=[0.1 * (0.1 - 0.016), 0, 0.1] + DOWN)
    flow = np.array(seen.flow)[24, 32]
    assert abs(flow[0]) == pytest.approx(0.1 * 32, rel=0.02) and flow[1] == pytest.approx(0, abs=0.01)
    still = np.array(simulation.render("eye", pose=[0.1 * (0.1 - 0.016), 0, 0.1] + DOWN).flow)[24, 32]
    assert still == pytest.approx([0, 0], abs=1e-3)


def test_stubs_name_what_the_module_has():
    import ast
    import tissue_sim._core as core
    with open(os.path.join(os.path.dirname(tissue_sim.__file__), "__init__.pyi")) as file:
        tree = ast.parse(file.read())
    stubs = {n.name: n for n in tree.body if isinstance(n, (ast.ClassDef, ast.FunctionDef))}
    assert set(stubs) == set(tissue_sim.__all__)
    for name, node in stubs.items():
        if isinstance(node, ast.ClassDef) and hasattr(core, name):
            said = {n.target.id if isinstance(n, ast.AnnAssign) else n.name for n in node.body
                    if isinstance(n, (ast.AnnAssign, ast.FunctionDef))}
            has = {n for n in vars(getattr(core, name)) if not n.startswith("_")}
            assert {n for n in said if not n.startswith("_")} == has, name
