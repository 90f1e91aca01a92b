"""Gymnasium environments: an instrument and soft tissue. Importing this registers
tissue_sim/Grasp-v0, Retract-v0, CutPath-v0 and Dissect-v0 (docs/python.md#environments).

    import gymnasium, tissue_sim.gym
    env = gymnasium.make("tissue_sim/Retract-v0")

An action moves the instrument's tip, each component from -1 to 1; the reward has LapGym's parts
(Scheikl et al. 2023): what came nearer in this step, a price for harm, a bonus at the goal. An
episode is terminated at the goal and truncated after `steps`."""
import copy

import gymnasium
import numpy as np

from tissue_sim import Simulation, ToolRequest

HALF = 0.7071067811865476
DOWN = [HALF, HALF, 0.0, 0.0]  # the shaft above, jaws open along y, a blade cuts towards +y
FLAT = [0.0, HALF, HALF, 0.0]  # the shaft along -y, a blade cuts towards -x
SOFT = {"name": "soft", "young_modulus": 3000, "poisson_ratio": 0.4, "viscosity": 2}


def look_at(eye, target):
    """The pose of a camera at `eye` that sees `target`, up in its image being up: (4, 4)."""
    z = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
    x = np.cross(z, [0.0, 0.0, 1.0])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], 1)
    pose[:3, 3] = eye
    return pose


