"""Laws of what motions tell, by the residual model's own columns."""

import numpy as np
import pytest

from np_drake.diagnosis.options import Options
from np_drake.effects.explanation import Explanation
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.flight_design.expected_residual import expected_information, expected_residual, separation
from np_drake.flight_design.motion import Basis
from np_drake.flight_design.naive import naive_motions
from np_drake.flight_design.nominal_flight import nominal_log, nominal_residuals
from np_drake.references.base import Hover
from np_drake.vehicle import Vehicle

T = 0.02 * np.arange(401)
HOVER = Hover(np.array([0.0, 0.0, 1.2]))


def told(explanations, readings, reference):
    flight = nominal_residuals(Vehicle(), T, reference.sample(T))
    return expected_information(flight, explanations, readings)


@pytest.fixture(scope="module")
def motions(limits):
    return naive_motions(limits, Basis(8.0, 0.02), 0.8, 0)


def test_a_nominal_flight_leaves_no_residual(motions):
    flight = nominal_residuals(Vehicle(), T, motions["lemniscate"].sample(T))
    weight = Vehicle().mass * Vehicle().gravity
    assert np.abs(flight.y[:, :3]).max() < 0.01 * weight  # held commands and low-passes
    log = nominal_log(Vehicle(), T, motions["lemniscate"].sample(T), accelerations=False)
    assert log.a is None


def test_rest_cannot_separate_drag_from_nothing(readings, nothing, drag, motions):
    still = told([nothing, drag], readings, HOVER)
    assert still.distances[0, 1] == pytest.approx(0.0, abs=1e-6)
    assert told([nothing, drag], readings, motions["lemniscate"]).distances[0, 1] > 1.0


def test_mass_and_thrust_separate_with_sharp_torque_alone(readings, heavy, motions):
    hover, circle, sharp = (
        told(heavy, readings, m).distances[0, 1] for m in (HOVER, motions["circle"], motions["doublets"])
    )
    assert hover < 0.1
    assert circle < 0.2 * sharp
    assert sharp > 0.5


def test_parameters_that_are_known_have_no_columns(drag):
    flight = nominal_residuals(Vehicle(), T, HOVER.sample(T))
    known = Explanation(drag.named, 1.0, drag.effects)
    assert expected_residual(flight, known, Options.for_sensors(False))[1].shape == (len(flight.t), 15, 0)


def test_spread_is_the_change_by_a_deviation(drag, motions):
    flight = nominal_residuals(Vehicle(), T, motions["lemniscate"].sample(T))
    options = Options.for_sensors(False)
    mean, spread = expected_residual(flight, drag, options)
    # Each deviation is half of the drag's value on its axis; the order of columns and their signs are free.
    size = np.sqrt(np.sum(spread**2, axis=2))
    np.testing.assert_allclose(size[:, :3], 0.5 * np.abs(mean[:, :3]), atol=2e-3)


def test_a_payload_brings_its_hidden_swing():
    hung = Explanation(("suspended_payload",), 1.0, (SuspendedPayload(0.2, 0.6, 0, 0, 0, 0.1),))
    flight = nominal_residuals(Vehicle(), T, HOVER.sample(T))
    assert expected_residual(flight, hung, Options.for_sensors(False))[1].shape[-1] == 4


def test_separation_grows_to_the_distance(readings, nothing, drag, motions):
    flight = nominal_residuals(Vehicle(), T, motions["lemniscate"].sample(T))
    known = Explanation(drag.named, 0.5, drag.effects)
    t, growth = separation(flight, [nothing, known], readings, (0, 1))
    assert len(t) == len(growth) == len(flight.t) - 1  # of the order of the noise
    assert np.diff(growth).min() >= 0.0
    total = expected_information(flight, [nothing, known], readings).distances[0, 1]
    assert growth[-1] <= total * (1 + 1e-9)
    assert growth[-1] == pytest.approx(total, rel=0.1)  # less the prior of sensor errors
