import dataclasses as dc
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="gymnasium is not installed: pip install 'np_drake[gym]'")

import gymnasium

from diagrams.gym import make_env, register, registration
from diagrams.gym.registration import ID
from diagrams.loop.experiments import load_experiment

REST = np.zeros(4)


def test_the_environment_is_made_by_its_name():
    register()
    register()  # changes nothing
    dut = gymnasium.make(ID, experiment="circle", base="cascade")
    observation, _ = dut.reset(seed=0)
    assert dut.observation_space.contains(observation)
    assert dut.action_space == gymnasium.spaces.Box(-1.0, 1.0, (4,), np.float32)
    assert dut.spec.id == ID == "np_drake/Track-v0"


def test_the_name_may_say_where_it_comes_from():
    gymnasium.registry.pop(ID, None)
    with mock.patch.dict("sys.modules"):
        import sys

        sys.modules.pop("diagrams.gym")
        dut = gymnasium.make(f"diagrams.gym:{ID}", experiment="hover")
    dut.reset(seed=0)


@pytest.mark.parametrize(
    "experiment", [load_experiment("circle"), lambda rng: load_experiment("circle")], ids=["config", "draw"]
)
def test_a_configuration_or_a_function_goes_through_gymnasium_make(experiment):
    register()
    dut = gymnasium.make(ID, experiment=experiment)
    plain = make_env(experiment)
    np.testing.assert_array_equal(dut.reset(seed=3)[0], plain.reset(seed=3)[0])
    np.testing.assert_array_equal(dut.step(REST)[0], plain.step(REST)[0])


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_a_vector_of_environments_flies_each_like_one_alone(mode):
    register()
    dut = gymnasium.make_vec(ID, num_envs=2, vectorization_mode=mode, experiment="circle", base="cascade")
    dut.reset(seed=[3, 4])
    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.1, 0.1, (10, 2, 4)).astype(np.float32)
    for action in actions:
        observations, *_ = dut.step(action)
    dut.close()
    for i, seed in enumerate((3, 4)):
        alone = make_env("circle", base="cascade")
        alone.reset(seed=seed)
        for action in actions:
            observation, *_ = alone.step(action[i])
        np.testing.assert_array_equal(observations[i], observation)


def test_another_vehicle_flies_its_own_scale():
    dut = make_env("circle", vehicle="crazyflie", base="cascade")
    dut.reset(seed=0)
    info = dut.step(REST)[4]
    assert info["time"] == pytest.approx(0.01)  # the crazyflie's period [s]


@pytest.mark.parametrize(
    "arguments, word",
    [
        ({"experiment": "spiral"}, "experiment"),
        ({"experiment": "circle", "base": "mpc"}, "base"),
        ({"experiment": "circle", "authority": 0.0}, "authority"),
        ({"experiment": "circle", "period": 0.03}, "period"),
        ({"experiment": "circle", "duration": -1.0}, "duration"),
        ({"experiment": lambda rng: load_experiment("circle"), "simulators": 0}, "simulators"),
        ({"experiment": load_experiment("circle"), "vehicle": "crazyflie"}, "vehicle"),
    ],
)
def test_an_impossible_argument_is_refused(arguments, word):
    with pytest.raises(ValueError, match=word):
        make_env(**arguments)


def test_a_configuration_is_left_as_it_was():
    config = load_experiment("circle")
    make_env(config, duration=1.0)
    assert dc.asdict(config.reality) == dc.asdict(load_experiment("circle").reality)
    assert config.duration == 50.0


def test_without_gymnasium_one_line_names_the_remedy(monkeypatch):
    monkeypatch.setattr(registration, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'np_drake\[gym\]'\.$"):
        make_env("circle")
    with pytest.raises(ImportError, match="gymnasium must be installed"):
        register()
