from functools import partial

import numpy as np
import pytest

from diagrams.challenge.generate.composition import compose
from diagrams.challenge.out_of_library.draw import (
    DEVELOPMENT,
    HOLDOUT,
    OUT_OF_LIBRARY,
    draw_out_of_library,
)
from diagrams.challenge.simulators.drake import simulator
from np_drake.effects.base import ActuatorEffect, Motion, WrenchEffect
from np_drake.effects.library import LIBRARY
from np_drake.labels import raw_labels

# The laws hold from any start; a settled one only takes longer.
fly = partial(simulator.fly, warm_up=0.5)  # [s]


@pytest.mark.parametrize("name", OUT_OF_LIBRARY)
def test_an_out_of_library_effect_flies_and_shows(name, vehicle, plan, t):
    effect = draw_out_of_library(name, np.random.default_rng(4), vehicle)
    assert effect.identifier == name
    assert name not in LIBRARY
    log = fly(vehicle, plan, [effect], t=t)
    chi = raw_labels(log, vehicle)
    assert np.abs(chi).max() > 1e-3
    if isinstance(effect, WrenchEffect):
        expected = effect.wrench(vehicle, Motion(log.t, log.x, log.u @ vehicle.unmixer.T))
        np.testing.assert_allclose(chi, expected, atol=1e-5)  # [N, N·m]


def test_there_are_twenty_of_either_sort():
    assert len(DEVELOPMENT) == 20
    assert len(HOLDOUT) == 20
    assert len(OUT_OF_LIBRARY) == 40


def test_held_out_effects_are_in_no_ordinary_set_and_alone_in_their_own():
    usual, unseen = compose(200, 0, 1), compose(64, 8, 1, unseen=True)
    assert not {name for d in usual for name in d.names} & set(HOLDOUT)
    assert {name for d in usual if d.kind == "foreign" for name in d.names} == set(DEVELOPMENT)
    assert [d.kind for d in unseen].count("foreign") == 64
    assert [d.kind for d in unseen].count("clean") == 8
    assert {name for d in unseen for name in d.names} == set(HOLDOUT)


def effects_of(kind, vehicle):
    effects = [
        draw_out_of_library(name, np.random.default_rng(9), vehicle) for name in OUT_OF_LIBRARY
    ]
    return [effect for effect in effects if isinstance(effect, kind)]


def test_a_wrench_is_the_same_for_one_instant_as_for_many(vehicle):
    rng = np.random.default_rng(7)
    x = rng.normal(size=(20, 13))
    x[:, 3:7] /= np.linalg.norm(x[:, 3:7], axis=1, keepdims=True)
    motion = Motion(rng.uniform(0, 20, 20), x, rng.uniform(0, 9, (20, 4)), rng.normal(size=(20, 3)))
    for effect in effects_of(WrenchEffect, vehicle):
        many = effect.wrench(vehicle, motion)
        one = effect.wrench(
            vehicle, Motion(motion.t[3], x[3], motion.rotor_thrust[3], motion.wind[3])
        )
        np.testing.assert_allclose(one, many[3], atol=1e-12, err_msg=effect.identifier)


def test_under_a_constant_command_a_hidden_state_rests(vehicle):
    command = np.array([3.0, 5.0, 6.0, 8.0])
    for effect in effects_of(ActuatorEffect, vehicle):
        rate = effect.state_rate(vehicle, effect.state_at(vehicle, command), command)
        np.testing.assert_allclose(rate, 0.0, atol=1e-12, err_msg=effect.identifier)


@pytest.mark.parametrize("name", ["sprung_load", "losing_sync", "dynamic_inflow"])
def test_at_rest_what_answers_to_change_adds_nothing(name, vehicle):
    effect = draw_out_of_library(name, np.random.default_rng(9), vehicle)
    command = np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.thrust(vehicle, s, command), command, atol=1e-12)


def test_creeping_blades_give_what_is_commanded_in_hover(vehicle):
    effect = draw_out_of_library("creeping_blades", np.random.default_rng(9), vehicle)
    hover = np.full(4, vehicle.mass * vehicle.gravity / 4)
    np.testing.assert_allclose(
        effect.thrust(vehicle, effect.state_at(vehicle, hover), hover), hover
    )
