"""A thrust coefficient that is a guess gives way to the rotor speed that carries the vehicle."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.flight_log import FlightLog
from np_drake.logs.inputs import FAR, with_hover_thrust
from np_drake.rotor_input import with_rotor_input
from np_drake.vehicle import Vehicle

TRUE = Vehicle(input="rotor_speed")


def hovering(vehicle: Vehicle, name: str = "made", above: float = 0.0) -> FlightLog:
    """Return a hover with rotor speed; above: share of the weight that the rotors carry beside
    it.
    """
    t = np.arange(0.0, 5.0, 0.02)
    thrust = 0.25 * TRUE.mass * TRUE.gravity * (1 + above) * (1 + 0.01 * np.sin(9 * t))
    rotor = np.repeat(np.sqrt(thrust / TRUE.thrust_coefficient)[:, None], 4, axis=1)
    still = np.zeros((len(t), 3))
    q = np.column_stack([np.ones(len(t)), still])
    log = FlightLog(t, still, q, still, still, np.full((len(t), 4), np.nan), rotor=rotor, name=name)
    return with_rotor_input(log, vehicle)


def guessed(factor: float, spread: float | None = 0.2) -> Vehicle:
    """Return the vehicle with coefficients that are off by a factor, and how well they are
    known.
    """
    k, c = factor * TRUE.thrust_coefficient, factor * TRUE.torque_coefficient
    return dc.replace(TRUE, thrust_coefficient=k, torque_coefficient=c, thrust_uncertainty=spread)


@pytest.mark.parametrize("factor", [1.4])
def test_a_guess_gives_way_to_the_speed_that_carries_the_vehicle(factor):
    file = guessed(factor)
    dut, train, held_out = with_hover_thrust(
        file, [hovering(file)], [hovering(file, "other", above=0.1)]
    )
    assert dut.thrust_coefficient == pytest.approx(TRUE.thrust_coefficient, rel=1e-3)
    assert dut.torque_coefficient / dut.thrust_coefficient == pytest.approx(0.016)
    weight = TRUE.mass * TRUE.gravity
    assert np.mean(train[0].u[:, 0]) == pytest.approx(weight, rel=1e-3)
    assert np.mean(held_out[0].u[:, 0]) == pytest.approx(
        1.1 * weight, rel=1e-3
    )  # by the training flights' coefficient
    assert all(
        "with which rotor speed carries 2 kg" in log.notes[-1] for log in (train[0], held_out[0])
    )


def test_a_coefficient_beyond_its_uncertainty_is_of_another_vehicle():
    file = guessed(1 / 2.2)
    _, (dut,), _ = with_hover_thrust(file, [hovering(file)])
    assert dut.notes[-1].startswith(
        f"{FAR}: rotor speed carries 2 kg with 2.2 times that of 'paper'"
    )


@pytest.mark.parametrize("spread", [0.03])
def test_a_coefficient_that_is_no_guess_stays(spread):
    file = guessed(0.7, spread)
    log = hovering(file)
    assert with_hover_thrust(file, [log], [log]) == (file, [log], [log])


def test_a_log_with_another_input_keeps_its_command():
    log = dc.replace(hovering(TRUE), input="command")
    assert with_hover_thrust(guessed(0.7), [log]) == (guessed(0.7), [log], [])
