"""Laws of the fit of a payload's swing."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import STATE, Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.swing_fit import SwingFit
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

PAYLOAD = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05)
WIDE = np.array([1.0, -0.8, -3.0, 4.0])  # [rad, rad/s]


@pytest.fixture
def thrown(seen):
    """Return a flight whose payload swings as `WIDE` from the start, with noise and nothing
    else.
    """
    flight = seen(name="c", seed=4, noise=1.0)
    return dc.replace(
        flight, y=flight.y + predicted_residual(flight, [Term(PAYLOAD, hidden={"c": WIDE})])
    )


@pytest.mark.parametrize("shocked", [(), range(245, 262)])
def test_the_cost_is_that_of_whitening_the_whole_flight_and_the_prior(thrown, noise, shocked):
    thrown = dc.replace(thrown, outliers=np.isin(np.arange(len(thrown.t)), shocked))
    rows = (thrown.t > 3.0) & (thrown.t < 5.0)
    drag = Term(LinearDrag(0.2, 0.2, 0.2))
    dut = SwingFit([drag, Term(PAYLOAD)], 1, thrown, noise, None, rows, priors=REAL.priors)
    swings = np.array([np.resize(WIDE, dut.size), np.resize(0.3 * WIDE, dut.size)])
    for cost, swing in zip(dut.costs(swings), swings, strict=True):
        residual = thrown.y - predicted_residual(thrown, [drag, dut.term(swing)])
        white = thrown.white(noise, residual)[rows[noise.phi.shape[1] :]]
        rate = np.sqrt(thrown.vehicle.gravity / PAYLOAD.length)
        prior = np.sum(
            (swing / (REAL.priors.swing * np.resize([1.0, 1.0, rate, rate], dut.size))) ** 2
        )
        assert cost == pytest.approx(np.sum(white**2) + prior, rel=1e-9)


def test_a_wide_swing_is_found_from_rest_where_descent_alone_is_not_enough(thrown, noise):
    rows = thrown.t < 2.0
    dut = SwingFit([Term(PAYLOAD)], 0, thrown, noise, None, rows, priors=REAL.priors)
    rest = np.zeros(STATE)
    true, alone, found = dut.costs(
        np.array([WIDE, dut.descend(rest), dut.descend_from_grid(rest, slice(STATE))])
    )
    assert found < 1.1 * true < 0.5 * alone


def test_a_search_never_ends_above_where_it_began(thrown, noise):
    dut = SwingFit([Term(PAYLOAD)], 0, thrown, noise, None, thrown.t < 2.0, priors=REAL.priors)
    before, descended, searched = dut.costs(
        np.array([WIDE, dut.descend(WIDE), dut.descend_from_grid(WIDE, slice(STATE))])
    )
    assert descended <= before
    assert searched <= descended


def test_figures_that_are_not_free_stay(thrown, noise):
    flight = dc.replace(thrown, outliers=np.isin(np.arange(len(thrown.t)), [300, 301]))
    dut = SwingFit(
        [Term(PAYLOAD, hidden={"c": WIDE})],
        0,
        flight,
        noise,
        None,
        flight.t > 6.0,
        priors=REAL.priors,
    )
    assert dut.size == 2 * STATE
    np.testing.assert_array_equal(dut.known, [*WIDE, 0, 0, 0, 0])
    jump = slice(STATE, 2 * STATE)
    for swing in (dut.descend(dut.known, jump), dut.descend_from_grid(dut.known, jump)):
        np.testing.assert_array_equal(swing[:STATE], WIDE)
        assert np.any(swing[jump] != 0.0)


def test_rows_too_few_to_whiten_leave_the_prior_alone(thrown, noise):
    order = noise.phi.shape[1]
    assert order > 0
    for rows in (np.zeros(len(thrown.t), bool), np.arange(len(thrown.t)) < order):
        dut = SwingFit([Term(PAYLOAD)], 0, thrown, noise, None, rows, priors=REAL.priors)
        assert dut.costs(np.zeros((1, STATE))) == 0.0
        np.testing.assert_allclose(dut.descend(WIDE), 0.0, atol=1e-12)


def test_the_payload_it_returns_begins_where_it_was_asked_to(thrown, noise):
    dut = SwingFit(
        [Term(PAYLOAD, {"a": 1.0})], 0, thrown, noise, 4.0, thrown.t > 4.0, priors=REAL.priors
    )
    assert dut.term(WIDE).onset == {"a": 1.0, "c": 4.0}


def test_a_swing_of_which_rows_say_nothing_is_doubted_as_widely_as_before(thrown, noise):
    dut = SwingFit(
        [Term(PAYLOAD)], 0, thrown, noise, None, np.zeros(len(thrown.t), bool), priors=REAL.priors
    )
    rate = np.sqrt(thrown.vehicle.gravity / PAYLOAD.length)
    wide = dut.posterior_swings(slice(STATE)) / (
        REAL.priors.swing * np.array([1.0, 1.0, rate, rate])
    )
    np.testing.assert_allclose(np.cov(wide.T), np.eye(STATE), atol=0.2)
    np.testing.assert_allclose(wide.mean(axis=0), 0.0, atol=0.1)


@pytest.mark.parametrize("free", [slice(None), slice(STATE), slice(0, STATE)])
def test_doubts_are_the_same_at_each_call(thrown, noise, free):
    dut = SwingFit(
        [Term(PAYLOAD)], 0, thrown, noise, None, np.zeros(len(thrown.t), bool), priors=REAL.priors
    )
    np.testing.assert_array_equal(dut.posterior_swings(free), dut.posterior_swings(slice(0, STATE)))


def test_doubts_are_of_free_figures_and_as_large_as_the_errors_of_fits(seen, noise):
    errors = []
    for seed in range(12):
        flight = seen(name="c", seed=seed, noise=1.0, seconds=4.0)
        flight = dc.replace(
            flight, y=flight.y + predicted_residual(flight, [Term(PAYLOAD, hidden={"c": WIDE})])
        )
        dut = SwingFit(
            [Term(PAYLOAD, hidden={"c": WIDE})],
            0,
            flight,
            noise,
            None,
            flight.t < 2.0,
            priors=REAL.priors,
        )
        deviation = dut.posterior_swings(slice(STATE)).std(axis=0)
        errors.append((dut.descend(WIDE) - WIDE) / deviation)
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.5
    shocked = dc.replace(flight, outliers=np.isin(np.arange(len(flight.t)), [150, 151]))
    dut = SwingFit([Term(PAYLOAD)], 0, shocked, noise, None, shocked.t > 3.0, priors=REAL.priors)
    assert not dut.posterior_swings(slice(STATE, 2 * STATE))[:, :STATE].any()
