import dataclasses as dc

import numpy as np
import pytest

from np_drake.diagnosis.forward_model import predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import Guess, library_candidates, payload_about, payloads_of
from np_drake.diagnosis.regressors.payload import SEARCH_LENGTHS
from np_drake.diagnosis.residuals import FORCE
from np_drake.diagnosis.residuals.resampling import TAPS
from np_drake.diagnosis.selection.payload_search import (
    ENDS,
    KEPT,
    LOST,
    NEAR,
    OtherRegressors,
    PayloadSearch,
)
from np_drake.effects.mass_error import MassError
from np_drake.effects.suspended_payload import SuspendedPayload

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
PRIORS = REAL.priors


def others(flights):
    wanted = ("mass_error", "thrust_scale", "linear_drag")
    return [c for c in library_candidates(flights) if c.identifiers[0] in wanted]


@pytest.mark.parametrize("length", [0.35, 0.8])
def test_the_length_of_a_tether_is_found(seen, noise, length):
    payload = SuspendedPayload(0.15, length)
    flights = [seen(payload, name=str(i), seed=i, noise=1.0, seconds=7.0) for i in (1, 2)]
    dut = PayloadSearch(flights, options=REAL)
    best = dut.best(noise, [], others(flights))
    assert best[0].variant.startswith("length=")
    assert float(best[0].variant.removeprefix("length=")) == pytest.approx(length, rel=0.02)
    assert dut.profile(noise, others(flights)).max() > 100.0


def test_the_best_lengths_are_not_next_to_each_other(seen, noise):
    flights = [seen(SuspendedPayload(0.15, 0.5), name="1", seed=1, noise=1.0, seconds=6.0)]
    best = PayloadSearch(flights, options=REAL).best(noise, [], others(flights))
    found = np.sort([float(c.variant.removeprefix("length=")) for c in best])
    assert 1 <= len(found) <= KEPT
    assert np.all(np.diff(np.log(found)) > NEAR)


def test_without_a_payload_no_length_has_evidence(seen, noise):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=6.0) for i in (1, 2)]
    assert PayloadSearch(flights, options=REAL).profile(noise, others(flights)).max() < 5.0


def test_what_more_mass_explains_is_no_evidence_for_a_payload(seen, noise):
    flights = [seen(MassError(0.2), name=str(i), seed=i, noise=1.0, seconds=6.0) for i in (1, 2)]
    assert PayloadSearch(flights, options=REAL).profile(noise, others(flights)).max() < 5.0


def test_before_its_onset_a_payload_hangs_on_nothing(seen):
    flights = [seen(name="1", seed=1, seconds=6.0)]
    for payload in payloads_of(
        flights, np.geomspace(*SEARCH_LENGTHS)[::24], onset={"1": 3.0}, priors=PRIORS
    ):
        candidate = payload.candidate(flights)
        X = candidate.columns["1"]
        smear = TAPS * flights[0].grid.step
        np.testing.assert_allclose(X[flights[0].t < 3.0 - smear], 0.0, atol=1e-12)
        assert np.abs(X[flights[0].t > 3.0 + smear]).max() > 0.1


def test_a_library_without_payload_searches_nothing(seen, noise, library):
    del library["suspended_payload"]
    assert PayloadSearch([seen(seconds=5.0)], options=REAL).best(noise, [], []) == []


@pytest.mark.parametrize("off", [-0.25, 0.2, 0.9])
def test_an_onset_that_is_known_roughly_is_sharpened_to_the_row(seen, noise, off):
    payload = SuspendedPayload(0.2, 0.5)
    flight = seen(
        payload, name="1", seed=1, noise=1.0, seconds=10.0, onset={"suspended_payload": 4.0}
    )
    dut = PayloadSearch([flight], onset={"1": 4.0 + off}, options=REAL)
    assert dut.when(noise, [], Guess(0.5))["1"] == pytest.approx(4.0, abs=0.03)
    assert (
        PayloadSearch([flight], options=REAL).when(noise, [], Guess(0.5)) == {}
    )  # what has no onset gets none


def test_one_pass_over_the_rows_gives_all_horizons_and_sets_of_others(seen, noise):
    flights = [
        seen(SuspendedPayload(0.15, 0.6), name=str(i), seed=i, noise=1.0, seconds=7.0)
        for i in (1, 2)
    ]
    mass, *more = others(flights)
    rich, alone = (OtherRegressors(flights, noise, some, None) for some in ([mass, *more], [mass]))
    (candidate,) = payloads_of(flights, np.array([0.6]), priors=PRIORS)
    own = np.r_[: alone.size, rich.size : rich.size + candidate.size]
    white = rich.white(candidate)
    for both, horizon in zip(rich.joints(white, ENDS), ENDS, strict=True):
        assert rich.gain_of(both, white, horizon) == pytest.approx(rich.gain(white, horizon)[0])
        assert alone.gain_of(both.only(own), white, horizon) == pytest.approx(
            alone.gain(white, horizon)[0]
        )


