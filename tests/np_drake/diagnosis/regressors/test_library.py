"""Laws of library effects as regressors."""

import dataclasses as dc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import (
    heavy_enough,
    library_candidates,
    payloads_of,
    switched,
    wind_candidates,
)
from np_drake.diagnosis.regressors.library import _effect_candidates, _not_negative
from np_drake.diagnosis.regressors.payload import LEAST_MASS_DEVIATIONS
from np_drake.diagnosis.residuals import flight_residuals as ev
from np_drake.diagnosis.residuals import make_flight_residuals
from np_drake.effects.library import LIBRARY
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.parameter_prior import correlation_root
from np_drake.vehicle import Vehicle

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)


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


def test_every_effect_is_tried_but_those_that_act_through_others(candidates):
    named = {c.identifiers for c in candidates}
    hidden = {"suspended_payload", *(n for n, e in LIBRARY.items() if e.needs)}
    assert named == {(n,) for n in LIBRARY if n not in hidden}


def test_the_gain_of_the_mixer_is_tried_only_with_measured_rotor_speed(flights, candidates):
    measured = [dc.replace(e, log=dc.replace(e.log, input="rotor_speed")) for e in flights]
    tried = {c.identifiers for c in library_candidates(measured)}
    assert ("mixer_gain",) in tried
    assert ("motor_lag",) not in tried
    assert ("mixer_gain",) not in {c.identifiers for c in candidates}


def test_variants_of_an_effect_share_one_prior(candidates):
    for name in {c.identifiers for c in candidates}:
        assert sum(
            np.exp(c.log_prior) for c in candidates if c.identifiers == name
        ) == pytest.approx(1.0)


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


@pytest.mark.parametrize(
    "name", [n for n in LIBRARY if n not in ("suspended_payload", "constant_wind", "gusty_wind")]
)
def test_small_coefficients_mean_small_effects_of_that_trace(flights, candidates, name):
    for candidate in (c for c in candidates if c.identifiers == (name,)):
        single = _effect_candidates(LIBRARY[name], flights, {})
        assert candidate.variant in {c.variant for c in single}
        c = np.full(
            candidate.size, 0.5 if not LIBRARY[name].linear and candidate.size == 1 else 0.05
        )
        for e in flights:
            most = (
                0.1 if name == "center_of_mass_offset" else 0.05
            )  # its force is of second order before long
            assert gap(candidate.columns[e.name] @ c, trace(candidate, c, e)) < most


def test_coefficients_beyond_the_bounds_mean_an_effect_at_its_bounds(candidates):
    for candidate in candidates:
        for far in (-1e3, 1e3):
            (term,) = candidate.terms(np.full(candidate.size, far))
            for p in term.effect.parameters:
                assert p.lower <= getattr(term.effect, p.name) <= p.upper


@settings(max_examples=15, deadline=None)
@given(st.floats(0.3, 1.0), st.tuples(*[st.floats(-0.9, 0.9)] * 3))
def test_wind_is_felt_through_the_drag_that_comes_with_it(flights, candidates, drag, wind):
    (dut,) = wind_candidates(flights, candidates)
    assert dut.identifiers == ("linear_drag", "constant_wind")
    # drag times wind is linear while the drag is the same along all axes
    c = np.r_[np.linalg.solve(correlation_root(LinearDrag), np.full(3, drag)), wind]
    for e in flights:
        assert gap(dut.columns[e.name] @ c, trace(dut, c, e)) < 1e-6


@pytest.mark.parametrize("drag", [-0.3, 0.0, 0.1])
def test_a_wind_pushes_as_much_whatever_the_sign_of_a_weak_drag(flights, candidates, drag):
    (dut,) = wind_candidates(flights, candidates)
    c = np.r_[np.linalg.solve(correlation_root(LinearDrag), np.full(3, drag)), 0.5, -0.4, 0.3]
    felt, wind = dut.terms(c)
    for e in flights:
        pushed = predicted_residual(e, [felt, wind]) - predicted_residual(e, [felt])
        assert gap(dut.columns[e.name][..., 3:] @ c[3:], pushed) < 1e-6


def test_a_payload_at_rest_has_the_trace_of_its_terms(flights):
    (dut,) = (p.candidate(flights) for p in payloads_of(flights, np.array([0.6]), REAL.priors))
    c = np.zeros(dut.size)
    c[0], c[3] = 0.9, -0.4  # mass, and the hook below
    for e in flights:
        assert (
            gap((dut.columns[e.name] @ c)[:, ev.FORCE], trace(dut, c, e)[:, ev.FORCE]) < 0.08
        )  # a hook turns about Bo
        assert gap((dut.columns[e.name] @ c)[:, ev.TORQUE], trace(dut, c, e)[:, ev.TORQUE]) < 0.1


