import dataclasses as dc
import gc
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("gymnasium", reason="gymnasium is not installed: pip install 'np_drake[gym]'")

from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env

from diagrams.gym import make_env
from diagrams.loop.experiments import load_experiment
from diagrams.loop.flight import FlightConfig, RealityConfig
from np_drake.control.tracking_task import TrackingTask, command_span
from np_drake.references.config import ReferenceConfig
from np_drake.vehicle import MeasurementNoise
from systems.payload_config import PayloadConfig

REST = np.zeros(4)
CIRCLE = load_experiment("circle")
IDEAL = RealityConfig(
    payload=PayloadConfig(tether="none"),
    rotor_drag=0.0,
    motor_lag=0.0,
    thrust_scale=1.0,
    noise=MeasurementNoise(*np.zeros(6)),
)
NOMINAL_HOVER = FlightConfig(
    name="nominal", duration=1.0, reference=ReferenceConfig(track="hover", height=2.0, ramp=0.0), reality=IDEAL
)


def some_payload(rng: np.random.Generator) -> FlightConfig:
    payload = dc.replace(CIRCLE.reality.payload, mass=rng.uniform(0.2, 0.4))
    return dc.replace(CIRCLE, reality=dc.replace(CIRCLE.reality, payload=payload))


def episode(dut, *, seed=None, steps=25) -> tuple[np.ndarray, np.ndarray, list[dict]]:
    """Observations, rewards and infos under the same random actions."""
    rng = np.random.default_rng(0)
    observation, info = dut.reset(seed=seed)
    seen, paid, told = [observation], [], [info]
    for _ in range(steps):
        observation, reward, terminated, truncated, info = dut.step(rng.uniform(-0.1, 0.1, 4))
        seen.append(observation)
        paid.append(reward)
        told.append(info)
        if terminated or truncated:
            break
    return np.array(seen), np.array(paid), told


def same(one, other) -> bool:
    return np.array_equal(one[0], other[0]) and np.array_equal(one[1], other[1]) and one[2] == other[2]


@pytest.mark.parametrize("base", ["hover", "cascade"])
def test_gymnasiums_checker_passes(base, recwarn):
    check_env(make_env("circle", base=base, duration=1.0), skip_render_check=True)
    others = [str(w.message) for w in recwarn if "infinit" not in str(w.message)]
    assert others == []  # but that motion has no bounds


@pytest.mark.parametrize("experiment", [some_payload, "circle"])
@pytest.mark.parametrize("base", ["hover", "cascade"])
def test_the_same_seed_is_the_same_episode_bit_for_bit(experiment, base):
    dut = make_env(experiment, base=base, simulators=3)
    first = episode(dut, seed=7)
    for seed in (1, 2, 3, None):  # whatever was flown between
        episode(dut, seed=seed, steps=5)
    assert same(episode(dut, seed=7), first)
    assert same(episode(make_env(experiment, base=base, simulators=3), seed=7), first)


def test_the_same_seed_is_the_same_episode_with_a_step_of_variable_size():
    variable = dc.replace(CIRCLE, simulator=type(CIRCLE.simulator)(use_error_control=True, accuracy=1e-3))
    dut = make_env(variable)
    first = episode(dut, seed=7)
    episode(dut, seed=8)
    assert same(episode(dut, seed=7), first)


def test_another_seed_is_another_episode():
    dut = make_env("circle")
    assert not same(episode(dut, seed=1), episode(dut, seed=2))


def test_episodes_without_a_seed_follow_from_the_last_seed():
    dut = make_env(some_payload)
    dut.reset(seed=4)
    one, two = episode(dut), episode(dut)
    dut.reset(seed=4)
    assert same(episode(dut), one)
    assert same(episode(dut), two)
    assert not same(one, two)


def test_two_environments_do_not_influence_each_other():
    alone = episode(make_env("circle"), seed=5)
    dut, other = make_env("circle"), make_env("circle")
    dut.reset(seed=5)
    other.reset(seed=6)
    rng = np.random.default_rng(0)
    for k in range(25):
        other.step(np.full(4, -0.2))
        observation, *_ = dut.step(rng.uniform(-0.1, 0.1, 4))
        np.testing.assert_array_equal(observation, alone[0][k + 1])


def test_hover_thrust_holds_a_nominal_vehicle_at_its_height_for_a_second():
    dut = make_env(NOMINAL_HOVER)
    observation, _ = dut.reset(seed=0)
    total, truncated = 0.0, False
    while not truncated:
        observation, reward, terminated, truncated, info = dut.step(REST)
        assert not terminated
        np.testing.assert_allclose(observation[:6], 0.0, atol=1e-9)  # integration [m, m/s]
        total += reward
    assert info["time"] == pytest.approx(1.0)
    assert total == pytest.approx(1.0)  # a second on the reference [s]


def test_an_action_of_thrust_accelerates_a_nominal_vehicle_as_newton_says():
    dut = make_env(NOMINAL_HOVER, task=TrackingTask(tolerance=50.0))
    dut.reset(seed=0)
    for _ in range(25):
        observation, *_ = dut.step(np.array([0.2, 0.0, 0.0, 0.0]))
    vehicle = NOMINAL_HOVER.vehicle
    a = 0.2 * command_span(vehicle)[0] / vehicle.mass
    assert observation[2] == pytest.approx(-0.5 * a * 0.5**2, rel=1e-6)  # exact for a constant force [m]


