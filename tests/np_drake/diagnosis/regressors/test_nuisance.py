"""Laws of nuisance parameters: calibration and sensor errors within tolerance."""

import numpy as np
import pytest

from np_drake.diagnosis.forward_model.prediction import predicted_residual
from np_drake.diagnosis.forward_model.term import Term
from np_drake.diagnosis.regressors.nuisance import calibration, calibration_terms, sensor_drift, tolerance_of
from np_drake.diagnosis.tolerance import IDEAL_SENSORS, Tolerance
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.mass_error import MassError
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=n, seed=i, seconds=4.0) for i, n in enumerate("ab")]


def test_noise_of_the_attitude_tells_a_rig_from_a_laboratory(seen, flights):
    assert tolerance_of(flights) == IDEAL_SENSORS
    assert not IDEAL_SENSORS.real
    rig = tolerance_of([*flights, seen(attitude_noise=0.01, seconds=4.0)])
    assert rig == Tolerance()
    assert rig.real


def test_a_tolerance_is_of_a_sensor_and_of_nothing_else():
    assert Tolerance().of("gyro_bias") == Tolerance().rate
    assert Tolerance().of("accelerometer_bias") == Tolerance().acceleration
    assert Tolerance().of("linear_drag") == 0.0


def test_calibration_is_mass_and_thrust_at_their_deviations(flights):
    found = {type(t.effect).identifier: d for t, d in calibration_terms(Vehicle(), Tolerance())}
    assert found == {"thrust_scale": 0.005, "mass_error": pytest.approx(0.010)}
    columns = calibration(flights, Tolerance())
    assert [c.size for c in columns] == [1, 1]
    e = flights[0]
    expected = predicted_residual(e, [Term(MassError(0.010))])
    np.testing.assert_allclose(
        columns[1].columns["a"][..., 0], expected, rtol=0.15, atol=1e-6
    )  # linear to 10 %
    assert all(c.identifiers == () for c in columns)


def test_every_flight_wanders_on_its_own(flights):
    dut = sensor_drift(flights, Tolerance())
    assert dut is not None
    assert dut.size == 2 * 12  # three axes of four sensors, two flights
    np.testing.assert_array_equal(dut.columns["a"][..., 12:], 0.0)
    np.testing.assert_array_equal(dut.columns["b"][..., :12], 0.0)
    expected = predicted_residual(flights[0], [Term(GyroBias(0.01, 0.0, 0.0))])
    shares = [np.abs(dut.columns["a"][..., j] - expected).max() for j in range(12)]
    assert min(shares) < 1e-12


def test_in_a_laboratory_nothing_wanders(flights):
    assert sensor_drift(flights, IDEAL_SENSORS) is None


def test_what_is_not_logged_does_not_wander(seen):
    dut = sensor_drift([seen(accelerations=False, seconds=4.0)], Tolerance())
    assert dut is not None
    assert dut.size == 9
