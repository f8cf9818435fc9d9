"""Laws of library effects as regressors."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import library_candidates, wind_candidates
from np_drake.diagnosis.regressors.library_regressors import _not_negative, widen_tolerance
from np_drake.effects.base import correlation_root
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.vehicle import Vehicle


@pytest.fixture(scope="module")
def flights(seen):
    return [
        seen(name="a", seed=1, noise=1.0, seconds=8.0),
        seen(name="b", seed=2, noise=1.0, seconds=6.0),
    ]


@pytest.fixture(scope="module")
def candidates(flights):
    return library_candidates(flights)


def trace(candidate, coefficients, flight):
    return predicted_residual(flight, candidate.terms(np.asarray(coefficients)))


def gap(found, expected) -> float:
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


LINEAR = [
    n for n, e in LIBRARY.items() if e.linear and e.place == "wrench" and n != "rotor_gyroscopic"
]


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_columns_times_coefficients_are_the_trace_of_their_terms(flights, candidates, data):
    candidate = data.draw(st.sampled_from([c for c in candidates if c.identifiers[0] in LINEAR]))
    c = np.array(
        data.draw(st.lists(st.floats(0.01, 0.6), min_size=candidate.size, max_size=candidate.size))
    )
    for e in flights:
        np.testing.assert_allclose(
            candidate.columns[e.name] @ c, trace(candidate, c, e), rtol=1e-6, atol=1e-7
        )


@settings(max_examples=15, deadline=None)
@given(st.floats(0.3, 1.0), st.tuples(*[st.floats(-0.9, 0.9)] * 3))
def test_wind_is_felt_through_the_drag_that_comes_with_it(flights, candidates, drag, wind):
    (dut,) = wind_candidates(flights, candidates)
    assert dut.identifiers == ("linear_drag", "constant_wind")
    # drag times wind is linear while the drag is the same along all axes
    c = np.r_[np.linalg.solve(correlation_root(LinearDrag), np.full(3, drag)), wind]
    for e in flights:
        assert gap(dut.columns[e.name] @ c, trace(dut, c, e)) < 1e-6


@pytest.mark.parametrize("timing, unmeasured", [("held", False), ("unknown", True)])
def test_a_file_that_states_how_commands_act_describes_the_vehicle(seen, timing, unmeasured):
    e = seen(vehicle=Vehicle(command_timing=timing), seed=1, seconds=4.0)
    assert widen_tolerance(Options.for_sensors(True), [e]).tolerance.unmeasured is unmeasured


@given(st.integers(0, 2**31))
def test_a_drag_takes_power_whatever_the_regression_says(seed):
    rng = np.random.default_rng(seed)
    root, A = np.tril(rng.normal(size=(3, 3))) + 3 * np.eye(3), rng.normal(size=(3, 3))
    mean, covariance = rng.normal(size=3), A @ A.T + 0.1 * np.eye(3)
    one_sided = np.array([True, True, False])
    c, log_probability = _not_negative(root, one_sided, mean, covariance)
    away = root @ c
    assert np.all(away[:2] >= -1e-9)
    kept = (root @ mean >= 0) | ~one_sided
    np.testing.assert_allclose(away[kept], (root @ mean)[kept], atol=1e-9)
    assert log_probability <= 0
