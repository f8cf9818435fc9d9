"""Laws of localisation in channel, time, regime and frequency."""

import dataclasses as dc
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from np_drake.diagnosis import localisation as dut
from np_drake.diagnosis.numerics import scale_only
from np_drake.diagnosis.residuals import WRENCH
from np_drake.diagnosis.result import CHANNELS
from np_drake.effects.mass_error import MassError

STEP = 0.02


def white(seed: int, rows: int = 600) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(rows, 15)) * np.linspace(0.1, 1.5, 15)


@pytest.fixture(scope="module")
def noise():
    return scale_only([white(0, 20000)], STEP)


@settings(max_examples=30, deadline=None)
@given(st.floats(0.5, 10.0), st.floats(0.0, 1.0))
def test_the_share_explained_is_the_power_that_went_above_the_floor(noise, gap, share):
    floor = noise.rms
    before = np.sqrt(1 + gap**2) * floor * np.ones((50, 1))
    after = np.sqrt(1 + (1 - share) * gap**2) * floor * np.ones((50, 1))
    found = dut._channel_gaps({"a": before}, {"a": after}, noise, {"a": np.ones(50, bool)})
    assert [c.channel for c in found] == list(CHANNELS)
    for c, channel in enumerate(found):
        assert channel.explained == pytest.approx(share, abs=1e-9)
        assert channel.rms == pytest.approx(before[0, c])
        assert channel.after == pytest.approx(after[0, c])
        assert channel.noise_floor == pytest.approx(floor[c])
        assert channel.unit == ("N" if c < 3 else "N·m")


def test_where_there_is_no_gap_nothing_is_explained(noise):
    rows = {"a": np.ones(50, bool)}
    still = {"a": noise.rms * np.ones((50, 1))}
    assert [c.explained for c in dut._channel_gaps(still, still, noise, rows)] == [0.0] * 6


def test_rows_that_do_not_count_are_left_out(noise):
    values = np.ones((50, 6))
    values[25:] = 1e6
    found = dut._channel_gaps({"a": values}, {"a": values}, noise, {"a": np.arange(50) < 25})
    assert found[0].rms == 1.0


def with_residual(flight, y):
    return dc.replace(flight, y=y)


@pytest.mark.parametrize("when", [3.0, 6.2, 9.0])
def test_a_change_point_lies_where_the_step_is(seen, noise, when):
    y = white(1, 601)
    y[:, 2] += np.where(seen().t >= when, 4 * noise.rms[2], 0.0)
    found = dut._segments(with_residual(seen(), y), noise)
    assert len(found) == 2
    assert found[0].end == pytest.approx(when, abs=dut.COARSE)
    assert found[0].end == found[1].start
    assert found[0].rms[2] == pytest.approx(1.0, abs=0.2)
    assert found[1].rms[2] == pytest.approx(np.sqrt(17), rel=0.1)


def test_noise_has_no_change_point(seen, noise):
    (found,) = dut._segments(with_residual(seen(), white(2, 601)), noise)
    assert found.start == seen().t[0]
    assert found.end == pytest.approx(seen().t[-1], abs=dut.COARSE)
    np.testing.assert_allclose(found.rms, 1.0, atol=0.15)


def test_regimes_hold_every_row_once(seen, noise):
    flights = [seen(name=str(i), seed=i, seconds=6.0) for i in range(2)]
    after = {e.name: e.y[:, WRENCH] for e in flights}
    total = sum(len(e.t) for e in flights)
    found = dut._regimes(flights, after, noise)
    for name in {r.quantity for r in found}:
        own = [r for r in found if r.quantity == name]
        assert sum(r.rows for r in own) == total
        assert 2 <= len(own) <= 8
        assert all(a.upper == b.lower for a, b in pairwise(own))


@given(st.floats(0.01, 300.0), st.floats(-50.0, 50.0), st.integers(0, 99))
@settings(max_examples=50, deadline=None)
def test_bounds_of_regimes_are_round_and_hold_every_value(spread, middle, seed):
    value = middle + spread * np.random.default_rng(seed).normal(size=500)
    bounds = dut._round_bounds(value)
    step = np.diff(bounds).min()
    assert bounds[0] <= value.min() < value.max() <= bounds[-1]
    assert float(f"{step:.6e}"[:8]) in (1.0, 2.0, 5.0)
    np.testing.assert_allclose(bounds / step, np.round(bounds / step), atol=1e-6)


def test_a_residual_that_grows_with_speed_does_so_across_speed_regimes(seen, noise):
    flight = seen()
    speed = dut.quantities(flight)["speed"][0]
    y = white(3, len(flight.t))
    y[:, 0] += 5 * noise.rms[0] * speed
    flight = with_residual(flight, y)
    found = [
        r for r in dut._regimes([flight], {"a": 0 * y[:, WRENCH]}, noise) if r.quantity == "speed"
    ]
    sizes = [r.rms[0] for r in found]
    assert sizes == sorted(sizes)
    assert sizes[-1] > 2 * sizes[0]
    assert all(r.rms_after == (0.0,) * 6 for r in found)


def test_what_never_changes_is_no_regime(seen, noise):
    hover = seen(vigour=0.0)
    assert dut._regimes([hover], {"a": hover.y[:, WRENCH]}, noise) == ()


def test_quantities_are_those_of_the_flight(seen):
    flight = seen()
    found = dut.quantities(flight)
    assert {n: unit for n, (_, unit) in found.items()} == {
        "speed": "m/s",
        "thrust": "N",
        "height": "m",
        "tilt": "deg",
        "rate": "rad/s",
    }
    v = np.linalg.norm(flight.log.v[::2], axis=1)
    np.testing.assert_allclose(found["speed"][0][20:-20], v[20:-20], atol=0.02)
    assert 5.0 < found["tilt"][0].max() < 60.0


def test_spectra_of_white_noise_are_flat_and_as_the_model_says(seen, noise):
    flight = with_residual(seen(seconds=60.0), white(4, 3001))
    found = dut._bands([flight], {"a": 0.5 * flight.y[:, WRENCH]}, noise)
    assert [b.channel for b in found] == list(CHANNELS)
    for band in found:
        inside = slice(2, -2)
        np.testing.assert_allclose(band.before[inside].mean(), band.noise[inside].mean(), rtol=0.1)
        np.testing.assert_allclose(band.after, 0.25 * band.before)
        assert band.frequency[-1] == pytest.approx(25.0)


def test_all_of_it_is_of_the_flights_that_were_given(seen, noise):
    flight = seen(MassError(0.3), noise=1.0)
    found = dut.localise([flight], {"a": 0 * flight.y}, noise, {"a": np.ones(len(flight.t), bool)})
    assert found.times["a"] is flight.t
    np.testing.assert_array_equal(found.before["a"], flight.y[:, WRENCH])
    np.testing.assert_array_equal(found.after["a"], 0.0)
    assert {s.flight for s in found.segments} == {"a"}
    assert found.channels[2].explained > 0.9
