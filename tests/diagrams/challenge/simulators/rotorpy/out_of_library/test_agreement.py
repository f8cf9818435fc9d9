"""Both implementations of every out-of-library effect against each other."""

import numpy as np
import pytest

from diagrams.challenge.generate.vehicles import VEHICLES
from diagrams.challenge.out_of_library.draw import OUT_OF_LIBRARY, draw_out_of_library
from diagrams.challenge.simulators.rotorpy.out_of_library import (
    actuators,
    aerodynamic,
    contact,
    ground_and_walls,
    wind,
)

ROOMS = (aerodynamic, wind, ground_and_walls, contact, actuators)
LAWS = {name: law for room in ROOMS for name, law in room.LAWS.items()}
STATEFUL = {
    name: effect for room in (aerodynamic, contact, actuators) for name, effect in room.STATEFUL.items()
}
each_vehicle = pytest.mark.parametrize("nominal", VEHICLES[:3], ids=lambda vehicle: vehicle.name)


def test_every_effect_is_implemented_once_for_either_simulator():
    names = [*LAWS, *STATEFUL, *actuators.GAINS]
    assert sorted(names) == sorted(OUT_OF_LIBRARY)


def test_both_simulators_file_an_effect_under_the_same_physics():
    for room in ROOMS:
        tables = [getattr(room, table, {}) for table in ("LAWS", "STATEFUL", "GAINS")]
        theirs = {name for table in tables for name in table}
        rng = np.random.default_rng(2)
        ours = {type(draw_out_of_library(name, rng, VEHICLES[0])).__module__ for name in theirs}
        assert {module.rsplit(".", 1)[1] for module in ours} == {room.__name__.rsplit(".", 1)[1]}


@each_vehicle
@pytest.mark.parametrize("name", LAWS)
def test_both_implementations_of_a_law_give_the_same_wrench(name, nominal, implementations):
    implementations.same_wrench(name, LAWS[name], nominal)


@each_vehicle
@pytest.mark.parametrize("name", STATEFUL)
def test_both_implementations_with_a_hidden_state_follow_a_command_alike(name, nominal, implementations):
    implementations.same_following(name, STATEFUL[name], nominal)


@pytest.mark.parametrize("name", STATEFUL)
def test_under_a_constant_command_a_hidden_state_rests(name, vehicle):
    effect = draw_out_of_library(name, np.random.default_rng(9), vehicle)
    command = np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.state_rate(vehicle, s, command), 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["sprung_load", "losing_sync", "dynamic_inflow"])
def test_at_rest_what_answers_to_change_adds_nothing(name, vehicle):
    effect = draw_out_of_library(name, np.random.default_rng(9), vehicle)
    command = np.array([3.0, 5.0, 6.0, 8.0])
    s = effect.state_at(vehicle, command)
    np.testing.assert_allclose(effect.thrust(vehicle, s, command), command, atol=1e-12)


def test_creeping_blades_give_what_is_commanded_in_hover(vehicle):
    effect = draw_out_of_library("creeping_blades", np.random.default_rng(9), vehicle)
    hover = np.full(4, vehicle.mass * vehicle.gravity / 4)
    np.testing.assert_allclose(effect.thrust(vehicle, effect.state_at(vehicle, hover), hover), hover)
