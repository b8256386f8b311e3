# SPDX-License-Identifier: Apache-2.0
"""The environments of Gymnasium: checked, seeded, deterministic, alone and many in one process."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AsyncVectorEnv
from plants import joint, link, robot

from control_board_ros.core.terms.vocabs import ControlMode
from control_board_ros.gym import TASKS
from control_board_ros.gym.arms import CONTROLS, NUMBERS, Arms
from control_board_ros.gym.env import FAULT, ArmEnv, FleetEnv
from control_board_ros.settings.loading import load


def named(task: str) -> str:
    return f"control_board_ros/{task}-v0"


@pytest.fixture
def env() -> Iterator[ArmEnv]:
    made = ArmEnv("Reach", control="velocity")
    yield made
    made.close()


@pytest.mark.parametrize(
    "name", ["control_board_ros/Reach-v0", "control_board_ros.gym:control_board_ros/Reach-v0"]
)
def test_an_import_or_the_name_registers(name: str) -> None:
    """As a new program does it: Gymnasium 1.x loads no plug-in of its own."""
    imported = "" if ":" in name else "import control_board_ros.gym; "
    made = f"import gymnasium; {imported}print(gymnasium.make({name!r}).spec.id)"
    done = subprocess.run(
        [sys.executable, "-c", made], capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == "control_board_ros/Reach-v0", done.stderr


@pytest.mark.parametrize("robot", ["icub_left_arm", "icub"])
def test_an_episode_begins_calibrated(robot: str) -> None:
    """A robot whose joints calibrate at power-on moves in the first step, at its home."""
    pytest.importorskip("icub_models", reason="extra icub")
    made = ArmEnv("Reach", robot=robot)
    seen, _ = made.reset(seed=1)
    assert set(seen["mode"]) == {NUMBERS[ControlMode.VELOCITY]}
    placed = made._episodes.arms.target[0]
    assert seen["position"] == pytest.approx(placed, abs=5e-3)
    push = np.zeros(made.action_space.shape, dtype=np.float32)
    push[0] = 1.0
    before = seen["position"][0]
    for _ in range(10):
        seen, _, terminated, _, info = made.step(push)
        assert not terminated, info
    assert seen["position"][0] > before + 0.005
    made.close()


@pytest.mark.parametrize(
    "task", ["Reach", *(pytest.param(t, marks=pytest.mark.slow) for t in TASKS if t != "Reach")]
)
def test_gymnasium_finds_nothing_wrong(task: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """check_env without a warning: spaces, seeds, determinism, both ways to render."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    made = gymnasium.make(named(task))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made.unwrapped)
    made.close()


@pytest.mark.parametrize("action", [np.nan, np.inf, -np.inf, 3.0, -1e30])
def test_an_action_costs_what_the_board_gets(action: float) -> None:
    """One beyond ±1 is the bound, for the reward as well; a NaN is none; all stays finite."""
    bound = 0.0 if np.isnan(action) else float(np.clip(action, -1.0, 1.0))
    rewards = []
    for value in (action, bound):
        made = ArmEnv("Reach", control="velocity", physics="ideal")
        made.reset(seed=3)
        values = np.full(7, value, np.float32)
        shown, reward, *_ = made.step(values)
        assert made.observation_space.contains(shown)
        rewards.append(reward)
        made.close()
    assert rewards[0] == pytest.approx(rewards[1], abs=1e-9)
    fleet = FleetEnv(2, task="Reach", control="velocity")
    fleet.reset(seed=3)
    shown, both, *_ = fleet.step(np.array([[action] * 7, [0.5] * 7], np.float32))
    assert np.isfinite(both).all()
    assert all(np.isfinite(values).all() for values in shown.values())
    fleet.close()


@pytest.mark.parametrize("control", CONTROLS)
def test_each_control_has_its_mode(control: str) -> None:
    """M1: an action space for every control mode, whose mode the observation shows."""
    made = ArmEnv("Track", control=control)
    shown, _ = made.reset(seed=1)
    width = CONTROLS[control].width
    assert made.action_space.shape == (width * 7,)
    assert set(shown["mode"]) == {NUMBERS[CONTROLS[control].mode]}
    before = shown["position"]
    for _ in range(3):
        shown, reward, *_ = made.step(np.full(width * 7, 0.2, np.float32))
    assert np.abs(shown["position"] - before).max() > 1e-3
    assert made.observation_space.contains(shown)
    assert np.isfinite(reward)
    made.close()


