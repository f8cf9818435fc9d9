import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import NEVER, Term, predicted_residual
from np_drake.diagnosis.held_out import (
    HIDDEN_SPAN,
    JUMP_SPAN,
    _span_by_span,
    adapt,
    mark_outliers,
    predictive_terms,
    scored_on_fitted_rows,
    scored_rows,
)
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import onset_log_likelihood
from np_drake.diagnosis.residuals import WRENCH, make_flight_residuals
from np_drake.diagnosis.swing_fit import fitted_to_whole_flight
from np_drake.effects.constant_wind import ConstantWind
from np_drake.effects.gyro_bias import GyroBias
from np_drake.effects.linear_drag import LinearDrag
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload
from np_drake.vehicle import Vehicle

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

HEAVY = MassError(0.2)
PAYLOAD = SuspendedPayload(0.2, 0.5, 0.0, 0.0, -0.05)


@pytest.mark.parametrize("when", [2.5, 6.0, 9.5])
def test_the_onset_in_an_unseen_flight_is_found(seen, noise, when):
    flight = seen(HEAVY, name="c", seed=3, noise=1.0, onset={"mass_error": when})
    (dut,) = adapt([Term(HEAVY, {"a": 1.0})], flight, noise, priors=REAL.priors)
    assert dut.begins("c") == pytest.approx(when, abs=0.2)
    assert dut.effect == HEAVY  # its figures are those of the fit


def test_a_payload_that_is_hung_on_late_is_found_however_it_swings(seen, noise):
    flight = seen(
        PAYLOAD, name="c", seed=4, noise=1.0, vigour=1.6, onset={"suspended_payload": 7.0}
    )
    (dut,) = adapt([Term(PAYLOAD, {"a": 1.0})], flight, noise, priors=REAL.priors)
    assert dut.begins("c") == pytest.approx(7.0, abs=0.2)


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


def test_what_acts_from_the_start_keeps_no_onset(seen, noise):
    flight = seen(HEAVY, name="c", seed=3, noise=1.0)
    (dut,) = adapt([Term(HEAVY, {"a": 4.0})], flight, noise, priors=REAL.priors)
    assert dut.begins("c") is None


def test_what_is_absent_from_a_flight_never_begins_there(seen, noise):
    flight = seen(name="c", seed=3, noise=1.0)
    late = {"a": 4.0}
    dut = adapt(
        [Term(HEAVY, late), Term(LinearDrag(0.5, 0.5, 0.5), late)],
        flight,
        noise,
        priors=REAL.priors,
    )
    assert [t.begins("c") for t in dut] == [NEVER, NEVER]


def test_what_acts_throughout_the_fit_is_not_excused_where_it_is_absent(seen, noise):
    flight = seen(name="c", seed=3, noise=1.0)
    (dut,) = adapt([Term(HEAVY)], flight, noise, priors=REAL.priors)
    assert dut.begins("c") is None


def test_a_sensor_has_no_onset(seen, noise):
    (dut,) = adapt(
        [Term(GyroBias(0.2))], seen(name="c", seed=3, noise=1.0), noise, priors=REAL.priors
    )
    assert dut.begins("c") is None


def test_two_effects_find_their_own_onsets(seen, noise):
    acting = [HEAVY, LinearDrag(0.8, 0.8, 0.8)]
    flight = seen(*acting, name="c", seed=3, noise=1.0, onset={"mass_error": 7.0})
    heavy, drag = adapt([Term(e) for e in acting], flight, noise, priors=REAL.priors)
    assert heavy.begins("c") == pytest.approx(7.0, abs=0.2)
    assert drag.begins("c") is None


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


