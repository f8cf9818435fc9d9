"""Laws of the documented spread of healthy vehicles, and of its columns."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import (
    calibrated_alone,
    columns_of,
    drift_columns,
    of_vehicle,
    vehicle_columns,
)
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, Options, Tolerance
from np_drake.effects.mass_error import MassError
from np_drake.effects.weak_rotor import WeakRotor

UNMEASURED = dc.replace(Tolerance(), unmeasured=True)
PRIORS = Options.for_sensors(True).priors


@pytest.fixture(scope="module")
def flight(seen):
    return seen(name="a", seed=1, seconds=6.0)


def test_a_column_is_what_one_deviation_does(flight):
    shared = of_vehicle(flight, UNMEASURED)
    (first,) = [d for d in shared if d.effect is WeakRotor and d.fixed == {"rotor": 1.0}]
    column = columns_of(flight, [first])[..., 0]
    expected = predicted_residual(flight, [Term(WeakRotor(1.0, 1.0 + SPREAD.rotor_gain))])
    np.testing.assert_allclose(column, expected, atol=1e-12)


def test_an_airframe_has_no_drag_of_its_own_beside_the_effect(flight):
    _, of_air = vehicle_columns([flight], UNMEASURED, PRIORS)
    body = np.einsum("nji,nj->ni", flight.rows.R_WB, flight.rows.x[:, 7:10])
    for axis in range(3):
        force = of_air(flight)[:, axis]
        velocity = np.interp(flight.t, flight.rows.t, body[:, axis])
        acting = force[:, force.std(axis=0) > 0]
        alike = [abs(np.corrcoef(column, velocity)[0, 1]) for column in acting.T]
        assert max(alike) < 0.999


def test_slow_drift_adds_up_to_a_constant(flight):
    X = drift_columns(flight)
    total = X[:, 2].sum(axis=1)
    np.testing.assert_allclose(
        total, SPREAD.known_sag * SPREAD.drift_time * flight.weight, rtol=1e-12
    )


def test_sensors_and_times_are_calibration_whatever_their_size(flight):
    known = calibrated_alone(flight, UNMEASURED)
    assert {"attitude_bias", "gyro_bias", "motor_lag", "mixer_gain"} <= known
    assert known.isdisjoint({"weak_rotor", "center_of_mass_offset", MassError.identifier})
    assert calibrated_alone(flight, Tolerance()) == set()
