"""Effects that the library does not have: closed forms of their laws."""

from functools import partial

import numpy as np
import pytest

from diagrams.evidence.challenge import out_of_library as laws
from diagrams.evidence.challenge.case import draw_effect
from diagrams.evidence.challenge.out_of_library import DEVELOPMENT, DRAWS, HOLDOUT
from np_drake.effects.base import Motion, WrenchEffect

LEVEL = np.eye(13)[3]  # at the origin, at rest


def drawn(name, vehicle):
    (effect,) = draw_effect(name, np.random.default_rng(9), vehicle, 20.0)
    return effect


def hover(vehicle):
    return np.full(4, vehicle.mass * vehicle.gravity / 4)


def wrench(law, vehicle, x, thrust=None, wind=(0.0, 0.0, 0.0), t=0.0, **sizes):
    thrust = np.ones(4) if thrust is None else thrust
    return law(vehicle, Motion(t, x, thrust, np.array(wind)), **sizes)


def test_every_law_flies_in_a_set():
    assert {*DEVELOPMENT, *HOLDOUT} == set(DRAWS)


@pytest.mark.parametrize("name", DRAWS)
def test_one_instant_is_as_many_and_hidden_states_rest(name, vehicle):
    effect, rng = drawn(name, vehicle), np.random.default_rng(7)
    if not isinstance(effect, WrenchEffect):
        command = np.array([3.0, 5.0, 6.0, 8.0])
        rate = effect.state_rate(vehicle, effect.state_at(vehicle, command), command)
        assert rate.shape == (effect.state_size,)
        np.testing.assert_allclose(rate, 0.0, atol=1e-12)
        return
    x = rng.normal(size=(20, 13))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    motion = Motion(rng.uniform(0, 20, 20), x, rng.uniform(0, 9, (20, 4)), rng.normal(size=(20, 3)))
    one = Motion(motion.t[3], x[3], motion.rotor_thrust[3], motion.wind[3])
    np.testing.assert_allclose(
        effect.wrench(vehicle, one), effect.wrench(vehicle, motion)[3], atol=1e-12
    )


def test_a_motor_stays_in_step_with_slow_rises_and_loses_it_with_fast_ones(vehicle):
    """In full from twice the jump on; a fall does no harm, and the other motors stay in step."""
    h = hover(vehicle)[0]
    law = partial(laws.losing_sync, vehicle, rotor=1, loss=0.4, jump=0.1, time=0.2)
    s, _, _ = law(hover(vehicle), None)
    for rise, out_of_step in ((0.1, 0.0), (0.15, 0.5), (0.5, 1.0), (-0.5, 0.0)):
        command = hover(vehicle) + rise * h * (np.arange(4) == 1)
        _, rate, _ = law(command, s)
        np.testing.assert_allclose(rate, [rise * h / 0.2, out_of_step / 0.2], atol=1e-9)
    np.testing.assert_allclose(law(hover(vehicle), s)[2], hover(vehicle))
    lost = law(hover(vehicle), np.array([h, 0.5]))[2]
    np.testing.assert_allclose(lost, [h, 0.8 * h, h, h])


def test_blades_give_way_over_time(vehicle):
    """After a step from hover to twice the thrust they give all of it at once, and 0.8 of it
    later.
    """
    h = hover(vehicle)
    law = partial(laws.creeping_blades, vehicle, creep=0.2, time=1.0)
    np.testing.assert_allclose(law(2 * h, law(h, None)[0])[2], 2.0 * h)
    np.testing.assert_allclose(law(2 * h, None)[2], 1.6 * h)


def test_no_rotor_gives_more_than_where_it_saturates(vehicle):
    thrust = np.array([1.0, 2.5, 2.0, 3.0])
    expected = vehicle.mixer @ (np.minimum(thrust, 2.0) - thrust)
    chi = wrench(laws.rotor_saturation, vehicle, LEVEL, thrust, limit=2.0)
    np.testing.assert_allclose(chi, [0.0, 0.0, *expected], atol=1e-12)


def test_a_lidar_couples_roll_and_pitch_and_does_no_work(vehicle):
    w = np.array([0.5, -0.8, 0.3])
    tau = wrench(laws.spinning_lidar, vehicle, np.append(LEVEL[:10], w), h=0.02)[3:]
    np.testing.assert_allclose(tau, [0.02 * 0.8, 0.02 * 0.5, 0.0], atol=1e-12)
    assert abs(tau @ w) < 1e-12
