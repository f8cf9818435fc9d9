"""Laws of noise removal from regressor signals."""

import numpy as np

from np_drake.diagnosis.regressors.generic import FlightState

UP_AND_DOWN = (0.0, 0.0, 1.0, 0.0)


def test_an_axis_that_only_its_noise_moves_is_no_regressor(seen):
    flight = seen(seed=1, noise=1.0, vigour=UP_AND_DOWN)
    assert np.std(flight.w[:, 2]) > 0
    np.testing.assert_array_equal(FlightState(flight).w[:, 2], 0.0)


def test_an_axis_that_moves_stays_as_it_is(seen):
    flight = seen(seed=1, noise=1.0)
    np.testing.assert_allclose(FlightState(flight).w, flight.w, rtol=0.1, atol=1e-3)


def test_without_noise_nothing_is_shrunk(seen):
    flight = seen(seed=1)
    np.testing.assert_allclose(FlightState(flight).w, flight.w, rtol=1e-2)