def rollout(made: Any, seed: int) -> list[Any]:
    made.action_space.seed(seed)
    shown, _ = made.reset(seed=seed)
    found = [shown]
    for _ in range(5):
        shown, reward, *_ = made.step(made.action_space.sample())
        found.append((shown, reward))
    return found


def test_a_seed_makes_the_same_episode_again(env: ArmEnv) -> None:
    """To the bit: in the same environment, and in a new one."""
    first = rollout(env, 5)
    np.testing.assert_equal(rollout(env, 5), first)
    other = ArmEnv("Reach", control="velocity")
    np.testing.assert_equal(rollout(other, 5), first)
    other.close()
    assert not np.array_equal(rollout(env, 6)[0]["to_goal"], first[0]["to_goal"])


def test_the_tip_is_where_the_physics_has_it(env: ArmEnv) -> None:
    """Forward kinematics of the task against MuJoCo's."""
    shown, _ = env.reset(seed=2)
    for _ in range(4):
        shown, *_ = env.step(np.full(7, 0.5, np.float32))
    body = env._episodes.arms.body
    np.testing.assert_allclose(shown["tip"], body.link_position(6), atol=2e-4)


def test_reaching_ends_an_episode(env: ArmEnv) -> None:
    """A goal at the tip is reached."""
    env.reset(seed=2)
    arms, task = env._episodes.arms, env._episodes.task
    task._goal[0] = arms.tips(arms.position)[0]
    _, reward, terminated, _, info = env.step(np.zeros(7, np.float32))
    assert terminated
    assert info["is_success"]
    assert reward > 0.9


def test_a_fault_is_seen_and_ends_an_episode(env: ArmEnv) -> None:
    """F1: the observation has the fault and the mode, info the reason; a reset clears it."""
    env.reset(seed=2)
    env._episodes.arms.plant.inject(0, "external", persistent=True)
    shown, reward, terminated, _, info = env.step(np.zeros(7, np.float32))
    assert terminated
    assert reward == FAULT
    assert shown["fault"].any()
    assert NUMBERS[env._episodes.arms.board.get_control_mode()[0]] == shown["mode"][0]
    assert "lbr_iiwa_joint_1" in info["faults"][0]
    shown, _ = env.reset()
    assert not shown["fault"].any()


def test_soft_joints_give_way_to_a_push() -> None:
    """I5, I6: pushes move a soft arm further than a stiff one; softness is worth more."""
    ends, worth = [], []
    for stiff in (-0.9, 1.0):
        made = ArmEnv("Impedance")
        made.reset(seed=4)
        action = np.concatenate([np.zeros(7), np.full(14, stiff)]).astype(np.float32)
        seen = [made.step(action) for _ in range(19)]
        ends.append(max(np.abs(one[0]["position"] - one[0]["target"]).max() for one in seen))
        worth.append(seen[0][1])
        made.close()
    assert ends[0] > 3 * ends[1]
    assert worth[0] > worth[1]


@pytest.mark.parametrize("task", TASKS)
def test_a_joint_without_limits_begins_within_a_turn(task: str, tmp_path: Path) -> None:
    """Its limits are 1e6 rad, where float32 has steps of 0.06 rad."""
    hinge = joint("hinge", "base", "rod", kind="continuous")
    path = tmp_path / "wheel.urdf"
    path.write_text(robot(link("rod", 1.0, "0.3 0 0", "0.01 0.01 0.01 0 0 0"), hinge))
    made = ArmEnv(task, robot=str(path), control="position")
    for seed in range(10):
        seen, _ = made.reset(seed=seed)
        assert np.abs(seen["position"]) <= np.pi
    made.step(np.ones(1, np.float32))
    assert made._episodes.arms.target == pytest.approx(np.pi)
    made.close()


def test_a_nan_is_no_action_and_the_next_one_acts() -> None:
    made = ArmEnv("Track", control="direct")
    made.reset(seed=1)
    action = np.zeros(7, np.float32)
    action[0] = np.nan
    made.step(action)
    before = made._episodes.arms.target.copy()
    assert np.isfinite(before).all()
    action[0] = 1.0
    made.step(action)
    assert made._episodes.arms.target[0, 0] > before[0, 0]
    made.close()