def test_a_hardly_known_swing_is_foreseen_by_its_mean_and_misses_less(seen, noise):
    faint, missed = dc.replace(PAYLOAD, mass=0.01), []
    for seed, swing in enumerate(
        np.random.default_rng(1).normal(size=(6, 4)) * [0.4, 0.4, 2.0, 2.0]
    ):
        flight = seen(name="c", seed=seed, noise=1.0, seconds=8.0)
        real = predicted_residual(flight, [Term(faint, hidden={"c": swing})])
        terms = adapt(
            [Term(faint)], dc.replace(flight, y=flight.y + real), noise, priors=REAL.priors
        )
        ways = (
            terms,
            predictive_terms(
                terms, dc.replace(flight, y=flight.y + real), noise, priors=REAL.priors
            ),
        )
        rows = scored_rows(terms, flight)
        missed.append(
            [np.sum((predicted_residual(flight, w) - real)[rows, WRENCH] ** 2) for w in ways]
        )
    best, mean = np.sum(missed, axis=0)
    assert mean < 0.9 * best


def test_a_swing_that_is_known_is_foreseen_as_it_is(seen, noise):
    flight = seen(PAYLOAD, name="c", seed=3, noise=1.0)
    terms = adapt([Term(PAYLOAD), Term(HEAVY)], flight, noise, priors=REAL.priors)
    dut = predictive_terms(terms, flight, noise, priors=REAL.priors)
    assert dut[1] is terms[1]
    known, ahead = predicted_residual(flight, terms[:1]), predicted_residual(flight, dut[:1])
    assert np.std(ahead - known) < 0.02 * np.std(known)


def test_rows_that_a_hidden_start_was_fitted_to_are_not_scored(seen):
    flight = seen(name="c", seed=3)
    assert scored_rows([Term(HEAVY)], flight).all()
    rows = scored_rows([Term(HEAVY), Term(PAYLOAD)], flight)
    np.testing.assert_array_equal(rows, flight.t >= HIDDEN_SPAN)
    late = scored_rows([Term(PAYLOAD, {"c": 5.0})], flight)
    np.testing.assert_array_equal(late, (flight.t < 5.0) | (flight.t >= 5.0 + HIDDEN_SPAN))
    assert scored_rows([Term(PAYLOAD, {"c": NEVER})], flight).all()


def knocked(flight, when):
    """The flight with an outlier that lasts two rows."""
    outliers = np.zeros(len(flight.t), bool)
    outliers[np.searchsorted(flight.t, when) + np.arange(2)] = True
    return dc.replace(flight, outliers=outliers)


def test_a_swing_that_jumps_is_found_anew_and_those_rows_do_not_score(seen, noise):
    flight = knocked(seen(PAYLOAD, name="c", seed=3, noise=1.0, seconds=12.0), 6.0)
    jumped = Term(PAYLOAD, hidden={"c": np.array([0.0, 0.0, 0.0, 0.0, 0.3, -0.2, 0.5, 0.8])})
    y = (
        flight.y
        + predicted_residual(flight, [jumped])
        - predicted_residual(flight, [Term(PAYLOAD)])
    )
    flight = dc.replace(flight, y=y)
    (dut,) = adapt([Term(PAYLOAD)], flight, noise, priors=REAL.priors)
    rows = scored_rows([dut], flight)
    after = flight.t > flight.t[flight.outliers][-1]
    assert not rows[after & (flight.t < 6.0 + JUMP_SPAN)].any()
    assert rows[flight.t > 6.1 + JUMP_SPAN].all()
    unaware = dc.replace(dut, hidden={"c": dut.hidden["c"][:4]})
    residual = [
        np.std((flight.y - predicted_residual(flight, [t]))[rows & after][:, :3])
        for t in (dut, jumped, unaware)
    ]
    assert residual[0] < 1.1 * residual[1] < 0.5 * residual[2]


def test_the_rows_of_an_outlier_are_not_scored_beside_a_payload_only(seen):
    flight = knocked(seen(PAYLOAD, name="c", seed=3, noise=1.0), 6.0)
    assert not scored_rows([Term(PAYLOAD)], flight)[flight.outliers].any()
    assert scored_rows([Term(HEAVY), Term(PAYLOAD, {"c": NEVER})], flight).all()