def test_a_payload_that_swings_has_the_trace_of_its_terms(flights):
    (dut,) = (p.candidate(flights) for p in payloads_of(flights, np.array([0.6]), REAL.priors))
    c = np.zeros(dut.size)
    c[0] = 1.0
    c[4:] = 0.3 * np.array([1, -1, 0.5, 0.5, -1, 1, 0.5, -0.5])  # every flight has its own start
    for e in flights:
        rest = np.where(np.arange(dut.size) < 4, c, 0.0)
        moved = (dut.columns[e.name] @ (c - rest))[:, ev.FORCE]
        expected = (trace(dut, c, e) - trace(dut, rest, e))[:, ev.FORCE]
        assert gap(moved, expected) < 0.2  # pendulums are linear to first order


def test_a_payload_weighs_something(flights):
    (dut,) = (p.candidate(flights) for p in payloads_of(flights, np.array([0.6]), REAL.priors))
    c = np.zeros(dut.size)
    assert dut.possible is not None
    assert not dut.possible(c)
    c[0] = -1.0
    assert not dut.possible(c)
    c[0] = 1.0
    assert dut.possible(c)
    c[4] = 50.0  # swings further than a payload can
    assert not dut.possible(c)


def test_a_mass_hardly_told_is_one_that_hangs_and_the_rest_goes_with_it():
    covariance = np.array([[0.01, -0.006, 0.0], [-0.006, 0.02, 0.001], [0.0, 0.001, 0.03]])
    for mean in (-0.05, 0.1):
        c = np.array([mean, 0.3, -0.2])
        mended, log_probability = heavy_enough(c, covariance)
        assert mended[0] == pytest.approx(LEAST_MASS_DEVIATIONS * 0.1)
        moved = mended - c  # as the posterior's conditional mean does
        np.testing.assert_allclose(moved, covariance[:, 0] / 0.01 * moved[0])
        assert np.exp(log_probability) == pytest.approx(stats.norm.cdf(mean / 0.1))
    heavy = np.array([0.5, 0.3, -0.2])
    mended, log_probability = heavy_enough(heavy, covariance)
    assert mended is heavy
    assert log_probability == pytest.approx(0.0, abs=1e-6)


def test_a_payload_below_zero_by_its_error_is_possible_a_wide_swing_not(flights):
    (dut,) = (p.candidate(flights) for p in payloads_of(flights, np.array([0.6]), REAL.priors))
    c, covariance = np.zeros(dut.size), 0.01 * np.eye(dut.size)
    c[0] = -0.05
    mended, log_probability = dut.physical(c, covariance)
    assert mended[0] == pytest.approx(0.2)
    assert np.isfinite(log_probability)
    c[4] = 50.0
    assert dut.physical(c, covariance)[1] == -np.inf


@pytest.mark.parametrize("effect", [LinearDrag, MassError], ids=lambda e: e.identifier)
def test_a_gated_candidate_is_that_of_its_onset(flights, effect):
    (plain,) = _effect_candidates(effect, flights, {})
    onset = {"a": 3.0}
    late = switched(plain, flights, onset)
    c = np.full(plain.size, 0.05)
    (term,) = late.terms(c)
    assert term.onset == onset
    expected = predicted_residual(flights[0], [Term(term.effect, onset)])
    outside = np.abs(flights[0].t - 3.0) > 0.25  # the low-pass
    assert gap((late.columns["a"] @ c)[outside], expected[outside]) < 0.01
    np.testing.assert_array_equal(late.columns["b"], plain.columns["b"])


def test_effects_that_cannot_begin_in_flight_have_no_onset(flights):
    names = {n for c in library_candidates(flights, {"a": 3.0}) for n in c.identifiers}
    assert names
    assert all(LIBRARY[n].begins for n in names)


def test_without_accelerations_no_accelerometer_is_blamed(seen):
    bare = [seen(accelerations=False, seconds=5.0)]
    assert ("accelerometer_bias",) not in {c.identifiers for c in library_candidates(bare)}


def test_where_rotor_speed_is_measured_no_motor_is_blamed(fly):
    flight = make_flight_residuals(dc.replace(fly(seconds=5.0), input="rotor_speed"), Vehicle())
    names = {c.identifiers[0] for c in library_candidates([flight])}
    assert not names & {"motor_lag", "command_delay", "clock_offset"}
    assert "thrust_scale" in names


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


def test_a_drag_is_half_as_probable_at_none_and_impossible_far_below():
    root, one_sided, I = np.eye(2), np.array([True, False]), np.eye(2)
    assert _not_negative(root, one_sided, np.array([0.0, -9.0]), I)[1] == pytest.approx(np.log(0.5))
    assert _not_negative(root, one_sided, np.array([-8.0, 0.0]), I)[1] < -30
    assert _not_negative(root, one_sided, np.array([8.0, -9.0]), I)[1] == pytest.approx(
        0.0, abs=1e-9
    )
