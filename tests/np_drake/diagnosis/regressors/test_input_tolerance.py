"""Laws of inputs that leave something open: when a command acts, how a throttle maps to thrust,
which torque acts.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.diagnose import NO_REPLAY, diagnose
from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.regressors.nuisance import THROTTLE_SCALE, command_timing, with_input
from np_drake.diagnosis.residuals import TORQUE, make_flight_residuals
from np_drake.effects.clock_offset import ClockOffset
from np_drake.effects.command_delay import CommandDelay
from np_drake.effects.library import unobservable
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.motor_lag import MotorLag
from np_drake.effects.thrust_scale import ThrustScale
from np_drake.logs.inputs import with_throttle_input
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
DRAG = LinearDrag(0.3, 0.3, 0.3)
COLUMNS = ("t", "p", "q", "v", "w", "u", "a")


def thinned(log, every: int):
    """The log with every n-th row alone."""
    return dc.replace(log, **{name: getattr(log, name)[::every] for name in COLUMNS})


def without_torque(log):
    u = np.column_stack([log.u[:, 0], np.full((len(log), 3), np.nan)])
    return dc.replace(log, u=u, input="thrust_only")


def with_throttle(log, exponent: float, hover: float = 0.4):
    """The log with a collective throttle in the place of its command."""
    weight = VEHICLE.mass * VEHICLE.gravity
    throttle = hover * np.maximum(log.u[:, :1] / weight, 0.0) ** (1 / exponent)
    return with_throttle_input(dc.replace(log, throttle=throttle), VEHICLE)


@pytest.mark.parametrize("every", [2, 3, 4])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_thinned_log_leaves_half_a_row_open(fly, every, seed):
    log = thinned(fly(DRAG, seed=seed, noise=1.0), every)
    timing = command_timing([make_flight_residuals(log, VEHICLE)])
    assert timing == pytest.approx(0.5 * log.step)


@pytest.mark.parametrize(
    "effects", [(), (DRAG,), (MotorLag(0.03),), (CommandDelay(0.02),), (ClockOffset(0.02),)]
)
def test_a_command_that_is_held_from_its_row_leaves_nothing_open(seen, effects):
    assert command_timing([seen(*effects, seed=1, noise=1.0)]) == 0.0


def test_a_vehicle_file_can_state_that_commands_are_held(fly):
    log = thinned(fly(DRAG, seed=1, noise=1.0), 2)
    held = dc.replace(VEHICLE, command_timing="held")
    assert command_timing([make_flight_residuals(log, held)]) == 0.0


def test_what_a_log_states_is_not_doubted(fly):
    log = dc.replace(fly(seed=1, noise=1.0), timing=0.004)
    assert command_timing([make_flight_residuals(log, VEHICLE)]) == 0.004


def test_measured_rotor_speed_has_no_command(fly):
    log = fly(seed=1, noise=1.0)
    speed = np.sqrt(np.maximum(log.u @ VEHICLE.unmixer.T, 0) / VEHICLE.thrust_coefficient)
    measured = dc.replace(log, rotor=speed, input="rotor_speed", timing=0.1)
    assert command_timing([make_flight_residuals(measured, VEHICLE)]) == 0.0


def test_ideal_commands_leave_the_tolerance_as_it_is(seen):
    options = Options.for_sensors(False)
    assert with_input(options, [seen(seed=1, noise=1.0)]) == options


def vague(mass: float | None = None, thrust: float | None = None):
    return dc.replace(VEHICLE, mass_uncertainty=mass, thrust_uncertainty=thrust)


@pytest.mark.parametrize("options", [Options.for_sensors(real) for real in (True, False)])
def test_the_larger_of_tolerance_and_vehicle_files_statement_counts(fly, options):
    log, own = fly(seed=1, noise=1.0), options.tolerance
    own = dc.replace(own, unmeasured=own.real)  # no file states that commands are held
    for stated, counts in [((None, None), own), ((1e-4, 1e-4), own)]:
        assert with_input(options, [make_flight_residuals(log, vague(*stated))]).tolerance == counts
    open_ = with_input(options, [make_flight_residuals(log, vague(0.02, 0.03))]).tolerance
    assert open_ == dc.replace(own, mass=0.02, thrust=0.03)
    assert open_.real is own.real  # how well a vehicle is known tells nothing about sensors


def test_a_vehicle_file_does_not_narrow_the_scale_of_a_throttle(fly):
    flight = make_flight_residuals(with_throttle(fly(seed=1, noise=1.0), 1.5), vague(thrust=0.02))
    assert with_input(Options.for_sensors(True), [flight]).tolerance.thrust == THROTTLE_SCALE


@pytest.mark.parametrize(
    "effect, stated",
    [(MassError(0.06 * VEHICLE.mass), {"mass": 0.04}), (ThrustScale(0.94), {"thrust": 0.04})],
)
def test_an_error_within_what_the_vehicle_file_states_is_no_cause(fly, inferred, effect, stated):
    logs = [fly(effect, name=str(i), seed=i, seconds=7.0, noise=1.0) for i in (1, 2, 3)]
    for vehicle, names in [(VEHICLE, [effect.identifier]), (vague(**stated), [])]:
        vehicle = dc.replace(vehicle, command_timing="held")
        *train, held_out = [make_flight_residuals(log, vehicle) for log in logs]
        dut = inferred(train, [held_out], Options.for_sensors(True))
        assert [c.identifier for c in dut.causes] == names
        assert not dut.unknown


def test_a_throttle_opens_scale_and_curve(fly):
    held = dc.replace(
        VEHICLE, command_timing="held"
    )  # other vehicles have a drift in their calibration
    flight = make_flight_residuals(with_throttle(fly(seed=1, noise=1.0), 1.5), held)
    open_ = with_input(Options.for_sensors(True), [flight]).tolerance
    assert open_.thrust == THROTTLE_SCALE
    assert open_.throttle_curve > 0
    assert (open_.mass, open_.attitude) == (Tolerance().mass, Tolerance().attitude)


def test_without_torque_its_channels_and_its_effects_are_empty(fly):
    flight = make_flight_residuals(without_torque(fly(DRAG, seed=1, noise=1.0)), VEHICLE)
    assert not flight.knows_torque
    assert not flight.y[:, TORQUE].any()
    names = {c.identifiers[-1] for c in library_candidates([flight])}
    assert "linear_drag" in names
    assert not names & {"inertia_error", "center_of_mass_offset", "weak_rotor", "rotor_gyroscopic"}
    assert names.isdisjoint(unobservable("thrust_only"))


def test_a_drag_is_found_from_thrust_alone_as_from_the_whole_command(fly, inferred):
    logs = [fly(DRAG, name=str(i), seed=i, seconds=7.0, noise=1.0) for i in (1, 2, 3)]
    values = []
    for change in (lambda log: log, without_torque):
        *train, held_out = [make_flight_residuals(change(log), VEHICLE) for log in logs]
        dut = inferred(train, [held_out])
        assert [c.identifier for c in dut.causes] == ["linear_drag"]
        assert not dut.unknown
        values.append(dut.causes[0].parameters["d_x"])
    assert values[1].value == pytest.approx(values[0].value, abs=3 * values[0].value * 0.02)


def test_a_log_without_torque_is_not_replayed_and_the_warnings_say_so(fly):
    def replay(flights, causes):
        raise AssertionError("a simulator was asked to fly without torque")

    logs = [without_torque(fly(name=str(i), seed=i, seconds=6.0, noise=1.0)) for i in (1, 2)]
    dut = diagnose(VEHICLE, logs[:1], logs[1:], replay)
    assert dut.gap_reduction is None or dut.gap_reduction.replay_before is None
    assert NO_REPLAY in dut.warnings


@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_a_drag_is_found_from_throttle_of_unknown_scale_and_curve(fly, inferred, exponent):
    logs = [fly(DRAG, name=str(i), seed=i, seconds=7.0, noise=1.0) for i in (1, 2, 3)]
    *train, held_out = [
        make_flight_residuals(with_throttle(log, exponent), VEHICLE) for log in logs
    ]
    dut = inferred(train, [held_out])
    assert [c.identifier for c in dut.causes] == ["linear_drag"]
    assert dut.causes[0].parameters["d_x"].value == pytest.approx(0.3, abs=0.02)


def test_the_map_of_a_throttle_is_found_up_to_the_noise(fly):
    log = with_throttle(fly(seed=1, noise=1.0), 1.7)
    known = fly(seed=1, noise=1.0).u[:, 0]
    assert np.sqrt(np.mean((log.u[:, 0] / known - 1) ** 2)) < 0.01


def test_each_input_names_what_it_cannot_tell():
    assert unobservable("command") == {}
    assert set(unobservable("rotor_speed")) == {"motor_lag", "command_delay", "clock_offset"}
    assert {"mass_error", "thrust_scale", "thrust_drift"} <= set(unobservable("normalised"))
    assert "accelerometer_bias" in unobservable("command", accelerations=False)
    assert "inertia_error" in unobservable("normalised", torque=False)
