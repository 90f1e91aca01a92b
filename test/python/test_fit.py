"""Made-up data give their material back."""
import subprocess
import sys

import numpy as np
import pytest

import tissue_sim
from tissue_sim.fit import PARAMETERS, channels_of, fit, predict, scales_of
from tissue_sim.runs import read_table

pytest.importorskip("scipy")

TRUE = {"young_modulus": 5000.0, "poisson_ratio": 0.42, "viscosity": 15.0}
SCENE = {"cell_size": 0.005, "device": "cpu", "damping": 2, "frame_rate": 120,
         "materials": [dict(TRUE, name="gel", density=1000)],
         "bodies": [{"name": "block", "material": "gel", "size": [0.06, 0.05, 0.03],
                     "pose": {"position": [0, 0, 0.015]}, "anchors": [{"below": 0.0025}]}],
         "tools": [{"name": "ball", "type": "ball", "radius": 0.010}]}


def pressing(noise, seed=5):
    """What a ball feels, and markers show, that goes 6 mm into gel in 50 ms, stays, and leaves."""
    t = np.linspace(0, 0.25, 61)
    data = {"t": t, "x": 0 * t, "y": 0 * t,
            "z": 0.0305 - 0.0065 * np.interp(t, [0, 0.05, 0.12, 0.17, 1], [0, 1, 1, 0, 0]),
            "fz": 0 * t}
    for name, at in (("a", [0.0299, 0, 0.02]), ("b", [0, 0.0249, 0.02]), ("c", [0.015, 0, 0.0299])):
        data.update({"%s.%s" % (name, axis): x + 0 * t for axis, x in zip("xyz", at)})
    scene = tissue_sim.from_yaml(tissue_sim.scene_to_yaml(SCENE))
    data.update(predict((scene, data)))
    draw, scales = np.random.RandomState(seed), scales_of(data)
    for name, scale in scales.items():
        first = data[name][0]
        data[name] = data[name] + noise * scale * draw.standard_normal(len(t))
        if "." in name:
            data[name][0] = first  # a marker starts where it is
    return scene, data


def test_made_up_data_with_noise_give_the_material_back():
    scene, data = pressing(0.02)
    assert channels_of(data) == (["fz"], ["a", "b", "c"])
    scene["materials"][0].update(young_modulus=3500.0, poisson_ratio=0.35, viscosity=8.0)
    result = fit(scene, data, list(PARAMETERS))
    values, deviation = result["values"], np.sqrt(np.diag(result["covariance"]))
    print(values, deviation, result["runs"])
    assert abs(values["young_modulus"] / TRUE["young_modulus"] - 1) < 0.02
    assert abs(values["poisson_ratio"] - TRUE["poisson_ratio"]) < 0.02
    assert abs(values["viscosity"] / TRUE["viscosity"] - 1) < 0.10
    error = np.abs([values[n] - TRUE[n] for n in PARAMETERS])
    assert (error < 4 * deviation).all() and 0.015 < result["rms"] < 0.025


def test_the_command_writes_what_it_found(tmp_path):
    pytest.importorskip("distributed")
    pytest.importorskip("matplotlib")
    scene, data = pressing(0.0)
    scene["materials"][0]["young_modulus"] = 4500.0
    (tmp_path / "scene.yaml").write_text(tissue_sim.scene_to_yaml(scene))
    np.savetxt(str(tmp_path / "data.csv"), np.stack(list(data.values()), 1), delimiter=",",
               header=",".join(data), comments="")
    assert list(read_table(str(tmp_path / "data.csv"))) == list(data)
    subprocess.run([sys.executable, "-m", "tissue_sim.fit", str(tmp_path / "data.csv"), "--scene",
                    str(tmp_path / "scene.yaml"), "--fit", "young_modulus", "--processes", "2"],
                   check=True, timeout=300)
    found = tissue_sim.from_yaml((tmp_path / "data" / "fit.yaml").read_text())
    assert found["values"]["young_modulus"] == pytest.approx(5000, rel=2e-3)
    assert (tmp_path / "data" / "fit.png").stat().st_size > 1000


def test_data_that_tell_nothing_are_refused():
    t = np.linspace(0, 0.1, 5)
    with pytest.raises(ValueError, match="neither"):
        channels_of({"t": t, "x": t})
    with pytest.raises(ValueError, match="column a.z"):
        channels_of({"t": t, "a.x": t, "a.y": t})
    with pytest.raises(ValueError, match="zero"):
        scales_of({"t": t, "fz": 0 * t})
