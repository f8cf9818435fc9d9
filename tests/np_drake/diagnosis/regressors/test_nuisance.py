"""Laws of nuisance parameters: calibration and sensor errors within tolerance."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.calibration import flight_errors
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import SPREAD, Options, Tolerance
from np_drake.diagnosis.regressors import calibration, calibration_terms, with_input
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.mass_error import MassError
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]


def test_a_throttle_opens_the_mounting_and_the_latency_of_its_autopilot(flights):
    # other vehicles have both in their calibration
    held = dc.replace(Vehicle(), command_timing="held")
    flying = [
        dc.replace(e, vehicle=held, log=dc.replace(e.log, input="normalised")) for e in flights
    ]
    open_ = with_input(Options.for_sensors(True), flying).tolerance
    found = {t.effect.identifier: d for t, d in calibration_terms(Vehicle(), open_)}
    assert (found["imu_mounting"], found["attitude_latency"]) == (SPREAD.mounting, SPREAD.latency)
    assert [c.size for c in calibration(flights, open_)].count(3) == 1  # three axes of the mounting


def test_calibration_is_mass_and_thrust_at_their_deviations(flights):
    found = {type(t.effect).identifier: d for t, d in calibration_terms(Vehicle(), Tolerance())}
    assert found == {"thrust_scale": 0.005, "mass_error": pytest.approx(0.010)}
    columns = calibration(flights, Tolerance())
    assert [c.size for c in columns] == [1, 1]
    e = flights[0]
    expected = predicted_residual(e, [Term(MassError(0.010))])
    # linear to 10 %
    np.testing.assert_allclose(columns[1].columns["a"][..., 0], expected, rtol=0.15, atol=1e-6)
    assert all(c.identifiers == () for c in columns)


def test_every_flight_drifts_on_its_own(flights):
    first, second = flight_errors(flights, Tolerance())
    assert first.size == second.size == 12  # three axes of four sensors
    assert not first.columns["b"].any()
    assert not second.columns["a"].any()
    expected = predicted_residual(flights[0], [Term(GyroBias(0.01, 0.0, 0.0))])
    shares = [np.abs(first.columns["a"][..., j] - expected).max() for j in range(12)]
    assert min(shares) < 1e-12