def test_a_head_of_the_flights_tells_up_to_its_horizon_what_all_of_them_do(seen, noise):
    flights = [
        seen(SuspendedPayload(0.15, 0.6), name=str(i), seed=i, noise=1.0, seconds=9.0)
        for i in (1, 2)
    ]
    outliers = [
        np.isin(np.arange(len(e.t)), rows)
        for e, rows in zip(flights, ([150, 151], [300]), strict=True)
    ]
    flights = [dc.replace(e, outliers=s) for e, s in zip(flights, outliers, strict=True)]
    dut = OtherRegressors(flights, noise, others(flights), {"2": 1.0}, horizons=(4.0, np.inf))
    heads = dut.heads(4.0)
    assert [len(e.t) for e in heads] < [len(e.t) for e in flights]
    guess = Guess(0.55, swing={"1": np.array([0.1, -0.1, 0.2, 0.3])})
    short, whole = (
        payload_about(some, guess, onset={"2": 1.0}, priors=PRIORS) for some in (heads, flights)
    )
    (gain, mean), (expected, all_of_it) = (dut.gain(dut.white(p), 4.0) for p in (short, whole))
    assert gain == pytest.approx(expected, rel=1e-9)
    moved, far = short.moved(mean), whole.moved(all_of_it)
    assert moved.length == pytest.approx(far.length)
    np.testing.assert_allclose(moved.hook, far.hook)
    for e, columns in zip(flights, dut.white(whole).columns, strict=True):
        expected = noise.head(6).whiten(e.bridged(whole.own[e.name]))
        np.testing.assert_allclose(columns.reshape(expected.shape), expected, atol=1e-12)
    for e in heads:  # what jumps after the horizon is not known there
        np.testing.assert_allclose(
            moved.swing[e.name], far.swing[e.name][: len(moved.swing[e.name])]
        )


def test_a_payload_that_the_air_brakes_is_followed_to_its_damping(seen, noise):
    true = SuspendedPayload(0.15, 0.5, damping=0.3)
    flights = [seen(true, name=str(i), seed=i, noise=1.0, seconds=10.0) for i in (1, 2)]
    (guess, _), *_ = PayloadSearch(flights, REAL).followed(noise, [], others(flights))
    assert guess.damping == pytest.approx(0.3, abs=0.1)  # [1/s]
    assert guess.length == pytest.approx(0.5, rel=0.01)


def test_a_damping_costs_a_guess_its_prior_and_is_never_negative(seen):
    flights = [seen(name="1", seed=1, seconds=5.0)]
    still, braked = (
        payload_about(flights, Guess(0.6, damping=c), priors=PRIORS) for c in (0.0, 0.3)
    )
    assert still.log_prior - braked.log_prior == pytest.approx(0.5 * (0.3 / PRIORS.damping) ** 2)
    c = np.where(np.arange(still.size) == 5, -3.0, 0.0)
    c[0] = 1.0
    assert still.moved(c).damping == 0.0


def test_a_guess_that_is_lost_is_given_up(seen, noise, monkeypatch):
    flights = [seen(SuspendedPayload(0.15, 0.5), name="1", seed=1, noise=1.0, seconds=6.0)]
    dut = PayloadSearch(flights, options=REAL)
    assert dut.best(noise, [], others(flights))
    gain = OtherRegressors.gain
    monkeypatch.setattr(OtherRegressors, "gain", lambda self, *how: (2 * LOST, gain(self, *how)[1]))
    assert dut.best(noise, [], others(flights)) == []
    assert dut.from_guesses(noise, [], [Guess(0.5)]) == []


def test_columns_of_a_payload_mean_what_its_guess_moves_to(seen):
    flights = [seen(name=str(i), seed=i, seconds=5.0) for i in (1, 2)]
    dut = payload_about(
        flights, Guess(0.6, np.array([0.01, 0.0, -0.1]), damping=0.3), priors=PRIORS
    )
    c = 0.1 * np.random.default_rng(1).normal(size=dut.size)
    c[:4] = 0.7, 0.0, 0.0, 0.0  # what a hook adds to the force is of second order
    guess, (term,) = dut.moved(c), dut.terms(c)
    payload = term.effect.payload
    assert (payload.mass, payload.length) == pytest.approx((0.7 * dut.unit, guess.length))
    assert payload.damping == guess.damping == pytest.approx(0.3 + c[5] / 0.7 * PRIORS.damping)
    np.testing.assert_allclose(payload.hook, guess.hook)
    for name, swing in guess.swing.items():
        np.testing.assert_array_equal(term.hidden[name], swing)
    columns = dut.candidate(flights).columns
    for e in flights:
        elsewhere = np.setdiff1d(np.arange(dut.size), dut.at(e.name))
        assert not columns[e.name][..., elsewhere].any()
        np.testing.assert_array_equal(columns[e.name][:, :6][..., dut.at(e.name)], dut.own[e.name])
        assert not columns[e.name][:, 6:].any()
        still = np.where(np.arange(dut.size) == 0, c, 0.0)
        moved = (
            predicted_residual(e, [term])[:, FORCE]
            - predicted_residual(e, dut.terms(still))[:, FORCE]
        )
        assert np.linalg.norm(
            columns[e.name][:, FORCE] @ (c - still) - moved
        ) < 0.1 * np.linalg.norm(moved)
