"""Laws of what motions tell, by the residual model's own columns."""

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.effects.explanation import Explanation
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_design.multisine import random_multisine
from np_drake.flight_design.prediction import (
    Expected,
    expected_residual,
    nominal_residuals,
    predict,
)
from np_drake.references.base import Hover
from np_drake.vehicle import Vehicle

T = 0.02 * np.arange(401)
HOVER = Hover(np.array([0.0, 0.0, 1.2]))


def told(explanations, readings, reference):
    flight = nominal_residuals(Vehicle(), T, reference.sample(T))
    return predict(flight, explanations, readings).information


@pytest.fixture(scope="module")
def motion(limits):
    return random_multisine(limits, 8.0, seed=0)


def test_a_nominal_flight_leaves_no_residual(motion):
    flight = nominal_residuals(Vehicle(), T, motion.sample(T))
    weight = Vehicle().mass * Vehicle().gravity
    assert np.abs(flight.y[:, :3]).max() < 0.02 * weight  # held commands and low-passes
    blind = nominal_residuals(Vehicle(), T, motion.sample(T), accelerations=False)
    assert blind.log.a is None


def test_rest_cannot_separate_drag_from_nothing(readings, nothing, drag, motion):
    still = told([nothing, drag], readings, HOVER)
    assert still.distances[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert told([nothing, drag], readings, motion).distances[0, 1] > 0.3


def test_motion_separates_mass_from_thrust_better_than_rest(readings, heavy, motion):
    hover, moved = (told(heavy, readings, m).distances[0, 1] for m in (HOVER, motion))
    assert hover < 0.1
    assert moved > 3 * hover


def test_parameters_that_are_known_have_no_columns(drag):
    flight = nominal_residuals(Vehicle(), T, HOVER.sample(T))
    known = Explanation(drag.named, 1.0, drag.effects)
    assert expected_residual(flight, known, Options.for_sensors(False)).spread.shape == (
        len(flight.t),
        15,
        0,
    )


def test_spread_is_the_change_by_a_deviation(drag, motion):
    flight = nominal_residuals(Vehicle(), T, motion.sample(T))
    dut = expected_residual(flight, drag, Options.for_sensors(False))
    mean, spread = dut.mean, dut.spread
    # Each deviation is half of the drag's value on its axis; the order of columns and their signs
    # are free.
    size = np.sqrt(np.sum(spread**2, axis=2))
    np.testing.assert_allclose(size[:, :3], 0.5 * np.abs(mean[:, :3]), atol=2e-3)


def test_a_payload_brings_its_hidden_swing():
    hung = Explanation(("suspended_payload",), 1.0, (SuspendedPayload(0.2, 0.6, 0, 0, 0, 0.1),))
    flight = nominal_residuals(Vehicle(), T, HOVER.sample(T))
    assert expected_residual(flight, hung, Options.for_sensors(False)).spread.shape[-1] == 4


def test_motion_narrows_the_intervals_of_drag_and_rest_does_not(readings, drag, motion):
    names = drag.parameters
    for reference, narrower in ((HOVER, False), (motion, True)):
        flight = nominal_residuals(Vehicle(), T, reference.sample(T))
        (found,) = predict(flight, [drag], readings).intervals
        assert set(found) == set(names)
        for before, after in found.values():
            assert before == pytest.approx(1.96 * 0.05)
            assert after <= before * (1 + 1e-9)
            assert (after < 0.97 * before) == narrower


def test_intervals_are_those_of_the_transformed_covariance():
    root = np.array([[2.0, 0.0], [1.0, 3.0]])
    dut = Expected(np.zeros((1, 15)), np.zeros((1, 15, 2)), ("a", "b"), root)
    after = np.array([[0.5, 0.1], [0.1, 0.25]])
    found = dut.intervals(after)
    both = root @ after @ root.T
    np.testing.assert_allclose(found["a"], 1.96 * np.sqrt([4.0, both[0, 0]]))
    np.testing.assert_allclose(found["b"], 1.96 * np.sqrt([10.0, both[1, 1]]))
