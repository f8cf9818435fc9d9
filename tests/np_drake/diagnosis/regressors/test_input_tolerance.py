"""Laws of inputs that leave something open: when a command acts, how a throttle maps to thrust,
which torque acts.
"""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.options import Options, Tolerance
from np_drake.diagnosis.regressors import library_candidates, with_input
from np_drake.diagnosis.regressors.library import THROTTLE_SCALE, command_timing
from np_drake.diagnosis.residuals import TORQUE, make_flight_residuals
from np_drake.effects.library import unobservable
from np_drake.effects.linear_drag import LinearDrag
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


def test_a_throttle_opens_scale_and_curve(fly):
    # other vehicles have a drift in their calibration
    held = dc.replace(VEHICLE, command_timing="held")
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
