"""Laws of a force that knows which way the vehicle goes."""

import dataclasses as dc

import numpy as np
import pytest

from np_drake import attitude
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.wind.friction import dry_friction
from np_drake.diagnosis.wind.gauss_markov import wind_force
from np_drake.diagnosis.wind.gust_drag import drag_trace
from np_drake.diagnosis.wind.gusts import as_gusts
from np_drake.effects.linear_drag import LinearDrag
from tests.np_drake.diagnosis.wind.test_gust_drag import D, cause, yielding

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)

MEAN = np.array([0.8, -0.4, 0.0])


def flown(seen, seed, *, friction=0.0, deviation=2.0):
    """(flights, felt) of a vehicle that yields to gusts and rubs along with a force [N], to which it does not."""
    rng, flights, felt = np.random.default_rng(seed), [], {}
    for i in (1, 2):
        e, residual = yielding(
            seen(name=str(i), seed=i, seconds=20.0), rng, MEAN, deviation=deviation, white=0.05
        )
        v = e.from_rows(e.rows.x[:, 7:10])
        rubs = -friction * v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9)
        residual[:, :3] += attitude.rotate_back(e.q, rubs)
        flights.append(e)
        felt[e.name] = residual
    return flights, felt


def found(flights, felt):
    residual = {e.name: felt[e.name] - drag_trace(e, LinearDrag(*D), {}) for e in flights}
    return dry_friction(flights, felt, {}, wind_force(flights, residual, {}))


def test_gusts_do_not_know_which_way_a_vehicle_goes_that_yields_to_them(seen):
    values = [found(*flown(seen, seed)) for seed in range(8)]
    assert max(values) < 1.3
    assert np.mean(values) < 0.0


@pytest.mark.parametrize(("deviation", "least"), [(0.2, 5.0), (1.0, 2.0)])
def test_a_line_that_rubs_does(seen, deviation, least):
    assert found(*flown(seen, 1, friction=0.5, deviation=deviation)) > least


def test_of_a_vehicle_that_stands_still_there_is_no_telling(seen):
    flights, felt = flown(seen, 1)
    still = [dc.replace(e, rows=dc.replace(e.rows, x=e.rows.x * (np.arange(13) < 7))) for e in flights]
    residual = wind_force(flights, felt, {})
    assert dry_friction(still, felt, {}, residual) == 0.0


def test_what_rubs_is_no_gust_and_what_may_is_a_doubted_one(seen, monkeypatch):
    flights, felt = flown(seen, 1)
    for size, named, most in ((0.0, 2, 1.0), (1.5, 2, REAL.thresholds.doubted), (2.5, 1, 1.0)):
        monkeypatch.setattr("np_drake.diagnosis.wind.gusts.dry_friction", lambda *_, size=size: size)
        causes = as_gusts(flights, felt, [cause(*D)], 0.95, IDEAL)
        assert len(causes) == named
        assert max(c.probability for c in causes) <= most
        assert (max(c.probability for c in causes) > REAL.thresholds.doubted) == (
            most > REAL.thresholds.doubted
        )
