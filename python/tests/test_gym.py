"""The Gymnasium environment: what it promises, and what it says to mistakes."""

import warnings
from concurrent.futures import ThreadPoolExecutor

import numpy
import painleve
import pytest

gymnasium = pytest.importorskip("gymnasium")

from gymnasium.error import InvalidAction, ResetNeeded  # noqa: E402
from gymnasium.utils.env_checker import check_env  # noqa: E402
from painleve.gym import ArmOnBelt  # noqa: E402


def episode(environment, seed=7):
    environment.action_space.seed(seed)
    steps = [environment.reset(seed=seed)[0]]
    while True:
        observation, reward, terminated, truncated, _ = environment.step(environment.action_space.sample())
        steps.append(numpy.append(observation, reward))
        if terminated or truncated:
            return numpy.concatenate(steps)


def test_gymnasiums_own_check():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The arm's angles and rates have no limits, and torques keep their unit.
        warnings.filterwarnings("ignore", message=".*(infinity|symmetric and normalized|without a spec|no spec|unwrapped).*")
        check_env(ArmOnBelt(duration_s=0.02), skip_render_check=True)


def test_equal_seeds_give_equal_episodes():
    environment = ArmOnBelt(duration_s=0.05)
    first = episode(environment)
    assert (first == episode(environment)).all() and (first == episode(ArmOnBelt(duration_s=0.05))).all()
    assert (first != episode(environment, seed=8)).any()


@pytest.mark.parametrize(("duration_s", "steps"), [(0.01, 10), (0.1 + 0.2, 300), (0.0104, 10), (1e-6, 1)])
def test_an_episode_is_truncated_after_its_duration(duration_s, steps):
    environment = ArmOnBelt(duration_s=duration_s)
    for _ in range(2):
        environment.reset()
        ends = [environment.step([0.5, 0.8])[2:4] for _ in range(steps)]
        assert ends == [(False, False)] * (steps - 1) + [(False, True)]


def test_a_step_before_reset_is_refused():
    with pytest.raises(ResetNeeded, match=r"reset\(\) comes before"):
        ArmOnBelt().step([0.0, 0.0])


@pytest.mark.parametrize(
    "action",
    [
        [0.0],
        [0.0, 0.0, 0.0],
        [[0.0, 0.0]],
        0.0,
        None,
        "strong",
        [0.0, [0.0, 0.0]],
        [float("nan"), 0.0],
        [0.0, float("inf")],
        [1e6, 0.0],
        [0.0, -5.000001],
    ],
)
def test_an_action_outside_the_space_is_refused_and_changes_nothing(action):
    environment = ArmOnBelt()
    before, _ = environment.reset()
    with pytest.raises(InvalidAction, match="two torques of -5.0 to 5.0 N·m"):
        environment.step(action)
    untouched = ArmOnBelt()
    untouched.reset()
    assert (environment.step([5.0, -5.0])[0] == untouched.step(numpy.array([5.0, -5.0], numpy.float32))[0]).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scenario": "egde"}, "no file is called 'egde'"),
        ({"scenario": "belt.friction = -1"}, "belt.friction = -1"),
        ({"target_m": float("nan")}, "target_m = nan"),
        ({"duration_s": 0.0}, "duration_s = 0.0"),
        ({"duration_s": float("inf")}, "duration_s = inf"),
        ({"torque_limit_nm": -1.0}, "torque_limit_nm = -1.0"),
        ({"torque_limit_nm": float("nan")}, "torque_limit_nm = nan"),
    ],
)
def test_the_constructor_names_mistakes(settings, message):
    with pytest.raises(ValueError, match=message):
        ArmOnBelt(**settings)


def short():
    return ArmOnBelt(duration_s=0.02)


@pytest.mark.parametrize("kind", ["sync", "async-fork", "async-spawn"])
def test_vector_environments(kind):
    # The children of a fork inherit a process that has computed.
    painleve.study("bifurcation", mu=0.6, v_belt="-0.4", initial="a", transient_s=0.1, record_s=0.1)
    if kind == "sync":
        vector = gymnasium.vector.SyncVectorEnv([short] * 3)
    else:
        vector = gymnasium.vector.AsyncVectorEnv([short] * 3, context=kind.removeprefix("async-"))
    alone = short()
    alone.reset(seed=1)
    observations, _ = vector.reset(seed=1)
    assert observations.shape == (3, 6)
    for tick in range(1, 21):
        observations, rewards, terminations, truncations, _ = vector.step(numpy.full((3, 2), 0.5))
        observation, reward, _, truncated, _ = alone.step([0.5, 0.5])
        assert (observations == observation).all() and (rewards == reward).all()
        assert truncations.tolist() == [tick == 20] * 3 and truncated == (tick == 20) and not terminations.any()
    # The step after the end resets.
    observations, *_ = vector.step(numpy.full((3, 2), 0.5))
    assert (observations == alone.reset()[0]).all()
    vector.close()


def test_environments_on_threads():
    expected = episode(short())
    with ThreadPoolExecutor(4) as pool:
        assert all((found == expected).all() for found in pool.map(episode, [short() for _ in range(8)]))
