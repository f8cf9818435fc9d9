"""Laws of inputs that leave something open: when a command acts, how a throttle maps to thrust,
which torque acts.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import flight_errors, healthy_prior, nuisance_of
from np_drake.diagnosis.effect_prior import columns_of, file_priors
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options, Priors, Tolerance
from np_drake.diagnosis.regressors import library_candidates, widen_tolerance
from np_drake.diagnosis.regressors.library_regressors import THROTTLE_SCALE, command_timing
from np_drake.diagnosis.residuals import TORQUE, make_flight_residuals
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.inertia_error import InertiaError
from np_drake.effects.library import unobservable
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.estimation.priors import HEALTHY
from np_drake.logs.inputs import with_throttle_input
from np_drake.vehicle import Vehicle

VEHICLE = Vehicle()
DRAG = LinearDrag(0.3, 0.3, 0.3)


def with_throttle(log, exponent: float, hover: float = 0.4):
    """The log with a collective throttle in the place of its command."""
    weight = VEHICLE.mass * VEHICLE.gravity
    throttle = hover * np.maximum(log.u[:, :1] / weight, 0.0) ** (1 / exponent)
    return with_throttle_input(dc.replace(log, throttle=throttle), VEHICLE)


@pytest.mark.parametrize("every", [2, 3, 4])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_thinned_log_leaves_half_a_row_open(fly, every, seed):
    log = fly(DRAG, seed=seed, noise=1.0).taken(slice(None, None, every))
    timing = command_timing([make_flight_residuals(log, VEHICLE)])
    assert timing == pytest.approx(0.5 * log.step)


def vague(mass: float | None = None, thrust: float | None = None):
    return dc.replace(VEHICLE, mass_uncertainty=mass, thrust_uncertainty=thrust)


@pytest.mark.parametrize("options", [Options.for_sensors(real) for real in (True, False)])
def test_the_larger_of_tolerance_and_vehicle_files_statement_counts(fly, options):
    log, own = fly(seed=1, noise=1.0), options.tolerance
    own = dc.replace(own, unmeasured=own.real)  # no file states that commands are held
    for stated, counts in [((None, None), own), ((1e-4, 1e-4), own)]:
        assert (
            widen_tolerance(options, [make_flight_residuals(log, vague(*stated))]).tolerance
            == counts
        )
    open_ = widen_tolerance(options, [make_flight_residuals(log, vague(0.02, 0.03))]).tolerance
    assert open_ == dc.replace(own, mass=0.02, thrust=0.03)
    assert open_.real is own.real  # how well a vehicle is known tells nothing about sensors


def test_a_throttle_opens_scale_and_curve(fly):
    # other vehicles have a drift in their calibration
    held = dc.replace(VEHICLE, command_timing="held")
    flight = make_flight_residuals(with_throttle(fly(seed=1, noise=1.0), 1.5), held)
    open_ = widen_tolerance(Options.for_sensors(True), [flight]).tolerance
    assert open_.thrust == THROTTLE_SCALE
    assert open_.throttle_curve > 0
    assert (open_.mass, open_.attitude) == (Tolerance().mass, Tolerance().attitude)


def test_without_torque_its_channels_and_its_effects_are_empty(fly):
    log = fly(DRAG, seed=1, noise=1.0)
    u = np.where(np.arange(4) == 0, log.u, np.nan)
    flight = make_flight_residuals(dc.replace(log, u=u, input="thrust_only"), VEHICLE)
    assert not flight.knows_torque
    assert not flight.y[:, TORQUE].any()
    names = {c.identifiers[-1] for c in library_candidates([flight])}
    assert "linear_drag" in names
    assert not names & {"inertia_error", "center_of_mass_offset", "weak_rotor", "rotor_gyroscopic"}
    assert names.isdisjoint(unobservable("thrust_only"))


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]


def test_a_throttle_opens_the_mounting_and_the_latency_of_its_autopilot(flights):
    # other vehicles have both in their calibration
    held = dc.replace(Vehicle(), command_timing="held")
    flying = [
        dc.replace(e, vehicle=held, log=dc.replace(e.log, input="normalised")) for e in flights
    ]
    open_ = widen_tolerance(Options.for_sensors(True), flying).tolerance
    found = {d.name: set(d.sigma.values()) for d in file_priors(Vehicle(), open_)}
    assert found["imu_mounting"] == {HEALTHY.mounting}
    assert found["attitude_latency"] == {HEALTHY.latency}


def test_calibration_is_mass_and_thrust_at_their_deviations(flights):
    every = file_priors(Vehicle(), Tolerance())
    found = {d.name: d.sigma for d in every}
    assert found == {
        "thrust_scale": {"scale": 0.005},
        "mass_error": {"delta_mass": pytest.approx(0.010)},
    }
    expected = predicted_residual(flights[0], [Term(MassError(0.010))])
    # linear to 10 %
    columns = columns_of(flights[0], every)
    np.testing.assert_allclose(columns[..., 1], expected, rtol=0.15, atol=1e-6)
    assert all(c.identifiers == () for c in nuisance_of(flights, Tolerance(), Priors()))


STATED = Vehicle(
    rotor_time_constant=0.03,
    intervals={
        "thrust_coefficient": (VEHICLE.thrust_coefficient * np.array([0.96, 1.04])).tolist(),
        **{f"inertia[{i}][{i}]": [0.9 * J, 1.1 * J] for i, J in enumerate(VEHICLE.J.diagonal())},
        "rotor_time_constant": [0.024, 0.036],
        "calibration.center_of_mass": [[-0.002, 0.002]] * 3,
    },
).check()


def test_what_a_file_states_of_a_field_is_its_prior(flights):
    found = {d.name: d for d in file_priors(STATED, Tolerance(thrust=0.02))}
    assert list(found["inertia_error"].sigma.values()) == pytest.approx([0.1 / 1.96] * 3)
    assert found["motor_lag"].sigma == {"time_constant": pytest.approx(0.006 / 1.96)}
    assert found["motor_lag"].term.effect.time_constant == 0.03
    assert list(found["center_of_mass_offset"].sigma.values()) == pytest.approx([0.002 / 1.96] * 3)
    assert "weak_rotor[1]" not in found  # nothing is stated of its gain


@pytest.mark.parametrize("axes, excused", [(1, False), (3, True)])
def test_what_is_stated_of_some_axes_does_not_excuse_the_others(flights, axes, excused):
    moments = enumerate(VEHICLE.J.diagonal()[:axes])
    some = {f"inertia[{i}][{i}]": [0.9 * J, 1.1 * J] for i, J in moments}
    e = dc.replace(flights[0], vehicle=dc.replace(VEHICLE, intervals=some))
    found = healthy_prior(InertiaError(1.2, 1.2, 1.2), e, Tolerance())
    assert bool(found) is excused


def test_a_stated_vehicle_whose_logs_hold_its_commands_is_measured(fly):
    flight = make_flight_residuals(fly(seed=1, noise=1.0), STATED)
    found = widen_tolerance(Options.for_sensors(True), [flight]).tolerance
    assert not found.unmeasured
    assert found.thrust == pytest.approx(0.04 / 1.96)
    slow = dc.replace(flight, log=dc.replace(flight.log, timing=0.01))
    assert widen_tolerance(Options.for_sensors(True), [slow]).tolerance.unmeasured


def test_every_flight_drifts_on_its_own(flights):
    first, second = flight_errors(flights, Tolerance())
    assert first.size == second.size == 12  # three axes of four sensors
    assert not first.columns["b"].any()
    assert not second.columns["a"].any()
    expected = predicted_residual(flights[0], [Term(GyroBias(0.01, 0.0, 0.0))])
    shares = [np.abs(first.columns["a"][..., j] - expected).max() for j in range(12)]
    assert min(shares) < 1e-12
