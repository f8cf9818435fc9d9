"""Laws of the rotors between command and thrust: the lag of the vehicle file or of an effect."""

import dataclasses as dc

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from np_drake.effects.calibration import effects_of
from np_drake.effects.combine import split_effects
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.vehicle import Vehicle
from np_drake.vehicle.vehicle import Calibration, RateLoop
from systems.payload_config import PayloadConfig
from systems.plant import set_hover
from systems.rate_loop import RateLoopTorque
from systems.tethered_quadrotor import make_tethered_quadrotor
from tests.systems.conftest import evaluate

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
    port = dut.GetInputPort("u")
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


NO_PAYLOAD = PayloadConfig(tether="none")
NOMINAL = dc.replace(Vehicle(), rotor_time_constant=0.03)


def flying(calibration):
    """Simulator of the calibrated vehicle, at rest 2 m high; u is left to fix."""
    parts = split_effects(effects_of(calibration.check(), NOMINAL))
    dut = make_tethered_quadrotor(
        NOMINAL,
        NO_PAYLOAD,
        wrench_effects=parts.wrench,
        actuator_effects=parts.actuator,
        mass_effects=parts.mass,
    )
    simulator = Simulator(dut)
    plant = dut.GetSubsystemByName("plant")
    context = simulator.get_mutable_context()
    set_hover(plant, plant.GetMyMutableContextFromRoot(context), NO_PAYLOAD, (0.0, 0.0, 2.0))
    return dut, simulator, context


def test_a_thrust_about_the_true_centre_of_mass_hovers():
    calibration = Calibration(
        center_of_mass=[0.004, -0.006, 0.01], rotor_gains=[0.96, 1.02, 1.03, 0.99]
    )
    dut, simulator, context = flying(calibration)
    weight = NOMINAL.mass * NOMINAL.gravity
    x, y, _ = calibration.center_of_mass
    thrust = NOMINAL.unmixer @ [weight, weight * y, -weight * x, 0.0]
    command = thrust / calibration.rotor_gains
    dut.GetInputPort("u").FixValue(context, NOMINAL.mixer @ command)
    actuators = dut.GetSubsystemByName("actuators")
    actuators.rest_at(actuators.GetMyMutableContextFromRoot(context), command)
    simulator.AdvanceTo(0.5)
    np.testing.assert_allclose(evaluate(dut, context, "rotor_thrust"), thrust, rtol=1e-6)
    np.testing.assert_allclose(evaluate(dut, context, "acceleration"), np.zeros(6), atol=1e-4)


@pytest.mark.parametrize("lift, lag", [(1.2, 0.03), (0.8, 0.05)], ids=["up", "down"])
def test_a_command_arrives_late_and_lags_by_its_direction(lift, lag):
    dut, simulator, context = flying(Calibration(command_delay=0.02, rotor_time_constant_down=0.05))
    dut.GetInputPort("u").FixValue(context, lift * NOMINAL.hover_input)
    hover = 0.25 * NOMINAL.mass * NOMINAL.gravity
    simulator.AdvanceTo(0.019)
    np.testing.assert_allclose(evaluate(dut, context, "rotor_thrust"), hover, rtol=1e-6)
    simulator.AdvanceTo(0.021 + lag)  # one lag after it has arrived
    speed = np.sqrt(evaluate(dut, context, "rotor_thrust") / hover)
    share = (speed - 1) / (np.sqrt(lift) - 1)
    # the command steps at a multiple of 1 ms
    np.testing.assert_allclose(share, 1 - np.exp(-1), atol=0.02)


def test_it_passes_thrust_and_turns_by_the_loops_torque():
    vehicle = dc.replace(Vehicle(), rate_loop=RateLoop())
    dut = RateLoopTorque(vehicle)
    context = dut.CreateDefaultContext()
    x, command = np.eye(13)[3], np.array([21.0, 0.5, -0.2, 0.1])
    x[10:] = [0.3, 0.1, -0.4]
    dut.GetInputPort("x").FixValue(context, x)
    dut.GetInputPort("rates_thrust").FixValue(context, command)
    u = dut.get_output_port().Eval(context)
    assert u[0] == 21.0
    np.testing.assert_allclose(u[1:], RateLoop().torque(vehicle.J, x[10:], command[1:]))
