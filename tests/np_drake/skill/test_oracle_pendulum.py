"""Laws of the oracle pendulum, on conical swings."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.effects.pendulum import Payload
from np_drake.residual_model import ReadsPlan
from np_drake.skill.oracle_pendulum import Rest, oracle_pendulum, remaining_drag
from np_drake.skill.skill import flight_forecasts, held_plan
from np_drake.training_data.training_segments import sampled_flight
from np_drake.vehicle import Vehicle
from tests.np_drake.skill.conical_flight import carried, conical_flight

VEHICLE, STEP = Vehicle(), 0.02
PAYLOAD = Payload(mass=0.1, length=0.6, hook=(0.0, 0.0, 0.0))
SWING = PAYLOAD.mass * VEHICLE.gravity * np.tan(0.4)  # N, lateral force of the cone
MOVING = (1.0, 0.0, 0.0)


def swung(**options):
    """The flight of a cone, and the path of its payload."""
    log, path = conical_flight(VEHICLE, PAYLOAD, angle=0.4, **options)
    return sampled_flight(log, VEHICLE, step=STEP), path


def errors(flight, path, *, motion="known", rest=None, first=10, horizons=(1, 10, 50)):
    """Errors of the force over the horizons, (origins, H, 3) [N]."""
    dut = oracle_pendulum(flight, VEHICLE, PAYLOAD, path, rest)
    chi_hat = flight_forecasts(dut, flight, list(horizons), first=first, motion=motion)
    goal = np.full_like(chi_hat, np.nan)
    for i, h in enumerate(horizons):
        goal[: len(flight) - first - h, i] = flight.chi[first + h :]
    return (chi_hat - goal)[..., :3]


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (1.0, -2.0, 0.5)])
def test_the_oracle_pendulum_forecasts_a_conical_swing(velocity):
    error = errors(*swung(velocity=velocity))
    # The rows of a label lie 2 ms after the middle of its step (0.8 % of the swing); the
    # integration adds 0.6 %.
    assert np.nanmax(np.abs(error)) < 0.02 * SWING
    assert not np.isfinite(error).all(axis=(0, 2)).any()  # the last origins have no target


def test_at_constant_velocity_the_held_motion_is_the_known_one():
    known, held = (errors(*swung(velocity=MOVING), motion=m) for m in ("known", "held"))
    np.testing.assert_allclose(held, known, atol=1e-9 * SWING)


def test_a_constant_force_beside_the_tether_is_held():
    flown = swung(velocity=MOVING, drag=0.3)
    assert np.nanmax(np.abs(errors(*flown))) > 0.29  # N, the drag that a pendulum alone leaves out
    for drag in (0.0, 0.3):
        assert np.nanmax(np.abs(errors(*flown, rest=Rest(drag)))) < 0.02 * SWING


def test_the_drag_beside_the_tether_is_found_where_the_vehicle_moves():
    t = 0.004 * np.arange(1000)
    v = np.stack([np.sin(3 * t), 0.5 * np.cos(5 * t), 0 * t], axis=1)
    a = np.stack([3 * np.cos(3 * t), -2.5 * np.sin(5 * t), 0 * t], axis=1)
    p = np.stack([-np.cos(3 * t) / 3, 0.1 * np.sin(5 * t), 0 * t], axis=1)
    log = carried(VEHICLE, t, p, v, a, -0.3 * v + [0.1, 0.2, 0.0], "drag")
    flight = sampled_flight(log, VEHICLE, step=STEP)
    light = Payload(mass=1e-9, length=0.6, hook=(0.0, 0.0, 0.0))
    dut = oracle_pendulum(flight, VEHICLE, light, (t, p - [0.0, 0.0, 0.6]))
    found = remaining_drag([(flight, dut)])
    assert found == pytest.approx(0.3, rel=1e-2)  # mean of a step by its ends
    x = flight.x.copy()
    x[:, 7:10] = 0.0
    assert remaining_drag([(dc.replace(flight, x=x), dut)]) == 0.0


def test_it_reads_a_plan_and_without_one_holds_the_motion():
    flight, path = swung(velocity=MOVING)
    dut = oracle_pendulum(flight, VEHICLE, PAYLOAD, path)
    assert isinstance(dut, ReadsPlan)
    memory = dut.update(dut.initial_memory(), flight.sample(0))
    plan = held_plan(flight.x[0], flight.u[0], steps=10, step=0.04)
    alone = dut.forecast(memory, horizon=10, stride=2).offset
    told = dut.forecast_along(memory, plan, horizon=10, stride=2).offset
    np.testing.assert_array_equal(alone, told)
    # Ten steps of 40 ms end where twenty of 20 ms do; both are second order in their step.
    fine = dut.forecast(memory, horizon=20, stride=1).offset[:, :3].reshape(10, 2, 3).mean(axis=1)
    np.testing.assert_allclose(alone[:, :3], fine, atol=0.02 * SWING)


def test_a_sample_of_nan_leaves_a_usable_memory():
    flight, path = swung()
    dut = oracle_pendulum(flight, VEHICLE, PAYLOAD, path, Rest(0.1))
    memory = dut.update(dut.initial_memory(), flight.sample(0))
    flight.x[1], flight.u[1], flight.chi[1] = np.nan, np.nan, np.nan
    memory = dut.update(memory, flight.sample(1))
    assert np.isfinite(dut.forecast(memory, horizon=5, stride=1).offset).all()
