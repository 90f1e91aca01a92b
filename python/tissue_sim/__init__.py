"""Soft tissue that instruments press, pull and cut: docs/python.md.

    simulation = tissue_sim.Simulation("scene.yaml")
    report = simulation.advance(tools={"probe": [0, 0, 0.03]})
    points = simulation.points()
"""
import importlib
import pkgutil

# The package's ROS messages may lie in another folder of this name.
__path__ = pkgutil.extend_path(__path__, __name__)

__all__ = ["AppliedInput", "Array", "CutReport", "FrameReport", "FrameResult", "GpuArray", "Images", "Momentum",
           "SettleReport", "Simulation", "Surface", "ToolLoad", "ToolMotion", "ToolRequest", "Wrench",
           "can_render", "from_yaml", "load_scene", "scene_to_yaml"]


def __getattr__(name):
    # Loaded when first asked for: who wants tissue_sim.msg alone need not load the core.
    if name not in __all__:
        raise AttributeError("module 'tissue_sim' has no attribute %r" % name)
    module = "array" if name in ("Array", "Images", "Surface") else "_core"
    value = getattr(importlib.import_module("tissue_sim." + module), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted(set(globals()) | set(__all__))
