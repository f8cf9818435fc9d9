"""Laws of the rotors between command and thrust: the lag of the vehicle file or of an effect."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle
from systems.payload_config import PayloadConfig
from systems.tethered_quadrotor import make_tethered_quadrotor

LAG = 0.05  # [s]
VEHICLE = dc.replace(Vehicle(), rotor_time_constant=LAG)
HOVER = VEHICLE.mass * VEHICLE.gravity


def speeds(times, *effects, onsets=None, start=0.0):
    """Return rotor speed at `times` after `start`, 1 at hover and 2 at the new command."""
    dut = make_tethered_quadrotor(
        VEHICLE, PayloadConfig(tether="none"), actuator_effects=effects, onsets=onsets or {}
    )
    simulator = Simulator(dut)
    context = simulator.get_mutable_context()
    port = dut.get_input_port()
    port.FixValue(context, [HOVER, 0, 0, 0])
    simulator.AdvanceTo(start)
    port.FixValue(context, [2.25 * HOVER, 0, 0, 0])
    out = []
    for t in times:
        simulator.AdvanceTo(start + t)
        thrust = dut.GetOutputPort("rotor_thrust").Eval(context)
        out.append(2 * np.sqrt(thrust.sum() / HOVER) - 1)  # 1 at hover, 2 at the command
    return np.array(out)


def rising(t, lag):
    """Return the relative speed of a first-order rotor after a step."""
    return 2 - np.exp(-np.asarray(t) / lag)


T = (0.01, 0.03, 0.08)


def test_rotors_lag_as_the_vehicle_file_says():
    np.testing.assert_allclose(speeds(T), rising(T, LAG), atol=1e-3)


def test_a_lag_among_the_effects_stands_in_its_place():
    np.testing.assert_allclose(speeds(T, MotorLag(0.02)), rising(T, 0.02), atol=1e-3)


def test_other_effects_act_after_it():
    scaled = speeds(T, ThrustScale(0.81))
    np.testing.assert_allclose(scaled + 1, 0.9 * (rising(T, LAG) + 1), atol=1e-3)


@pytest.mark.parametrize("start, lag", [(0.1, LAG), (0.3, 0.02)], ids=["before", "after"])
def test_a_lag_that_begins_in_flight_takes_over_at_its_onset(start, lag):
    own = MotorLag(0.02)
    np.testing.assert_allclose(
        speeds(T, own, onsets={own: 0.25}, start=start), rising(T, lag), atol=2e-3
    )
