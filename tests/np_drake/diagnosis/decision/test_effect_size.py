"""Laws of the size of an effect over flights."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.decision.term_assessment import size_of, within_calibration
from np_drake.diagnosis.forward_model import Term
from np_drake.diagnosis.options import IDEAL_SENSORS, Options, Tolerance
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
DRAG = LinearDrag(0.6, 0.6, 0.6)


@pytest.fixture(scope="module")
def flights(seen):
    return [
        seen(MassError(0.2), DRAG, name=n, seed=i, noise=1.0, seconds=6.0)
        for i, n in enumerate("ab")
    ]


@pytest.fixture(scope="module")
def fit(fit_at):
    return fit_at(MassError(0.2), DRAG, GyroBias(0.03, 0.0, 0.04), covariance=0.01)


def test_the_size_of_a_mass_is_its_share_of_the_weight(flights, fit, noise):
    found = size_of(fit, 0, flights, noise.rms, IDEAL_SENSORS)
    lift = np.concatenate([e.nominal[:, 2] for e in flights])
    expected = 0.2 / 2.2 * np.sqrt(np.mean(lift**2)) / (2.0 * 9.81)
    assert found.force == pytest.approx(expected, rel=0.02)  # of the mass beside a drag
    assert found.torque < 0.02
    assert 0.5 < found.gap <= 1.0


def test_what_does_little_in_the_fit_counts_by_what_it_does_held_out(flights, fit, noise):
    strong = [
        dc.replace(t, effect=LinearDrag(6.0, 6.0, 6.0)) if j == 1 else t
        for j, t in enumerate(fit.terms)
    ]
    args = (fit, 1, flights, noise.rms, IDEAL_SENSORS)
    alone, beside = size_of(*args), size_of(*args, [(e, strong) for e in flights])
    assert beside.force == pytest.approx(
        alone.force * np.sqrt((1 + (6.0 / 0.6) ** 2) / 2), rel=0.01
    )
    assert (beside.gap, beside.sensor) == (alone.gap, alone.sensor)


def test_the_size_of_a_sensors_error_is_in_its_tolerance(flights, fit, noise):
    found = size_of(fit, 2, flights, noise.rms, Tolerance())
    assert found.sensor == pytest.approx(0.05 / Tolerance().rate)


def test_a_mass_that_comes_in_flight_is_no_error_of_the_file():
    assert within_calibration(Term(MassError(0.1)), REAL)
    assert not within_calibration(Term(MassError(0.1), {"a": 3.0}), REAL)
    assert not within_calibration(Term(MassError(0.1)), IDEAL)
    assert not within_calibration(Term(LinearDrag()), REAL)