class TissueEnv(gymnasium.Env):
    """What the environments share. observation: "state", a vector (float32, metres, parts of it about
    the goal), or "image", what a camera sees (uint8, by Embree). frames: of 1/60 s, in a step."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 30}
    scene = {}       # the scene, but for its camera
    low, high = [-0.06, -0.05, 0.001], [0.06, 0.05, 0.08]  # where the tip may be [m]
    speed = 0.002    # of the tip at most [m a step]
    moves = 3        # components of an action
    state_size = 0

    def __init__(self, observation="state", render_mode=None, width=96, height=72, frames=2, steps=150,
                 device="cpu"):
        if observation not in ("state", "image"):
            raise ValueError("observation is %r: must be state or image" % observation)
        if render_mode not in (None, "rgb_array"):
            raise ValueError("render_mode is %r: must be rgb_array or None" % render_mode)
        self.observation, self.render_mode, self.frames, self.steps = observation, render_mode, frames, steps
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (self.moves,), np.float32)
        if observation == "state":
            self.observation_space = gymnasium.spaces.Box(-10.0, 10.0, (self.state_size,), np.float32)
        else:
            self.observation_space = gymnasium.spaces.Box(0, 255, (height, width, 3), np.uint8)
        self._scene = dict(copy.deepcopy(self.scene), device=device, threads=1)
        if observation == "image" or render_mode:
            self._scene["cameras"] = [{"name": "eye", "width": width, "height": height, "hfov": 45}]
        self.simulation = None

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        self.simulation, self.step_count = Simulation(self._scene), 0
        self._rest = self.simulation.points(fields=["rest"])["rest"].copy()
        self._begin()
        self._report = self.simulation.advance(**self._request())
        self._far = self._distance()
        return self._observe(), {"is_success": False}

    def step(self, action):
        action = np.clip(np.asarray(action, np.float64), -1, 1)
        if action.shape != (self.moves,) or not np.isfinite(action).all():
            raise ValueError("an action has %d finite components" % self.moves)
        begin, jaw = self.tip.copy(), self.jaw
        self._move(action)
        end, to, harm = self.tip.copy(), self.jaw, 0.0
        for frame in range(1, self.frames + 1):
            part = frame / self.frames
            self.tip, self.jaw = begin + part * (end - begin), jaw + part * (to - jaw)
            self._report = self.simulation.advance(**self._request())
            harm += self._harm()
            if self._report.result.blew_up:
                break
        self.step_count += 1
        lost = self._report.result.blew_up  # no way on from here
        far = self._far if lost else self._distance()
        success = not lost and self._success(far)
        reward = 100 * (self._far - far) - 0.01 - harm + 10 * success - 10 * lost
        self._far = far
        return (self._observe(), float(reward), bool(success or lost), self.step_count >= self.steps,
                {"is_success": bool(success), "distance": float(far), "harm": float(harm)})

    def render(self):
        return self._picture() if self.render_mode == "rgb_array" else None

    # What an environment says of itself.
    def _begin(self):
        """Places the tip and the goal, drawn by self.np_random."""
        raise NotImplementedError

    def _distance(self):
        """From the goal [m]; what is left of a cut counts by its length."""
        raise NotImplementedError

    def _state(self):
        raise NotImplementedError

    def _success(self, far):
        return far < 0.003

    def _harm(self):
        """The price of the last frame: force above 2 N on the tool, by default."""
        return 0.05 * sum(max(0.0, load.peak_force - 2) for load in self._report.result.loads)

    def _request(self):
        return {"tools": [ToolRequest(np.concatenate([self.tip, self.turn]), float(self.jaw))]}

    def _move(self, action):
        self.tip = np.clip(self.tip + self.speed * action[:3], self.low, self.high)

    jaw, turn = 0.0, DOWN

    def _observe(self):
        if self.observation == "image":
            return self._picture()
        return np.clip(20 * np.concatenate(self._state()), -10, 10).astype(np.float32)

    def _picture(self):
        return self.simulation.render("eye", look_at([0.03, -0.13, 0.09], [0, 0, 0.015])).rgb.copy()

    def _points(self, near):
        """The mean place of the points that were within 4 mm of a place at rest, or nearest to it."""
        far = np.linalg.norm(self._rest - near, axis=1)
        chosen = far < max(0.004, far.min() * 1.0001)
        return np.asarray(self.simulation.points()["position"])[chosen].astype(float).mean(0)


def _slab(size, anchors, **more):
    return dict({"cell_size": 0.004, "damping": 5, "materials": [dict(SOFT)], "bodies": [
        {"name": "tissue", "material": "soft", "size": size, "pose": {"position": [0, 0, size[2] / 2]},
         "anchors": anchors}]}, **more)


class Retract(TissueEnv):
    """A flap, held along one side and in a clamp at the other, is to be drawn aside: the clamp's middle
    to a goal above it. State (9): clamp, goal, from one to the other."""

    scene = _slab([0.048, 0.032, 0.008],
                  [{"name": "wall", "box": {"min": [-1, -1, -1], "max": [-0.016, 1, 1]}},
                   {"name": "clamp", "box": {"min": [0.016, -0.008, -1], "max": [1, 0.008, 1]}}])
    state_size = 9

    def _begin(self):
        self.tip = np.array(self.simulation.anchor("clamp")[:3])
        self._origin = self.tip.copy()
        self.low, self.high = self.tip + [-0.03, -0.015, 0], self.tip + [0.008, 0.015, 0.03]
        self.goal = self.tip + self.np_random.uniform([-0.02, -0.01, 0.012], [-0.008, 0.01, 0.022])

    def _request(self):
        return {"anchors": {"clamp": self.tip}}

    def _distance(self):
        return float(np.linalg.norm(self.tip - self.goal))

    def _harm(self):
        return 0.05 * max(0.0, float(np.linalg.norm(self._report.result.anchor_loads[1].force)) - 2)

    def _state(self):
        return self.tip - self._origin, self.goal - self._origin, self.goal - self.tip


class Grasp(TissueEnv):
    """A fold that stands, held at one end: its free end is to be taken by the jaws and lifted to 10 mm
    above where it was. Action (4): the tip and the jaws, closing below 0. State (11): tip, jaw, the free
    end, from tip to it, how far it is to be lifted yet."""

    scene = _slab([0.05, 0.008, 0.02],
                  [{"box": {"min": [-1, -1, -1], "max": [-0.013, 1, 1]}}], cell_size=0.0025, tools=[
                      {"name": "grasper", "type": "grasper", "jaw_length": 0.015, "jaw_width": 0.005,
                       "grip_pressure": 1500, "friction": 0.5}])
    low, high = [0.0, -0.02, 0.006], [0.04, 0.02, 0.05]
    moves, state_size = 4, 11

    def _begin(self):
        self.tip = self.np_random.uniform([0.010, -0.004, 0.036], [0.020, 0.004, 0.042])
        self.jaw = 1.6
        self.end = np.array([0.016, 0.0, 0.016])
        self._height = self._points(self.end)[2]

    def _move(self, action):
        super()._move(action)
        self.jaw = float(np.clip(self.jaw + 0.2 * action[3], -0.4, 1.6))

    def _lift(self):
        return max(0.0, self._height + 0.010 - self._points(self.end)[2])

    def _distance(self):  # to the end, then upwards
        end = self._points(self.end)
        reach = np.linalg.norm(self.tip + [0, 0, 0.002] - end)
        return max(0.0, float(reach) - 0.006) + 3 * self._lift()

    def _success(self, far):
        return self._lift() == 0.0

    def _state(self):
        end = self._points(self.end)
        return (self.tip, [self.jaw / 20], end, end - self.tip, [self._lift()])


class _Cut(TissueEnv):
    """What is to be parted: rest points by which sides of a wanted cut are told."""

    def _opened(self, where):
        """Which of the points of a mask have lost a bond."""
        return np.asarray(self.simulation.points()["damage"])[where] > 0

    def _harm(self):
        harm = super()._harm()
        spoilt = int(self._opened(self._else).sum())
        new, self._spoilt = max(0, spoilt - self._spoilt), max(spoilt, self._spoilt)
        return harm + 0.02 * new


class CutPath(_Cut):
    """A slab with a line on it, 40 mm along y, at an x that is drawn: a scalpel is to cut along it, and
    nowhere else. State (9): tip, where the line goes on, from tip to there."""

    scene = _slab([0.048, 0.048, 0.012], [{"below": 0.002}], tools=[
        {"name": "scalpel", "type": "scalpel", "blade_length": 0.03, "blade_width": 0.004}])
    low, high = [-0.03, -0.035, 0.002], [0.03, 0.035, 0.03]
    state_size = 9

    def _begin(self):
        self.line = self.np_random.uniform(-0.012, 0.012)
        self.tip = np.array([self.line + self.np_random.uniform(-0.006, 0.006), -0.032, 0.016])
        x, y, z = self._rest.T
        self._wanted = (np.abs(x - self.line) < 0.0025) & (np.abs(y) < 0.02) & (z > 0.008)
        self._else = np.abs(x - self.line) > 0.004
        self._spoilt = 0
        self._rows = np.unique(np.round(y[self._wanted], 5))

    def _next(self):
        """The y of the line's first row that is whole; its end where there is none."""
        y = np.round(self._rest[:, 1], 5)
        done = set(y[self._wanted][self._opened(self._wanted)])
        left = [row for row in self._rows if row not in done]
        return (left[0] if left else 0.024), len(left) / len(self._rows)

    def _goal(self):
        return np.array([self.line, self._next()[0], 0.006])

    def _distance(self):
        return 0.3 * float(np.linalg.norm(self.tip - self._goal())) + 0.1 * self._next()[1]

    def _success(self, far):
        return self._next()[1] == 0.0

    def _state(self):
        goal = self._goal()
        return self.tip, goal, goal - self.tip


