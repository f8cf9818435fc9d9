import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.held_out import HIDDEN_SPAN, adapt, mark_outliers, scored_rows
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import onset_log_likelihood, ordered_changes
from np_drake.diagnosis.residuals import WRENCH, make_flight_residuals
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle
from tests.np_drake.diagnosis.simulated_flights import knocked

REAL = Options.for_sensors(True)
HEAVY = MassError(0.2)
PAYLOAD = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05)


@pytest.mark.parametrize("when", [2.5, 6.0, 9.5])
def test_the_onset_in_an_unseen_flight_is_found(seen, noise, when):
    flight = seen(HEAVY, name="c", seed=3, noise=1.0, onset={"mass_error": when})
    (dut,) = adapt([Term(HEAVY, {"a": 1.0})], flight, noise, priors=REAL.priors)
    assert dut.begins("c") == pytest.approx(when, abs=0.2)
    assert dut.effect == HEAVY  # its figures are those of the fit


@pytest.mark.parametrize("begin", [None, 2.5])
def test_the_loads_of_a_payload_come_in_turn_in_an_unseen_flight(seen, noise, begin):
    onset, loads = {"suspended_payload": begin} if begin else {}, {5.0: 0.4, 8.0: 0.0}
    how = {"name": "c", "seed": 3, "noise": 1.0, "vigour": 0.4, "seconds": 10.0, "height": 9.0}
    flight = seen(PAYLOAD, onset=onset, loads=loads, **how)
    known = Term(PAYLOAD, {"a": begin}, loads=(0.4, 0.0), changes={"a": (3.0, 4.0)})
    (dut,) = adapt([known], flight, noise, priors=REAL.priors)
    assert dut.changes["c"] == pytest.approx((5.0, 8.0), abs=0.1)
    assert dut.begins("c") == (begin and pytest.approx(begin, abs=0.1))
    assert (dut.effect, dut.loads) == (PAYLOAD, (0.4, 0.0))  # its figures are those of the fit
    # a flight in which nothing changes
    (dut,) = adapt([known], seen(PAYLOAD, **how), noise, priors=REAL.priors)
    assert dut.changes["c"] == (NEVER, NEVER)


def test_changes_come_in_order_and_as_is_best():
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(2, 9))
    XX, Xy = (np.append(np.cumsum(p[::-1])[::-1], 0.0) for p in (x * x, x * y))
    sizes, cost = (1.0, 2.5, 0.0), 0.2
    gain, following = ordered_changes(XX, Xy, sizes, cost, np.zeros(10, bool))

    def likelihood(rows):
        size = np.zeros(9)
        for row, of in zip(rows, sizes, strict=True):
            size[row:] = of
        return 0.5 * np.sum(y**2 - (y - size * x) ** 2) - cost * sum(r < 9 for r in rows[1:])

    for first in range(10):
        every = [(first, a, b) for a in range(first, 10) for b in range(a, 10)]
        assert gain[first] == pytest.approx(max(map(likelihood, every)))
        second = following[0, first]
        found = (first, second, following[1, second])
        assert likelihood(found) == pytest.approx(gain[first])


def test_a_wind_begins_with_the_drag_that_feels_it(seen, noise):
    wind, drag, late = ConstantWind(4.0, -2.0, 0.5), LinearDrag(0.3, 0.3, 0.2), {"a": 4.0}
    onset = {"linear_drag": 6.0, "constant_wind": 6.0}
    flight = seen(wind, drag, name="c", seed=3, noise=1.0, onset=onset)
    for terms in ([Term(wind, late), Term(drag, late)], [Term(drag, late), Term(wind, late)]):
        begins = [t.begins("c") for t in adapt(terms, flight, noise, priors=REAL.priors)]
        assert begins == pytest.approx([6.0, 6.0], abs=0.1)
    flight = seen(wind, drag, name="c", seed=3, noise=1.0, onset={"constant_wind": 6.0})
    steady, late_wind = adapt([Term(drag), Term(wind, late)], flight, noise, priors=REAL.priors)
    assert steady.begins("c") is None
    assert late_wind.begins("c") == pytest.approx(6.0, abs=0.1)


def test_the_swing_at_the_start_of_an_unseen_flight_is_found(fly, noise):
    log = fly(PAYLOAD, name="c", seed=3, noise=1.0)
    middle = log.rows(420, len(log))  # the payload is swinging
    flight = make_flight_residuals(dc.replace(middle, t=middle.t - middle.t[0]), Vehicle())
    (dut,) = adapt([Term(PAYLOAD)], flight, noise, priors=REAL.priors)
    rows = scored_rows([dut], flight)
    residual, still = (
        noise.whiten(flight.y - predicted_residual(flight, [t])[:, :])[rows[noise.phi.shape[1] :]][
            :, WRENCH
        ]
        for t in (dut, Term(PAYLOAD))
    )
    assert np.abs(dut.hidden["c"]).max() > 0.05  # [rad, rad/s]
    assert np.sqrt(np.mean(residual**2)) < 1.3
    assert np.sqrt(np.mean(still**2)) > 1.2 * np.sqrt(np.mean(residual**2))


def test_rows_that_a_hidden_start_was_fitted_to_are_not_scored(seen):
    flight = seen(name="c", seed=3)
    assert scored_rows([Term(HEAVY)], flight).all()
    rows = scored_rows([Term(HEAVY), Term(PAYLOAD)], flight)
    np.testing.assert_array_equal(rows, flight.t >= HIDDEN_SPAN)
    late = scored_rows([Term(PAYLOAD, {"c": 5.0})], flight)
    np.testing.assert_array_equal(late, (flight.t < 5.0) | (flight.t >= 5.0 + HIDDEN_SPAN))
    assert scored_rows([Term(PAYLOAD, {"c": NEVER})], flight).all()


def test_outliers_of_a_swing_are_taken_in_turn(seen, noise):
    flight = seen(PAYLOAD, name="c", seed=3, noise=1.0, seconds=12.0)
    at = np.searchsorted(flight.t, 6.0)
    jumped = Term(PAYLOAD, hidden={"c": np.array([0.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.5, 0.8])})
    y = flight.y - predicted_residual(flight, [Term(PAYLOAD)])
    y = y + predicted_residual(knocked(flight, 6.0), [jumped])
    y[at : at + 2, :3] += 60.0
    dut = mark_outliers([Term(PAYLOAD)], dc.replace(flight, y=y), noise, priors=REAL.priors)
    assert dut.outliers[at : at + 2].all()
    assert dut.outliers.sum() < 8  # nothing of the swing that is lost there


def test_the_profile_is_the_likelihood_of_every_instant(seen, noise):
    flight = seen(HEAVY, name="c", seed=3, noise=1.0, seconds=5.0)
    own = predicted_residual(flight, [Term(HEAVY)])
    t, profile, _ = onset_log_likelihood(flight, noise, flight.y, own)
    for k in (0, 40, 100, 180):
        begun = flight.begun(float(t[k]) if k else None) * own
        residual = [noise.whiten(flight.y), noise.whiten(flight.y - begun)]
        assert profile[k] == pytest.approx(
            0.5 * (np.sum(residual[0] ** 2) - np.sum(residual[1] ** 2))
        )
    assert profile[-1] == 0.0  # not at all
    assert len(t) == len(profile) == len(noise.whiten(flight.y)) + 1
    assert np.isneginf(profile[(t > t[0]) & (t < t[0] + 0.3)]).all()
