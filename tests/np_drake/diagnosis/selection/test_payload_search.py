import numpy as np
import pytest

from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.regressors import library_candidates
from np_drake.diagnosis.residuals import FORCE
from np_drake.diagnosis.selection.payload_search import PayloadSearch, payload_about, payload_of
from np_drake.effects.suspended_payload import SuspendedPayload

REAL = Options.for_sensors(True)
PRIORS = REAL.priors


def others(flights):
    wanted = ("mass_error", "thrust_scale", "linear_drag")
    return [c for c in library_candidates(flights) if c.identifiers[0] in wanted]


@pytest.mark.parametrize("length", [0.35, 0.8])
def test_the_length_of_a_tether_is_found(seen, noise, length):
    payload = SuspendedPayload(0.15, length)
    flights = [seen(payload, name=str(i), seed=i, noise=1.0, seconds=7.0) for i in (1, 2)]
    dut = PayloadSearch(flights, options=REAL)
    (guess, _), *_ = dut.followed(noise, [], others(flights))
    assert guess.effect.length == pytest.approx(length, rel=0.02)


def test_without_a_payload_no_length_has_evidence(seen, noise):
    flights = [seen(name=str(i), seed=i, noise=1.0, seconds=6.0) for i in (1, 2)]
    assert PayloadSearch(flights, options=REAL).followed(noise, [], others(flights)) == []


@pytest.mark.parametrize("off", [-0.25, 0.2, 0.9])
def test_an_onset_that_is_known_roughly_is_sharpened_to_the_row(seen, noise, off):
    payload = SuspendedPayload(0.2, 0.5)
    flight = seen(
        payload, name="1", seed=1, noise=1.0, seconds=10.0, onset={"suspended_payload": 4.0}
    )
    dut = PayloadSearch([flight], onset={"1": 4.0 + off}, options=REAL)
    assert dut.when(noise, [], payload_of(0.5))["1"] == pytest.approx(4.0, abs=0.03)
    # what has no onset gets none
    assert PayloadSearch([flight], options=REAL).when(noise, [], payload_of(0.5)) == {}


def test_columns_of_a_payload_mean_what_its_guess_moves_to(seen):
    flights = [seen(name=str(i), seed=i, seconds=5.0) for i in (1, 2)]
    guess = Term(SuspendedPayload(1.0, 0.6, 0.01, 0.0, -0.1, 0.3))
    dut = payload_about(flights, guess, priors=PRIORS)
    c = 0.1 * np.random.default_rng(1).normal(size=dut.size)
    c[:4] = 0.7, 0.0, 0.0, 0.0  # what a hook adds to the force is of second order
    term = dut.moved(c)
    payload = term.effect.payload
    assert payload.mass == pytest.approx(0.7 * PRIORS.payload_mass * flights[0].vehicle.mass)
    assert payload.damping == pytest.approx(0.3 + c[5] / 0.7 * PRIORS.damping)
    assert payload.hook == pytest.approx((0.01, 0.0, -0.1))
    columns = dut.candidate(flights).columns
    for e in flights:
        elsewhere = np.setdiff1d(np.arange(dut.size), dut.at(e.name))
        assert not columns[e.name][..., elsewhere].any()
        np.testing.assert_array_equal(
            columns[e.name][:, :6][..., dut.at(e.name)], dut.by_flight[e.name]
        )
        assert not columns[e.name][:, 6:].any()
        still = np.where(np.arange(dut.size) == 0, c, 0.0)
        moved = (
            predicted_residual(e, [term])[:, FORCE]
            - predicted_residual(e, [dut.moved(still)])[:, FORCE]
        )
        assert np.linalg.norm(
            columns[e.name][:, FORCE] @ (c - still) - moved
        ) < 0.1 * np.linalg.norm(moved)