class Dissect(_Cut):
    """A layer lies on an organ, joined by a soft plane between them, and is drawn up a little at its free
    side: the plane is to be cut through from there, the layer and the organ to stay whole. The scalpel
    lies flat. State (9): tip, where the plane goes on, from tip to there."""

    scene = _slab([0.040, 0.024, 0.020], [{"below": 0.002}, {
        "name": "clamp", "box": {"min": [0.008, -0.008, 0.017], "max": [1, 0.008, 1]}}], tools=[
        {"name": "scalpel", "type": "scalpel", "blade_length": 0.04, "blade_width": 0.003,
         "blade_thickness": 0.0004}])
    scene["materials"].append(dict(SOFT, name="weak", young_modulus=1000))
    scene["bodies"][0]["inclusions"] = [
        {"material": "weak", "region": {"box": {"min": [-1, -1, 0.010], "max": [1, 1, 0.014]}}}]
    low, high = [-0.03, 0.012, 0.004], [0.035, 0.02, 0.02]
    state_size, turn = 9, FLAT

    def _begin(self):
        self._clamp = self.simulation.anchor("clamp")[:3]
        self.plane = 0.012
        self.tip = np.array([0.030, 0.018, self.plane + self.np_random.uniform(-0.002, 0.002)])
        x, _, z = self._rest.T
        self._wanted = (np.abs(z - self.plane) < 0.0025) & (x > -0.008)
        self._else = np.abs(z - self.plane) > 0.0045
        self._spoilt = 0
        self._rows = np.unique(np.round(x[self._wanted], 5))[::-1]

    def _next(self):
        x = np.round(self._rest[:, 0], 5)
        done = set(x[self._wanted][self._opened(self._wanted)])
        left = [row for row in self._rows if row not in done]
        return (left[0] if left else -0.008), len(left) / len(self._rows)

    def _goal(self):
        return np.array([self._next()[0], 0.018, self.plane])

    _distance, _success, _state = CutPath._distance, CutPath._success, CutPath._state

    def _request(self):  # the clamp draws the layer up
        return dict(super()._request(), anchors={"clamp": self._clamp + [0, 0, 0.002]})


for _env in (Retract, Grasp, CutPath, Dissect):
    gymnasium.register("tissue_sim/%s-v0" % _env.__name__, entry_point=_env)