def test_a_flight_too_short_to_judge_a_payload_is_scored_whole_and_says_so(seen):
    flight = seen(PAYLOAD, name="c", seed=3)
    assert not scored_on_fitted_rows([Term(PAYLOAD)], flight)
    short = dc.replace(
        flight, outliers=flight.t >= flight.t[0] + HIDDEN_SPAN
    )  # nothing is left beside its anchor
    assert scored_rows([Term(PAYLOAD)], short).all()
    assert scored_on_fitted_rows([Term(PAYLOAD)], short)
    assert not scored_on_fitted_rows([Term(HEAVY)], short)


def test_a_swing_that_one_span_does_not_show_is_followed_from_the_start(seen, noise):
    wide = np.array([1.2, -0.9, 2.0, 3.0])  # a start that a span by itself does not find
    flight = seen(name="c", seed=4, noise=1.0)
    thrown = Term(PAYLOAD, hidden={"c": wide})
    flight = dc.replace(flight, y=flight.y + predicted_residual(flight, [thrown]))
    trace = _span_by_span([thrown], 0, flight, noise, REAL.priors)
    inside = flight.t < HIDDEN_SPAN
    residual = [
        np.sum(flight.white(noise, flight.y - y)[inside[20:]] ** 2)
        for y in (trace, predicted_residual(flight, [thrown]))
    ]
    assert residual[0] <= 1.05 * residual[1]


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


def test_outliers_are_taken_in_turn_however_many_a_lost_swing_misses(seen, noise):
    flight = seen(PAYLOAD, name="c", seed=3, noise=1.0, seconds=12.0)
    at = np.searchsorted(flight.t, 3.0)
    y = flight.y.copy()
    y[at : at + 2, :3] += 60.0
    y[at + 100 :: 30, 2] -= 60.0  # more rows than a flight's outliers have
    dut = mark_outliers([Term(PAYLOAD)], dc.replace(flight, y=y), noise, priors=REAL.priors)
    assert dut.outliers[at : at + 2].all()


def test_the_profile_is_the_likelihood_of_every_instant(seen, noise):
    flight = seen(HEAVY, name="c", seed=3, noise=1.0, seconds=5.0)
    own = predicted_residual(flight, [Term(HEAVY)])
    t, profile = onset_log_likelihood(flight, noise, flight.y, own)
    for k in (0, 40, 100, 180):
        begun = flight.begun(float(t[k]) if k else None) * own
        residual = [noise.whiten(flight.y), noise.whiten(flight.y - begun)]
        assert profile[k] == pytest.approx(
            0.5 * (np.sum(residual[0] ** 2) - np.sum(residual[1] ** 2))
        )
    assert profile[-1] == 0.0  # not at all
    assert len(t) == len(profile) == len(noise.whiten(flight.y)) + 1
    assert np.isneginf(profile[(t > t[0]) & (t < t[0] + 0.3)]).all()


def test_a_hidden_state_settled_on_the_whole_flight_explains_it_all(seen, noise):
    flight = seen(PAYLOAD, name="1", seed=3, noise=1.0, seconds=12.0)
    late = flight.t > 8.0
    astray = [Term(PAYLOAD, hidden={"1": np.array([0.3, -0.2, 0.0, 0.5])})]
    whole = fitted_to_whole_flight(astray, flight, noise, priors=REAL.priors)
    residual = [
        np.std((flight.y - predicted_residual(flight, terms))[late][:, :3])
        for terms in (astray, whole)
    ]
    assert residual[1] < 1.1 * noise.rms[:3].max() < 0.8 * residual[0]
    drag = Term(LinearDrag(0.3, 0.3, 0.3))
    assert fitted_to_whole_flight([drag], flight, noise, priors=REAL.priors) == [
        drag
    ]  # what has no hidden state stays
