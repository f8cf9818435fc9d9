"""Laws of slow forces, of their strength, and of what follows a place."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake import attitude
from np_drake.diagnosis.forward_model import Term, predicted_residual
from np_drake.diagnosis.options import Options
from np_drake.diagnosis.residuals import FORCE
from np_drake.diagnosis.slow_force import (
    BIN,
    binned,
    cosine_variances,
    drags,
    forces,
    instants,
    position_p_value,
    since,
    slow_force,
    slow_power,
    transformed,
    width,
    wind_force,
)
from np_drake.effects.gusty_wind import GustyWind
from np_drake.effects.linear_drag import LinearDrag

REAL, IDEAL = Options.for_sensors(True), Options.for_sensors(False)
THRESHOLDS = REAL.thresholds
DRAG = LinearDrag(0.3, 0.3, 0.3)


def flown(seen, *effects, seconds=30.0, **how):
    return [seen(*effects, name=str(i), seed=i, noise=1.0, seconds=seconds, **how) for i in (1, 2)]


def left_of(flights, *effects):
    return {
        e.name: e.y - predicted_residual(e, [Term(effect) for effect in effects]) for e in flights
    }


@pytest.mark.parametrize("time", [0.5, 1.5])
def test_gusts_are_a_force_in_the_air(seen, time):
    flights = flown(seen, DRAG, GustyWind(0.0, 0.0, 0.0, 1.5, time, seed=4))
    evidence, deviation = slow_force(flights, left_of(flights, DRAG), IDEAL)
    assert evidence > THRESHOLDS.slow_force_evidence + 5.0
    assert deviation == pytest.approx(0.45, rel=0.4)


@settings(max_examples=20, deadline=None)
@given(st.floats(0.05, 5.0), st.floats(0.1, 3.0))
def test_variances_are_those_of_averages_of_a_gauss_markov_process(time, deviation):
    n, fine = 30, 40
    t = (np.arange(n * fine) + 0.5) * BIN / fine
    exact = deviation**2 * np.exp(-np.abs(t[:, None] - t) / time)
    averages = exact.reshape(n, fine, n, fine).mean(axis=(1, 3))
    variances = np.diag(transformed(transformed(averages).T))
    np.testing.assert_allclose(cosine_variances(n, BIN, deviation, time), variances, rtol=2e-3)


@pytest.mark.parametrize("step", [0.01, 0.02, 0.03, 0.04, 0.07, 0.2])
def test_bins_are_where_their_clock_says_at_every_rate(step):
    e = SimpleNamespace(
        t=3.0 + step * np.arange(round(5.0 / step)), grid=SimpleNamespace(step=step)
    )
    middle = instants(e) + 0.5 * (width(e) - step)
    np.testing.assert_allclose(binned(e, e.t[:, None])[:, 0], middle)
    later = since(e, instants(e)[:, None], 5.0)
    assert 5.0 <= later[0, 0] < 5.0 + width(e)


def test_the_force_of_a_drag_is_its_columns_times_its_figures(seen):
    e, d = seen(name="1", seed=1, seconds=8.0), (0.3, 0.2, 0.1)
    np.testing.assert_allclose(
        drags(e) @ d, forces(e, predicted_residual(e, [Term(LinearDrag(*d))])), atol=1e-9
    )


def test_nine_of_ten_intervals_hold_winds_of_the_prior(flights, pushed):
    centre, spread = IDEAL.priors.gust_time
    inside = []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time = centre * np.exp(spread * rng.standard_normal())
        dut = wind_force(flights, pushed(flights, rng, time), {}, IDEAL)
        for (value, low, high), true in ((dut.deviation, 0.5), (dut.time, time)):
            assert low < value < high
            inside.append(low < true < high)
        inside += list(np.abs(dut.mean[:, 0] - [0.3, -0.2, 0.1]) < dut.mean[:, 1])
    assert 0.9 < np.mean(inside) <= 1.0


def test_a_slow_force_has_its_mean_square_as_power_and_a_fast_one_none(seen):
    flights = flown(seen, seconds=20.0)
    for frequency, expected in ((0.3, 0.5 * 0.8**2), (4.0, 0.0)):
        residual = {}
        for e in flights:
            level = 0.8 * np.sin(2 * np.pi * frequency * e.t)
            force = attitude.rotate_back(e.q, np.column_stack([level, level, 0 * level]))
            residual[e.name] = np.zeros_like(e.y)
            residual[e.name][:, FORCE] = force
        assert slow_power(flights, residual) == pytest.approx(expected, rel=0.1, abs=0.01)


@pytest.fixture(scope="module")
def flights(seen):
    return [seen(name=str(i), seed=i, seconds=20.0) for i in (1, 2)]


def field(e, slope, normal):
    """(n, 3) force in W that grows along `normal`."""
    p = np.stack([np.interp(e.t, e.rows.t, axis) for axis in e.rows.x[:, :3].T], axis=1)
    return slope * (p @ normal)[:, None] * normal


def test_gusts_follow_the_place_as_often_as_chance_has_it(seen, pushed):
    flights, found = [seen(name=str(i), seed=i, seconds=12.0) for i in (1, 2)], []
    for seed in range(60):
        residual = pushed(flights, np.random.default_rng(seed), 0.6)
        found.append(position_p_value(flights, residual, IDEAL))
    assert 0.35 < np.mean(found) < 0.65
    assert np.mean(np.array(found) < 0.1) < 0.25


def test_a_force_tied_to_a_place_is_no_gust_whatever_its_mean_in_a_flight(flights, pushed):
    normal = np.array([0.8, 0.6, 0.0])
    residual = pushed(flights, np.random.default_rng(3), 0.6)
    for i, e in enumerate(flights):
        tied = field(e, 1.0, normal) + 0.3 * i
        residual[e.name] = 0.3 * residual[e.name]
        residual[e.name][:, :3] += attitude.rotate_back(e.q, tied)
    assert position_p_value(flights, residual, IDEAL) < 1e-6


def test_noise_alone_is_no_slow_force(seen):
    flights = flown(seen, DRAG, seconds=12.0)
    assert slow_force(flights, left_of(flights, DRAG), IDEAL)[0] < THRESHOLDS.slow_force_evidence
