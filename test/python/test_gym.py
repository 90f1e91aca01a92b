"""Environments: Gymnasium's own checker, the same episode for the same seed, and that each goal can be
reached, by a plain policy."""
import numpy as np
import pytest

import tissue_sim

gymnasium = pytest.importorskip("gymnasium")
import tissue_sim.gym  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402

NAMES = ["Grasp", "Retract", "CutPath", "Dissect"]


def make(name, **more):
    return gymnasium.make("tissue_sim/%s-v0" % name, **more)


@pytest.mark.parametrize("name", NAMES)
def test_checker_passes(name):
    check_env(make(name).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", NAMES)
def test_images_are_observations(name):
    if not tissue_sim.can_render():
        pytest.skip("this build has no Embree")
    env = make(name, observation="image", render_mode="rgb_array").unwrapped
    seen = env.reset(seed=1)[0]
    assert seen.shape == (72, 96, 3) and seen.dtype == np.uint8 and seen.std() > 5
    assert (env.render() == seen).all()


def towards(env, goal):
    return np.clip((np.asarray(goal) - env.tip) / env.speed, -1, 1)


def retract(env):
    return towards(env, env.goal)


def grasp(env):
    at = np.array([0.018, 0.0, 0.012])
    if not hasattr(env, "phase") or env.step_count == 0:
        env.phase = 0
    close = 1.0
    if env.phase == 0:
        goal = at + [0, 0, 0.02]
    elif env.phase == 1:
        goal = at
    elif env.phase == 2:
        goal, close = at, -1.0
    else:
        goal, close = at + [-0.004, 0, 0.025], -0.0
    reached = np.linalg.norm(env.tip - goal) < 1e-3
    if env.phase in (0, 1) and reached or env.phase == 2 and env.jaw <= 0.0:
        env.phase += 1
    return np.concatenate([towards(env, goal), [close]])


def cut_path(env):
    if env.tip[1] < -0.0265 and abs(env.tip[0] - env.line) > 1e-4 or env.tip[2] > 0.0062:
        return towards(env, [env.line, -0.030, 0.006])
    return towards(env, [env.line, 0.035, 0.006])


def dissect(env):
    if env.tip[0] > 0.022 and abs(env.tip[2] - env.plane - 0.0005) > 1e-4:
        return towards(env, [0.028, 0.018, env.plane + 0.0005])
    return towards(env, [-0.03, 0.018, env.plane + 0.0005])


@pytest.mark.parametrize("name, policy", list(zip(NAMES, [grasp, retract, cut_path, dissect])))
def test_goal_is_reached_and_worth_it(name, policy):
    env = make(name).unwrapped

    def episode(act):
        env.reset(seed=3)
        env.action_space.seed(3)
        total, rewards, done = 0.0, [], False
        while not done:
            _, reward, terminated, truncated, info = env.step(act(env))
            rewards.append(reward)
            done = terminated or truncated
        return sum(rewards), rewards, info
    good, rewards, info = episode(policy)
    assert info["is_success"], (info, good, len(rewards), env.tip)
    assert episode(policy)[1] == rewards
    at_random, _, other = episode(lambda env: env.action_space.sample())
    assert good > at_random + 5 and not other["is_success"]


def test_nonsense_is_refused():
    with pytest.raises(ValueError):
        make("Grasp", observation="sound")
    env = make("Retract").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError):
        env.step([np.nan, 0, 0])
