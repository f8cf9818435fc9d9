"""Laws of the fit of a payload's swing."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import STATE, Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.swing_fit import SwingFit
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.suspended_payload import SuspendedPayload

REAL = Options.for_sensors(True)
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
