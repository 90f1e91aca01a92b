import os
from typing import Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

Pose = Any  # (3,) x y z [m], (7,) x y z qx qy qz qw, or a (4, 4) matrix
Cut = Tuple[Any, Any]  # edge (n, 3) [m], poses (m, 3), (m, 7) or (m, 4, 4)
Scene = Union[Dict[str, Any], str, "os.PathLike[str]"]

class Array:
    dtype: np.dtype
    shape: Tuple[int, ...]
    def __array__(self, dtype: Any = ..., copy: Optional[bool] = ...) -> np.ndarray: ...
    def __getitem__(self, key: Any) -> Any: ...
    def __len__(self) -> int: ...
    def __getattr__(self, name: str) -> Any: ...
    def copy(self) -> np.ndarray: ...

class GpuArray:
    shape: Tuple[int, ...]
    def __dlpack__(self, stream: Any = ..., **newer: Any) -> Any: ...
    def __dlpack_device__(self) -> Tuple[int, int]: ...

class Surface(NamedTuple):
    corners: Array
    rest: Array
    fragment: Array
    point: Array
    cut: Array

class Images(NamedTuple):
    rgb: Array
    depth: Array
    labels: Array
    flow: Optional[Array]

class ToolRequest:
    pose: np.ndarray
    jaw: Optional[float]
    placed: bool
    grip_pressure: Optional[float]
    def __init__(self, pose: Pose, jaw: Optional[float] = ..., placed: bool = ...,
                 grip_pressure: Optional[float] = ...) -> None: ...

class ToolMotion:
    present: bool
    begin: np.ndarray
    end: np.ndarray
    jaw_begin: float
    jaw_end: float

class Wrench:
    force: np.ndarray
    torque: np.ndarray

class ToolLoad:
    mean: Wrench
    peak_force: float
    grip: float
    grip_area: float
    points_inside: int
    inside_depth: float

class CutReport:
    bonds_broken: int
    points_separated: int
    new_fragments: List[int]
    pieces_left_whole: int
    why_left_whole: str

class FrameResult:
    loads: List[ToolLoad]
    points_inside: int
    inside_depth: float
    cut_reports: List[CutReport]
    anchor_loads: List[Wrench]
    blade_report: CutReport
    tear_report: CutReport
    substeps: int
    substep: float
    kinetic_energy: float
    elastic_energy: float
    cutting_work: float
    max_speed: float
    blew_up: bool

class AppliedInput:
    frame: int
    tools: List[ToolMotion]

class FrameReport:
    input: AppliedInput
    result: FrameResult
    cfl: float
    compute_time: float
    notes: List[str]

class SettleReport:
    at_rest: bool
    time: float
    speed: float

class Momentum:
    mass: float
    centre: np.ndarray
    linear: np.ndarray
    angular: np.ndarray

class Simulation:
    scene: Dict[str, Any]
    tools: List[ToolMotion]
    frame: int
    time: float
    point_count: int
    fragment_count: int
    device_name: str
    notes: List[str]
    generation: int
    def __init__(self, scene: Scene) -> None: ...
    def advance(self, tools: Union[None, Dict[str, Any], Sequence[Any]] = ...,
                cuts: Iterable[Cut] = ...,
                anchors: Union[None, Dict[str, Pose], Sequence[Any]] = ...,
                gravity: Any = ..., damping: Optional[float] = ...) -> FrameReport: ...
    def repeat(self, input: AppliedInput) -> FrameReport: ...
    def settle(self, speed: float = ..., time: float = ..., damping: float = ...) -> SettleReport: ...
    def points(self, stride: int = ..., surface_only: bool = ..., loose_only: bool = ...,
               fields: Sequence[str] = ...) -> Array: ...
    def points_on_gpu(self, stride: int = ..., surface_only: bool = ..., loose_only: bool = ...,
                      fields: Sequence[str] = ...) -> Dict[str, GpuArray]: ...
    def surface(self) -> Surface: ...
    def render(self, camera: Union[int, str] = ..., pose: Optional[Pose] = ...) -> Images: ...
    def fragments(self) -> np.ndarray: ...
    def save(self) -> np.ndarray: ...
    def restore(self, saved: Any) -> None: ...
    def checksum(self) -> int: ...
    def momentum(self) -> Momentum: ...
    def anchor(self, which: Union[int, str]) -> np.ndarray: ...

def can_render() -> bool: ...
def from_yaml(text: str) -> Any: ...
def load_scene(path: Union[str, "os.PathLike[str]"]) -> Dict[str, Any]: ...
def scene_to_yaml(scene: Scene) -> str: ...