def test_the_reward_is_largest_on_the_reference():
    _, paid, told = episode(make_env(NOMINAL_HOVER), seed=0, steps=40)
    on_it = make_env(NOMINAL_HOVER)
    on_it.reset(seed=0)
    best = on_it.step(REST)[1]
    assert best == pytest.approx(0.02)  # a period [s]
    assert paid.max() < best
    assert told[-1]["distance"] > 0.0


@pytest.mark.parametrize("thrust", [-1.0, 1.0])
def test_a_lost_vehicle_ends_the_episode_and_is_not_paid(thrust):
    dut = make_env("circle")
    dut.reset(seed=0)
    for _ in range(200):
        _, reward, terminated, truncated, info = dut.step(np.array([thrust, 0.0, 0.0, 0.0]))
        if terminated:
            break
    assert terminated
    assert not truncated
    assert reward == 0.0
    assert info["distance"] > 1.0  # the tolerance [m]
    assert "off its reference" in info["lost"]


@pytest.mark.parametrize("thrust, why", [(-1.0, "ground"), (1.0, "arena")])
def test_ground_and_arena_end_the_episode_too(thrust, why):
    dut = make_env(NOMINAL_HOVER, task=TrackingTask(tolerance=1e3), duration=20.0)
    dut.reset(seed=0)
    for _ in range(999):
        _, _, terminated, _, info = dut.step(np.array([thrust, 0.0, 0.0, 0.0]))
        if terminated:
            break
    assert why in info["lost"]


def test_an_integrator_that_gives_up_ends_the_episode():
    class GivesUp:
        def __init__(self, simulator):
            self._simulator = simulator

        def __getattr__(self, name):
            return getattr(self._simulator, name)

        def AdvanceTo(self, time):
            raise RuntimeError("step too small")

    dut = make_env("circle")
    dut.reset(seed=0)
    dut.simulator = GivesUp(dut.simulator)
    _, reward, terminated, truncated, info = dut.step(REST)
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert "integrator" in info["lost"]


@pytest.mark.parametrize("period", [0.02, 0.06])
def test_the_episode_is_truncated_at_the_experiments_end(period):
    dut = make_env(dc.replace(NOMINAL_HOVER, duration=0.6), period=period)
    dut.reset(seed=0)
    ends = [dut.step(REST)[3] for _ in range(round(0.6 / period))]
    assert ends == [False] * (len(ends) - 1) + [True]


def test_the_time_of_a_decision_is_a_whole_multiple_of_the_period():
    dut = make_env("circle", base="cascade")
    dut.reset(seed=0)
    for k in range(1, 200):
        assert dut.step(REST)[4]["time"] == 0.02 * k  # bit for bit: no sum drifts [s]


def test_the_cascade_alone_keeps_the_circle_that_hover_thrust_loses():
    flown = {}
    for base in ("hover", "cascade"):
        dut = make_env("circle", base=base, duration=1.0)
        dut.reset(seed=0)
        terminated = truncated = False
        while not (terminated or truncated):
            _, _, terminated, truncated, info = dut.step(REST)
        flown[base] = info
    assert "lost" in flown["hover"]
    assert flown["cascade"]["time"] == pytest.approx(6.0)  # ramp and a second [s]
    assert flown["cascade"]["distance"] < 0.25  # 16 cm behind, for it knows no payload [m]


def test_a_sensors_noise_is_in_the_observation_and_not_in_the_reward():
    noisy = dc.replace(IDEAL, noise=MeasurementNoise(position=0.05))
    dut = make_env(dc.replace(NOMINAL_HOVER, reality=noisy))
    dut.reset(seed=0)
    observation, reward, *_ = dut.step(REST)
    assert np.abs(observation[:3]).max() > 1e-3  # [m]
    assert reward == pytest.approx(0.02)  # [s]


def test_an_impossible_draw_is_refused_before_any_episode():
    def too_heavy(rng: np.random.Generator) -> FlightConfig:
        return dc.replace(CIRCLE, vehicle=CIRCLE.vehicle.with_mass(rng.uniform(2.0, 8.0)))

    with pytest.raises(ValueError, match="rotors"):
        make_env(too_heavy)


def test_resets_build_no_more_simulators_than_the_cap():
    dut = make_env(some_payload, simulators=3)
    taken = [dut.reset(seed=seed)[1]["simulator"] for seed in range(40)]
    assert set(taken) == {0, 1, 2}
    assert len(dut.pool._built) == 3


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is read from /proc")
def test_memory_does_not_grow_beyond_the_cap():
    def resident() -> float:
        gc.collect()
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 2**20

    dut = make_env(some_payload, simulators=3)
    for seed in range(50):
        episode(dut, seed=seed, steps=2)
    before = resident()
    for seed in range(200):
        episode(dut, seed=seed, steps=2)
    # 200 simulators of their own would take 300 MB; the allocator's own swing is below 10 MB.
    assert resident() - before < 20.0


def test_simulators_are_drawn_by_the_seed_of_the_draws_alone():
    def masses(draw_seed: int) -> list[float]:
        dut = make_env(some_payload, simulators=3, draw_seed=draw_seed)
        return [c.reality.payload.mass for c in dut.pool.configs]

    assert len(set(masses(0))) == 3
    assert masses(0) == masses(0)
    assert not set(masses(0)) & set(masses(1))


@pytest.mark.parametrize("action", [np.zeros(3), np.array([0.0, np.nan, 0.0, 0.0])])
def test_an_impossible_action_is_refused(action):
    dut = make_env("circle")
    dut.reset(seed=0)
    with pytest.raises(ValueError, match="action must be 4 finite numbers"):
        dut.step(action)


def test_a_step_before_the_first_reset_is_refused():
    with pytest.raises(ResetNeeded, match="reset"):
        make_env("circle").step(REST)