def test_a_nan_leaves_the_stiffness_of_its_joint_and_of_no_other_one() -> None:
    made = FleetEnv(2, task="Impedance")
    made.reset(seed=1)
    before, _ = made._episodes.arms.board.get_impedance()
    actions = np.full((2, 21), 0.5, np.float32)
    actions[1, 7] = np.nan  # the stiffness of the second arm's first joint
    made.step(actions)
    after, _ = made._episodes.arms.board.get_impedance()
    full = np.tile(made._episodes.arms.max_stiffness, 2)
    expected = 0.75 * full
    expected[7] = before[7]
    assert after == pytest.approx(expected)
    made.close()


def test_bad_arguments_are_one_line() -> None:
    with pytest.raises(ValueError, match="control 'speed' unknown; one of position, direct"):
        ArmEnv(control="speed")
    with pytest.raises(ValueError, match="task 'Reech' unknown; did you mean 'Reach'"):
        ArmEnv("Reech", control="velocity")
    with pytest.raises(ValueError, match="did you mean 'impedance'"):
        ArmEnv(control="impedence")
    with pytest.raises(ValueError, match="rate 500 Hz is not allowed; above 0, up to 250 Hz"):
        ArmEnv(rate=500.0)
    with pytest.raises(ValueError, match="rate 0 Hz is not allowed"):
        ArmEnv(rate=0.0)
    with pytest.raises(ValueError, match="num_envs 0 is not allowed"):
        FleetEnv(0)
    made = ArmEnv("Track", physics="ideal", render_mode="rgb_array")
    with pytest.raises(ValueError, match="no pictures"):
        made.render()


def test_async_vector_env() -> None:
    """Gymnasium's own vector environment takes them, a process each."""
    vector = AsyncVectorEnv([lambda: gymnasium.make(named("Reach"))] * 2)
    shown, _ = vector.reset(seed=1)
    assert shown["position"].shape == (2, 7)
    shown, reward, *_ = vector.step(vector.action_space.sample())
    assert reward.shape == (2,)
    vector.close()


def test_make_vec_is_many_arms_in_one_process() -> None:
    """Every arm's episode is its own: seeds, ends and a new beginning in the step after."""
    fleet = gymnasium.make_vec(named("Reach"), num_envs=3, vectorization_mode="vector_entry_point")
    assert isinstance(fleet.unwrapped, FleetEnv)
    shown, _ = fleet.reset(seed=7)
    alone = ArmEnv("Reach")
    for k in range(3):
        goal, _ = alone.reset(seed=7 + k)
        np.testing.assert_allclose(shown["position"][k], goal["position"], atol=1e-4)
        np.testing.assert_allclose(shown["to_goal"][k], goal["to_goal"], atol=1e-3)
    alone.close()
    episodes = fleet.unwrapped._episodes
    episodes.task._goal[1] = episodes.arms.tips(episodes.arms.position)[1]
    still = np.zeros((3, 7), np.float32)
    shown, reward, terminated, _, info = fleet.step(still)
    assert terminated.tolist() == [False, True, False]
    assert info["is_success"].tolist() == [False, True, False]
    old = shown["to_goal"].copy()
    shown, reward, terminated, _, _ = fleet.step(still)
    assert not terminated.any()
    assert reward[1] == 0.0
    assert np.abs(shown["to_goal"][1] - old[1]).max() > 0.05
    np.testing.assert_allclose(shown["to_goal"][[0, 2]], old[[0, 2]], atol=5e-3)
    assert fleet.observation_space.contains(shown)
    assert not shown["fault"].any()
    fleet.close()


def test_a_fleet_is_deterministic() -> None:
    """The same seed makes the same steps again, episodes that end between them included."""
    runs = []
    for _ in range(2):
        fleet = FleetEnv(4, max_episode_steps=3)
        fleet.reset(seed=3)
        fleet.action_space.seed(3)
        runs.append([fleet.step(fleet.action_space.sample())[:4] for _ in range(8)])
        fleet.close()
    np.testing.assert_equal(runs[0], runs[1])
    assert runs[0][2][3].all()


def test_an_arm_of_a_fleet_moves_as_one_alone() -> None:
    """The world of many arms is the physics of one: the same torques, the same motion."""
    settings = load("iiwa", {"physics": "mujoco"})
    one, many = (Arms(settings, count, "velocity", 50) for count in (1, 3))
    speed = np.linspace(-0.5, 0.5, 7)
    for arms in (one, many):
        for _ in range(10):
            arms.act(np.tile(speed, (arms.count, 1)))
            arms.step()
    for k in range(3):
        np.testing.assert_allclose(many.position[k], one.position[0], atol=1e-6)
    one.close()
